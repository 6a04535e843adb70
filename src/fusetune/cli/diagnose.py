"""`fusetune diagnose`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE, FOUND_FAILURE, USER_ERROR
from fusetune.cli.output.numbers import from_zero

if TYPE_CHECKING:
    from fusetune.analyze.diagnosis.diagnosed_logs import DiagnosedLog

HELP = "tell what is wrong with a vehicle from its logs, since when, how sure, and what to do"
EXAMPLES = (
    ("fusetune diagnose flights/*.ulg", "what is wrong, and what to do about it"),
    ("fusetune diagnose ~/sdcard/log --json > findings.json", "for a script"),
)
WARNS = 1
"""Exit status where there is no worse than a warning; of a log that tells nothing it is `USER_ERROR`, between the
two."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Logs or folders of logs, and how to tell."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG", help="log, or folder that is searched for logs")
    parser.add_argument("--json", action="store_true", help="print a JSON list with one object for each log")
    parser.add_argument(
        "--experiments",
        type=from_zero,
        default=2,
        metavar="N",
        help="replay a flight at most N times with a claimed cause taken away (2)",
    )
    parser.epilog = (
        "Exit status, of several logs the largest: 0 nothing, or notes alone; 1 a warning; 2 a log that cannot be "
        "read, or that cannot be replayed and shows no more than notes; 3 a failure. A test ratio compares how far a "
        "measurement lies from what the filter expected with how far it may: above 1 the filter rejects it."
    )


def run(options: argparse.Namespace) -> int:
    """Diagnose all, whatever becomes of one; tell each when it is done.

    Returns
    -------
    int
        `FOUND_FAILURE`, `USER_ERROR`, `WARNS` or `DONE`: of the logs the largest
    """
    from fusetune.analyze.diagnosis.diagnosed_logs import diagnosed_logs
    from fusetune.analyze.diagnosis.words import log_lines
    from fusetune.cli.lines import Lines

    status, before, lines = DONE, "[", Lines()
    for one in diagnosed_logs(options.logs, options.experiments):
        status = max(status, _status(one))
        if options.json:
            print(before, json.dumps(one.document(), ensure_ascii=False, allow_nan=False), sep="\n", flush=True)
            before = ","
        else:
            for line in log_lines(one):
                lines.tell_below(line)
    if options.json:
        print("]")
    return status


def _status(one: DiagnosedLog) -> int:
    if one.error is not None:
        return USER_ERROR
    severities = {found.severity for found in one.found}
    if "fail" in severities:
        return FOUND_FAILURE
    if "warning" in severities:
        return WARNS
    # what was hardly looked at is not said to be sound
    return USER_ERROR if one.not_replayed else DONE
