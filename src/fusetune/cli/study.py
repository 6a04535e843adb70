"""`fusetune study`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.cli.output.tables import table_lines
from fusetune.errors import UserError

if TYPE_CHECKING:
    from fusetune.design.parameter_sets import ParameterSet

HELP = "make the parameter sets of a study, or around what a log's vehicle flies, and print them"
EXAMPLES = (
    ("fusetune study config/studies/paper_table11.yaml --out sets", "its sets, as a table and as files"),
    ("fusetune study --around log.ulg --out sets", "steps up and down from what this vehicle flies"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Study, log, folder."""
    parser.add_argument("study", type=Path, nargs="?", metavar="STUDY.yaml")
    parser.add_argument(
        "--around",
        type=Path,
        metavar="LOG.ulg",
        help="what this flight exercises, up and down from its values; with a study of that kind, what it names",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="takes SET.params and sets.parquet")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Write the sets and print them as a table; always `DONE`."""
    from dataclasses import replace

    from fusetune.design.outputs import write_study
    from fusetune.design.study import Study, load_study
    from fusetune.design.tunable_parameters import USUALLY_VARIED

    if options.study is None and options.around is None:
        raise UserError("the command line", "names neither a study nor a log", "Name a study, or a log with --around")
    around_usual = Study("around_present", "around_present", (), around=USUALLY_VARIED)
    study = around_usual if options.study is None else load_study(options.study)
    if study.search:
        raise UserError(options.study, "it is a search, whose sets are found on flights", "Run fusetune search LOG…")
    if bool(study.around) != (options.around is not None):
        reason = f"the study is {'' if study.around else 'not '}around the values of a flight"
        remedy = "Name its log with --around" if study.around else "Leave --around out, or take a study that is"
        raise UserError(options.study, reason, remedy)
    left_out: dict[str, str] = {}
    if study.around:
        from fusetune.save.around_log import study_around_log

        found = study_around_log(options.around, study.around)
        study, left_out = replace(study, sets=found.sets), found.left_out
    write_study(study, options.out, options.out)
    if options.json:
        sets = {one.name: one.overrides for one in study.sets}
        print_document({"sets": sets, "left_out": left_out, "folder": options.out})
        return DONE
    print(*_table(study.sets), sep="\n")
    print(*(f"no {name}: {why}" for name, why in left_out.items()), sep="\n", end="\n" if left_out else "")
    return DONE


def _table(sets: Sequence[ParameterSet]) -> Iterator[str]:
    """A row per set and a column per parameter, `–` where a set leaves the log's value; one-parameter sets in short."""
    if all(len(one.overrides) == 1 for one in sets):
        rows = [["set", "parameter", "value"]]
        rows += [[one.name, name, f"{value:g}"] for one in sets for name, value in one.overrides.items()]
    else:
        names = list(dict.fromkeys(name for one in sets for name in one.overrides))
        rows = [["set", *names]]
        for one in sets:
            rows.append([one.name, *(f"{one.overrides[name]:g}" if name in one.overrides else "–" for name in names)])
    yield from table_lines(rows)
