"""The study's results as Markdown."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

import numpy as np

from .judge import Resampled, Verdict, by_rule, studies
from .rules import OURS, SCORE_ONLY
from .world import TRUTH, World


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _percent(value: float) -> str:
    return f"{100.0 * value:.1f}"


def rules_table(verdicts: Sequence[Verdict]) -> str:
    """One row per rule: in how many studies it passes, and its mean and worst regret."""
    rows = []
    for rule, found in by_rule(verdicts).items():
        worst = max(found, key=lambda one: max(one.regret.values()))
        regret = [[one.regret[name] for one in found] for name in TRUTH]
        rows.append(
            [
                rule,
                f"{sum(one.passes for one in found)} of {len(found)}",
                *(_percent(float(np.mean(values))) for values in regret),
                f"{_percent(max(worst.regret.values()))} ({worst.world}, {worst.study})",
                str(sum(bool(one.worst_in) for one in found)),
            ]
        )
    head = ["rule", "passes", *(f"regret, {name} %" for name in TRUTH), "worst regret %", "worst set chosen"]
    return _table(head, rows)


def choices_table(verdicts: Sequence[Verdict]) -> str:
    """One row per world and study: what the product chose, its regrets, and what minimum mean NIS chose."""
    grouped = by_rule(verdicts)
    rows = []
    for ours, plain, nis in zip(grouped[OURS], grouped[SCORE_ONLY], grouped["minimum mean NIS"], strict=True):
        regrets = [_percent(ours.regret[name]) for name in TRUTH]
        outcome = (
            "near the best" if max(ours.regret.values()) <= 0.05 else "on the front" if ours.on_front else "**no**"
        )
        nis_text = f"{nis.chosen} ({_percent(max(nis.regret.values()))})"
        rows.append([ours.world, ours.study, ours.chosen, *regrets, outcome, plain.chosen, nis_text])
    head = [
        "world",
        "study",
        "chosen",
        *(f"{name} %" for name in TRUTH),
        "passes",
        "lowest score",
        "minimum mean NIS (worst regret %)",
    ]
    return _table(head, rows)


def resampled_table(found: Sequence[Resampled], options: argparse.Namespace) -> str:
    """One row per rule, over drawn studies."""
    rows = [
        [one.rule, _percent(one.passed), _percent(one.best), _percent(one.regret), _percent(one.ever_worst)]
        for one in found
    ]
    head = ["rule", "passes %", "chooses the best %", "mean worst regret %", "chooses the worst in all %"]
    title = f"{options.resamples} studies of {options.flights} flights, drawn from {options.pool} of each world:"
    return title + "\n\n" + _table(head, rows)


def calibration_table(covered: Mapping[str, float], twins: Mapping[str, float], dealt: Mapping[str, float]) -> str:
    """Coverage of the intervals, and changes recommended where no set is better, per world."""
    columns = (covered, twins, dealt)
    rows = [[world, *(_percent(column[world]) for column in columns)] for world in covered]
    rows.append(["**all**", *(_percent(float(np.mean(list(column.values())))) for column in columns)])
    head = ["95 % intervals that hold the truth %", "changes among identical sets %", "changes among equal sets %"]
    return _table(["world", *head], rows)


def truth_tables(worlds: Sequence[World]) -> str:
    """The true errors of every set in every world."""
    parts = []
    for world in worlds:
        everything = studies(world)["both"]
        rows = [
            [world.sets[index], *(f"{world.true_error(name)[index]:.3f}" for name in TRUTH)] for index in everything
        ]
        units = {"velocity": "m/s", "attitude": "°", "position": "m", "drift": "m"}
        parts.append(f"{world.name}:\n\n" + _table(["set", *(f"{name} {units[name]}" for name in TRUTH)], rows))
    return "\n\n".join(parts)


def between_marks(text: str, name: str, content: str) -> str:
    """Replace what stands between `<!-- name -->` and `<!-- /name -->`."""
    first, last = f"<!-- {name} -->", f"<!-- /{name} -->"
    before, rest = text.split(first, 1)
    after = rest.split(last, 1)[1]
    return f"{before}{first}\n{content}\n{last}{after}"
