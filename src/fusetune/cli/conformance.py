"""`fusetune conformance`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from fusetune.cli.command import DONE, REFUSED

HELP = "tell which flights flew a mission: waypoints, order, distance from its legs"
EXAMPLES = (
    ("fusetune conformance config/missions/survey.yaml flights/*.ulg", "who flew the survey, and how well"),
    ("fusetune conformance survey.plan ~/logs --json", "for a script"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Missions, logs or folders of logs, and how to tell."""
    parser.add_argument("mission", type=Path, metavar="MISSION", help="file of the mission")
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG", help="log, or folder that is searched for logs")
    parser.add_argument("--json", action="store_true", help="print a JSON list with one object for each log")
    parser.epilog = "Exit status: 0 all is compared, whatever was flown; 1 a log cannot be read."


def run(options: argparse.Namespace) -> int:
    """Compare all, whatever becomes of one; tell each when it is done.

    Returns
    -------
    int
        `REFUSED` where a log cannot be read, else `DONE`
    """
    from fusetune.analyze.conformance.conformed_logs import conformed_logs
    from fusetune.analyze.conformance.words import log_lines
    from fusetune.design.missions.mission import load_mission

    status, before = DONE, "["
    for one in conformed_logs(options.logs, [load_mission(options.mission)]):
        if one.error is not None:
            status = REFUSED
        if options.json:
            error = None if one.error is None else {"reason": one.error.reason, "remedy": one.error.remedy}
            document = {"log": one.log, "error": error, **(one.found or {})}
            print(before, json.dumps(document, ensure_ascii=False, allow_nan=False), sep="\n", flush=True)
            before = ","
        else:
            print(*log_lines(one), sep="\n", flush=True)
    if options.json:
        print("]")
    return status
