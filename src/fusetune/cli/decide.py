"""`fusetune decide`."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.errors import UserError

if TYPE_CHECKING:
    from fusetune.apply.settings import DecisionSettings

HELP = "decide anew from scores that are there, with other settings of the decision"
EXAMPLES = (
    ("fusetune decide results", "what was decided, and the ranking"),
    ("fusetune decide results --config confidence=0.9 sources.gnss_vel=2", "what would be decided otherwise"),
    ("fusetune decide results --config lowest_grade=D --out other", "with its parameter files"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Results, settings, folder."""
    parser.add_argument("results", type=Path, metavar="RESULTS", help="folder results of a run")
    parser.add_argument(
        "--config",
        nargs="+",
        action="extend",
        default=[],
        metavar="KEY=VALUE",
        help="settings of the section decision, and seed (config/README.md); all others stay as they were",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="takes decision.json, ranking and parameter files; RESULTS stay"
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Decide and tell; always `DONE`."""
    from fusetune.apply.decide_anew import decide_anew, settings_then
    from fusetune.apply.decision_summary import decision_summary
    from fusetune.apply.results_folder import results_folder

    results = results_folder(options.results)
    if options.out is not None and options.out.resolve().is_relative_to(results.path.resolve()):
        raise UserError(options.out, "lies in the results, which stay as they are", "Name another folder")
    then = settings_then(results)
    settings, changed = _settings(then, options.config)
    with tempfile.TemporaryDirectory(prefix="fusetune_decide_") as room:
        decision = decide_anew(results, options.out or Path(room), settings)
    now, before = decision_summary(decision), decision_summary(results.decision)
    if options.json:
        print_document(
            {
                **now.document(),
                "before": before.document(),
                "settings_changed": {name: {"before": then.get(name), "now": value} for name, value in changed.items()},
                "ranking": decision["ranking"],
                "folder": options.out,
            }
        )
        return DONE
    from fusetune.cli.lines import Lines

    lines = Lines()
    for line in _lines(decision, now.sentence, before.sentence, {name: then.get(name) for name in changed}, changed):
        lines.tell(line)
    if options.out is not None:
        lines.tell(f"Decision and parameter files: {options.out}")
    return DONE


def _settings(then: Mapping[str, Any], asked: list[str]) -> tuple[DecisionSettings, dict[str, Any]]:
    """The settings of a run with some changed, and those that are otherwise now."""
    from dataclasses import asdict, replace

    from fusetune.configuration import read_configuration

    given = {"decision": {name: value for name, value in then.items() if name != "seed"}, "seed": then.get("seed", 0)}
    for text in asked:
        _set(given, text)
    read = read_configuration([], given)
    settings = replace(read.decision, seed=read.seed)
    now = asdict(settings)
    return settings, {name: value for name, value in now.items() if _plain(value) != _plain(then.get(name))}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _set(given: dict[str, Any], text: str) -> None:
    """Put KEY=VALUE in its place; keys of keys are behind a dot."""
    from fusetune.settings.yaml_reader import read_value

    key, equals, value = text.partition("=")
    if not (key.strip() and equals):
        raise UserError("--config", f"{text!r} is not KEY=VALUE", "Mend it")
    if key != "seed" and not key.startswith("decision."):
        key = f"decision.{key}"
    section, _, rest = key.partition(".")
    if not rest:
        given[section] = read_value(value, "--config")
        return
    name, _, below = rest.partition(".")
    if below:
        # of the names of a mapping, which have dots of their own (gnss_vel.z), one is changed and the others stay
        given[section] = {
            **given[section],
            name: {**given[section].get(name, {}), below: read_value(value, "--config")},
        }
    else:
        given[section] = {**given[section], name: read_value(value, "--config")}


def _lines(
    decision: Mapping[str, Any], now: str, before: str, then: Mapping[str, Any], changed: Mapping[str, Any]
) -> Iterator[str]:
    from fusetune.cli.output.tables import percent, table_lines

    yield now
    for change in decision["changes"]:
        yield f"  {change['name']}  {change['previous']:.6g} → {change['value']:.6g}"
    yield "Before: the same." if now == before else f"Before: {before}"
    for name, value in changed.items():
        yield f"Setting {name}: {then[name]} → {value}"
    rows = [["set", "change", "interval", "better on", ""]]
    for one in decision["ranking"]:
        gain = one["improvement_percent"]
        rows.append(
            [
                one["name"],
                "" if one["is_present"] else percent(None if gain is None else -gain),
                "" if one["is_present"] else _interval(one),
                "" if one["is_present"] else f"{one['flights_better']} of {one['flights']}",
                one["status"],
            ]
        )
    yield from table_lines(rows, right=(1, 2, 3), indent=" ")


def _interval(one: Mapping[str, Any]) -> str:
    from fusetune.apply.ranking import improvement_percent

    if one["lower"] is None or one["upper"] is None:
        return "not known"
    lower, upper = (-improvement_percent(one[end]) for end in ("lower", "upper"))
    return f"{lower:+.1f} to {upper:+.1f} %".replace("-", "−")
