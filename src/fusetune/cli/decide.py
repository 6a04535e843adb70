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
    from fusetune.apply.decision_summary import DecisionSummary
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
                "settings_changed": {name: {"before": one, "now": other} for name, (one, other) in changed.items()},
                "ranking": decision["ranking"],
                "folder": options.out,
            }
        )
        return DONE
    from fusetune.cli.lines import Lines

    lines = Lines()
    for line in _lines(decision, now, before, changed):
        lines.tell(line)
    if options.out is not None:
        lines.tell(f"Decision and parameter files: {options.out}")
    return DONE


def _settings(then: Mapping[str, Any], asked: list[str]) -> tuple[DecisionSettings, dict[str, tuple[Any, Any]]]:
    """The settings of a run with some changed, and those that are otherwise now."""
    from dataclasses import asdict, replace

    from fusetune.apply.flat_settings import changed_settings
    from fusetune.configuration import read_configuration

    given: dict[str, Any] = {
        "decision": {name: value for name, value in then.items() if name != "seed"},
        "seed": then.get("seed", 0),
    }
    for text in asked:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise UserError("--config", f"{text!r} is not KEY=VALUE", "Mend it")
        given[key if key == "seed" or key.startswith("decision.") else f"decision.{key}"] = value
    read = read_configuration([], given)
    settings = replace(read.decision, seed=read.seed)
    return settings, changed_settings(then, asdict(settings))


def _lines(
    decision: Mapping[str, Any], now: DecisionSummary, before: DecisionSummary, changed: Mapping[str, tuple[Any, Any]]
) -> Iterator[str]:
    from fusetune.apply.ranking import improvement_percent
    from fusetune.cli.output.tables import interval, percent, table_lines

    yield from now.lines()
    yield "Before: the same." if now.sentence == before.sentence else f"Before: {before.sentence}"
    for name, (one, other) in changed.items():
        yield f"Setting {name}: {one} → {other}"
    rows = [["set", "change", "interval", "better on", ""]]
    for row in decision["ranking"]:
        told = ["", "", ""]
        if not row["is_present"]:
            gain, ends = row["improvement_percent"], (row["lower"], row["upper"])
            span = interval(*(None if end is None else -improvement_percent(end) for end in ends))
            told = [percent(None if gain is None else -gain), span, f"{row['flights_better']} of {row['flights']}"]
        rows.append([row["name"], *told, row["status"]])
    yield from table_lines(rows, right=(1, 2, 3), indent=" ")
