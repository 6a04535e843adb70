"""`fusetune design`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE

HELP = "write a mission plan and the parameter files of a study"
EXAMPLES = (
    (
        "fusetune design --mission config/missions/survey.yaml --study config/studies/paper_table11.yaml --out design",
        "plan and parameter files",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Mission, study, folder."""
    parser.add_argument("--mission", type=Path, required=True, metavar="MISSION")
    parser.add_argument("--study", type=Path, required=True, metavar="STUDY.yaml")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")


def run(options: argparse.Namespace) -> int:
    """Write them; always `DONE`."""
    from fusetune.design.outputs import write_design

    write_design(options.mission, options.study, options.out)
    return DONE
