"""`fusetune confirm`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE, REFUSED
from fusetune.cli.output.json_document import add_json, print_document

HELP = "tell whether PX4's own replay of a log saw what was predicted"
EXAMPLES = (
    (
        "fusetune confirm log.ulg replayed.ulg --asked results/apply/replay_params.txt",
        "did PX4 itself see what was predicted?",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The two logs, and what the replay was given."""
    parser.add_argument("original", type=Path, metavar="ORIGINAL.ulg")
    parser.add_argument("replayed", type=Path, metavar="REPLAYED.ulg")
    parser.add_argument(
        "--asked",
        type=Path,
        metavar="FILE",
        help="parameter file that the replay was given: replay_params.txt, or any .params or .parm",
    )
    add_json(parser)
    parser.epilog = (
        "Exit status: 0 as predicted; 1 not, or the replay ran with other parameters than asked; 2 no answer."
    )


def run(options: argparse.Namespace) -> int:
    """Compare and print; `DONE` where all is as asked and predicted, else `REFUSED`."""
    from fusetune.apply.replayed_log.comparison import compare_replayed
    from fusetune.apply.replayed_log.words import replayed_lines

    found = compare_replayed(options.original, options.replayed, options.asked)
    if options.json:
        print_document({"as_asked": found.is_as_asked, "as_predicted": found.agrees, "found": found})
    else:
        print(*replayed_lines(found), sep="\n")
    return DONE if found.is_as_asked and found.agrees else REFUSED
