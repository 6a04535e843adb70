"""`fusetune save`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE, REFUSED
from fusetune.cli.output.json_document import add_json, print_document

if TYPE_CHECKING:
    from fusetune.finding import Finding

HELP = "turn logs into folders of tables, each with a verdict"
EXAMPLES = (("fusetune save flights/*.ulg --out saved", "tables of each log, and whether it can be replayed"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Logs and the folder that takes theirs."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG.ulg")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="takes one folder per log")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Save all and tell the verdicts; `REFUSED` where one cannot be replayed."""
    from fusetune.save import save_log
    from fusetune.save.log_folder import demand_own_folders

    demand_own_folders(options.logs)
    verdicts = []
    for log in options.logs:
        verdict = save_log(log, options.out / log.stem)
        verdicts.append(verdict)
        if not options.json:
            print(f"{log.stem}: {verdict.status}", *map(_advice, verdict.failures), sep="\n  ")
    if options.json:
        print_document(
            [
                {
                    "log": log,
                    "flight": log.stem,
                    "verdict": verdict.status,
                    "failures": [{"found": one.found, "remedy": one.remedy} for one in verdict.failures],
                }
                for log, verdict in zip(options.logs, verdicts, strict=True)
            ]
        )
    return DONE if all(verdict.status == "replayable" for verdict in verdicts) else REFUSED


def _advice(finding: Finding) -> str:
    """What is wrong, and what to do about it."""
    return f"{finding.found}. {finding.remedy}."
