"""`fusetune cards`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE

HELP = "write flight cards: which parameter set to fly when, to print"
EXAMPLES = (
    (
        "fusetune cards config/studies/paper_table11.yaml --flights 12 --out cards.html",
        "twelve flights, two of each set",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Study or parameter files, number of flights, seed, file."""
    parser.add_argument("sets", type=Path, nargs="+", metavar="STUDY_OR_PARAMS", help="a study, or .params files")
    parser.add_argument("--flights", type=int, required=True, metavar="N", help="made up to whole blocks of all sets")
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.html")


def run(options: argparse.Namespace) -> int:
    """Write them; always `DONE`."""
    from fusetune.design.flight_cards import plan_cards, write_cards

    cards = plan_cards(options.sets, options.flights, options.seed)
    write_cards(cards, options.out)
    print(f"{options.out}: {cards.flights} flights in blocks of {len(cards.sets)}")
    return DONE
