"""`fusetune score`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.cli.command import DONE, REFUSED
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.cli.output.numbers import from_one
from fusetune.errors import UserError

if TYPE_CHECKING:
    from fusetune.library.comparison import Comparison

HELP = "score parameter sets on logs against what flies now, as a table"
EXAMPLES = (
    ("fusetune score flights/*.ulg --set late:EKF2_GPS_DELAY=160", "one set, named late"),
    ("fusetune score a.ulg --set a:EKF2_ACC_NOISE=0.5 --set b:EKF2_ACC_NOISE=1,EKF2_GYR_NOISE=0.03", "two sets"),
    ("fusetune score ~/logs --study config/studies/paper_table11.yaml --json", "the sets of a study"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Logs and sets."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG", help="log, or folder that is searched for logs")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument(
        "--set",
        type=_parameter_set,
        action="append",
        dest="sets",
        default=[],
        metavar="NAME:KEY=VALUE,…",
        help="a set: its name, and the parameters in which it differs from what flies; may be given several times",
    )
    which.add_argument(
        "--study",
        type=Path,
        metavar="STUDY.yaml",
        help="all sets of a study; of one around present values, of the last log",
    )
    parser.add_argument("--cores", type=from_one, metavar="N", help="flights at a time (all cores)")
    add_json(parser)
    parser.epilog = (
        "Figures are changes of the prediction error against the present set, what the newest log's vehicle flew: "
        "below 0 is better. Exit status: 0 all logs were scored; 1 a log has no say, and its reason is told."
    )


def run(options: argparse.Namespace) -> int:
    """Score and print; `REFUSED` where a log has no say."""
    from fusetune.library.comparison import compare
    from fusetune.save.discovery import given_logs

    logs = []
    for log in given_logs(options.logs):
        if log.error is not None:
            raise log.error
        logs.append(Path(log.path))
    sets = _sets(options, logs)
    found = compare(logs, sets, cores=options.cores)
    if options.json:
        print_document(_document(found, sets))
    else:
        from fusetune.cli.lines import Lines

        lines = Lines()
        for line in _lines(found):
            lines.tell(line)
    return DONE if all(found.flights["has_a_say"]) else REFUSED


def _parameter_set(text: str) -> tuple[str, dict[str, float]]:
    """A set as it is typed."""
    name, colon, rest = text.partition(":")
    values: dict[str, float] = {}
    if not (name.strip() and colon):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME:KEY=VALUE,KEY=VALUE")
    for part in rest.split(","):
        key, equals, value = (one.strip() for one in part.partition("="))
        try:
            number = float(value)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r} in {text!r} is not KEY=VALUE with a number") from None
        if not (key and equals):
            raise argparse.ArgumentTypeError(f"{part!r} in {text!r} is not KEY=VALUE")
        if key in values:
            raise argparse.ArgumentTypeError(f"{key} stands twice in {text!r}")
        values[key] = number
    return name.strip(), values


def _sets(options: argparse.Namespace, logs: Sequence[Path]) -> dict[str, dict[str, float]]:
    if options.study is None:
        sets = dict(options.sets)
        if len(sets) < len(options.sets):
            raise UserError("--set", "gives two sets one name", "Give each a name of its own")
        return sets
    from fusetune.design.study import load_study
    from fusetune.save.around_log import study_around_log

    study = load_study(options.study)
    if study.search:
        raise UserError(options.study, "it is a search, whose sets are found on flights", "Run fusetune search LOG…")
    found = study_around_log(logs[-1], study.around).sets if study.around else study.sets
    return {one.name: dict(one.overrides) for one in found}


def _document(found: Comparison, sets: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    changes = found.changes.to_dict("index")
    return {
        "flights": [{**row, "change_percent": changes.get(row["flight"], {})} for row in _rows(found.flights)],
        "sets": [{**row, "parameters": sets.get(row["set"], {})} for row in _rows(found.ranking)],
        "answer": found.answer,
    }


def _rows(table: Any) -> list[Mapping[str, Any]]:
    rows: list[Mapping[str, Any]] = table.to_dict("records")
    return rows


def _lines(found: Comparison) -> Iterator[str]:
    from fusetune.cli.output.tables import interval, percent, table_lines

    ranking = {row["set"]: row for row in _rows(found.ranking)}
    names = [name for name in ranking if name in found.changes.columns]
    missing = [name for name in ranking if ranking[name]["status"] == "not scored"]
    rows = [["change of the prediction error", *names]]
    for flight, changes in found.changes.to_dict("index").items():
        rows.append([str(flight), *(percent(changes[name]) for name in names)])
    compared = [ranking[name] for name in names]
    rows.append(["all flights", *(percent(row["change_percent"]) for row in compared)])
    rows.append(["95 % interval", *(interval(row["lower_percent"], row["upper_percent"]) for row in compared)])
    rows.append(["better on", *(f"{row['flights_better']} of {row['flights']}" for row in compared)])
    yield from table_lines(rows, right=range(1, len(names) + 1), indent=" ")
    if missing:
        yield f"Scored on no flight: {', '.join(missing)}."
    for row in _rows(found.flights):
        if not row["has_a_say"]:
            yield f"{row['flight']} has no say: {row['reason']}."
    yield "Below 0 % is better than what flies now."
