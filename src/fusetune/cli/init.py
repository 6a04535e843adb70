"""`fusetune init`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document

HELP = "make a folder for the pipeline: settings, a place for logs, a README"
EXAMPLES = (("fusetune init tuning && cd tuning", "then copy logs into flights/ and `fusetune run`"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The folder."""
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="made where it does not exist; nothing is written over"
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Make it; always `DONE`."""
    from fusetune.running.project_folder import CONFIG, FLIGHTS, README, make_project_folder

    folder = make_project_folder(options.folder)
    if options.json:
        print_document({"folder": folder, "made": [CONFIG, FLIGHTS, README]})
        return DONE
    print(f"{folder}: config/ with all settings, flights/ for logs, README.md")
    print(f"Next: put logs into {folder / FLIGHTS}, then: cd {folder} && fusetune run")
    return DONE
