"""The study's results as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from .drawn import JUDGED_SIZES, SIZES, DrawnStudy, power
from .judge import Verdict, by_rule
from .nulls import FEWER, MAIN_KINDS
from .rules import OLD, OURS, SCORE_ONLY
from .world import TRUTH, World

GAINS = (0.2, 0.1)
MEASURES = ("velocity", "all four")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _percent(value: float) -> str:
    return "–" if np.isnan(value) else f"{100.0 * value:.1f}"


def _whole_percents(values: Mapping[str, float]) -> str:
    return "/".join(f"{100.0 * values[name]:.0f}" if name in values else "–" for name in TRUTH)


def rules_table(verdicts: Sequence[Verdict]) -> str:
    """One row per rule: in how many studies it passes, and its mean and worst regret."""
    rows = []
    for rule, found in by_rule(verdicts).items():
        worst = max(found, key=lambda one: max(one.regret.values()))
        regret = [[one.regret[name] for one in found if name in one.regret] for name in TRUTH]
        rows.append(
            [
                rule,
                f"{sum(one.passes for one in found)} of {len(found)}",
                f"{sum(one.passes_as_before for one in found)}",
                *(_percent(float(np.mean(values))) for values in regret),
                f"{_percent(max(worst.regret.values()))} ({worst.world}, {worst.study})",
                str(sum(one.is_worst for one in found)),
                str(sum(bool(one.harm) for one in found)),
            ]
        )
    head = [
        "rule",
        "passes",
        "by the first study's measure",
        *(f"regret, {name} %" for name in TRUTH),
        "worst regret %",
        "worst set chosen",
        "a figure more than 5 % worse than before",
    ]
    return _table(head, rows)


def _outcome(one: Verdict) -> str:
    if one.is_near:
        return "near the best"
    if one.passes:
        return "on the front"
    return f"**no**: {', '.join(one.beaten_by) or 'the worst'}"


def choices_table(verdicts: Sequence[Verdict]) -> str:
    """One row per world and study: what the decision chose and the one before it, their regrets, the lowest score."""
    grouped = by_rule(verdicts)
    rows = []
    for ours, old, plain in zip(grouped[OURS], grouped[OLD], grouped[SCORE_ONLY], strict=True):
        harm = ", ".join(f"{name} {100.0 * value:.0f}" for name, value in ours.harm.items())
        row = [ours.world, ours.study]
        for one in (ours, old):
            row += [one.chosen, _whole_percents(one.regret), _outcome(one)]
        rows.append([*row, harm or "–", plain.chosen])
    regret = f"regret {'/'.join(TRUTH)} %"
    head = ["world", "study"]
    for rule in (OURS, OLD):
        head += [f"{rule}: chosen", regret, "passes"]
    return _table([*head, "worse than before by more than 5 %", "lowest score"], rows)


def resampled_table(drawn: Sequence[DrawnStudy], resamples: int, pool: int) -> str:
    """One row per rule and number of flights, over drawn studies."""
    rows = []
    for flights in JUDGED_SIZES:
        found = [one for one in drawn if one.flights == flights]
        for rule in dict.fromkeys(one.rule for one in found):
            own = [one for one in found if one.rule == rule]
            shares = ([getattr(one, name) for one in own] for name in ("passed", "is_best", "worst_regret"))
            harms = (np.mean([getattr(one, name) for one in own]) for name in ("is_worst", "harms"))
            rows.append(
                [
                    str(flights),
                    rule,
                    *(_percent(float(np.mean(one))) for one in shares),
                    *(_percent(float(one)) for one in harms),
                ]
            )
    head = ["flights", "rule", "passes %", "chooses the best %", "mean worst regret %", "chooses the worst %"]
    title = f"{resamples} studies of each kind, drawn from {pool} flights of each world:"
    return title + "\n\n" + _table([*head, "a figure more than 5 % worse than before %"], rows)


def power_table(drawn: Sequence[DrawnStudy]) -> str:
    """How often what can be gained is gained: all worlds by number of flights, and each world with five and eight."""
    head = ["", *(f"≥ {100 * gain:.0f} % in {measure}" for measure in MEASURES for gain in GAINS)]
    rows = []
    for flights in SIZES:
        rows.append([f"**{flights} flights**", *_found(drawn, flights)])
    for world in dict.fromkeys(one.world for one in drawn):
        own = [one for one in drawn if one.world == world]
        for flights in JUDGED_SIZES:
            rows.append([f"{world}, {flights} flights", *_found(own, flights)])
    title = (
        "Of the studies in which a set that is not vetoed truly gains so much, the share in which the chosen set gains "
        f"as much, %; {OURS}, then {OLD}:"
    )
    return title + "\n\n" + _table(head, rows)


def _found(drawn: Sequence[DrawnStudy], flights: int) -> list[str]:
    cells = []
    for measure in MEASURES:
        for gain in GAINS:
            shares = [power([one for one in drawn if one.rule == rule], flights, gain, measure) for rule in (OURS, OLD)]
            cells.append(f"{_percent(shares[0][0])}, {_percent(shares[1][0])}" if shares[0][1] else "–")
    return cells


def false_changes_table(found: Mapping[str, Mapping[tuple[int, str, str], float]], studies: int) -> str:
    """Changes recommended where no set is better, per world, kind and number of flights; the old rule in brackets."""
    keys = [(flights, kind) for flights, rule, kind in next(iter(found.values())) if rule == OURS]
    rows = []
    for world, shares in found.items():
        rows.append(
            [world, *(_pair(shares[flights, OURS, kind], shares[flights, OLD, kind]) for flights, kind in keys)]
        )
    means = [
        [float(np.mean([shares[flights, rule, kind] for shares in found.values()])) for rule in (OURS, OLD)]
        for flights, kind in keys
    ]
    rows.append(["**all**", *(_pair(*mean) for mean in means)])
    title = (
        f"{studies} studies per world and number of flights of the kinds {', '.join(MAIN_KINDS)}, one in {FEWER} of "
        f"the others and of {OLD}, in brackets:"
    )
    return title + "\n\n" + _table(["world", *(f"{kind}, {flights} flights %" for flights, kind in keys)], rows)


def _pair(ours: float, old: float) -> str:
    return f"{_percent(ours)} ({_percent(old)})"


def calibration_table(covered: Mapping[str, Mapping[int, float]]) -> str:
    """Coverage of the intervals per world."""
    rows = [[world, *(_percent(shares[flights]) for flights in JUDGED_SIZES)] for world, shares in covered.items()]
    mean = [float(np.mean([shares[flights] for shares in covered.values()])) for flights in JUDGED_SIZES]
    rows.append(["**all**", *map(_percent, mean)])
    return _table(["world", *(f"95 % intervals of {one} flights that hold the truth %" for one in JUDGED_SIZES)], rows)


def truth_table(world: World) -> str:
    """The true errors of every set in a world, and the change against the present set."""
    units = {"velocity": "m/s", "attitude": "°", "position": "m", "drift": "m"}
    rows = []
    for index, name in enumerate(world.sets):
        change = world.true_errors[:, index] / world.true_errors[:, 0] - 1.0
        own = dict(zip(world.quantities, world.true_errors[:, index], strict=True))
        values = [f"{own[name]:.3f}" if name in own else "–" for name in TRUTH]
        against = world.vetoed.get(name, ())
        rows.append(
            [name, *values, _signed(dict(zip(world.quantities, change, strict=True))), against[0] if against else ""]
        )
    head = ["set", *(f"{name} {units[name]}" for name in TRUTH), f"change {'/'.join(TRUTH)} %", "vetoed"]
    return _table(head, rows)


def _signed(values: Mapping[str, float]) -> str:
    return "/".join(f"{100.0 * values[name]:+.0f}" if name in values else "–" for name in TRUTH)


def truth_tables(tables: Mapping[str, str]) -> str:
    """The tables of all worlds."""
    return "\n\n".join(f"{world}:\n\n{table}" for world, table in tables.items())


def renew_tables(document: Path, tables: Mapping[str, str]) -> None:
    """Replace the tables of a document, each between the marks of its name."""
    text = document.read_text(encoding="utf-8")
    for name, table in tables.items():
        text = between_marks(text, name, table)
    document.write_text(text, encoding="utf-8")


def between_marks(text: str, name: str, content: str) -> str:
    """Replace what stands between `<!-- name -->` and `<!-- /name -->`.

    Raises
    ------
    ValueError
        The text has no such place.
    """
    first, last = f"<!-- {name} -->", f"<!-- /{name} -->"
    if not 0 <= text.find(first) < text.find(last):
        raise ValueError(f"no place for the table: {first} and {last} are missing")
    before, rest = text.split(first, 1)
    after = rest.split(last, 1)[1]
    return f"{before}{first}\n{content}\n{last}{after}"
