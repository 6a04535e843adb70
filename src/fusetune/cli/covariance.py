"""`fusetune covariance`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document

if TYPE_CHECKING:
    from fusetune.design.covariance.evaluation import Evaluation

HELP = "tell how well a sensing system knows its states, and which better sensor pays most"
EXAMPLES = (
    ("fusetune covariance config/covariance/ekf2_survey.yaml --out design", "how well EKF2 would know its states"),
)

LEAST_PERCENT = 0.05
"""What takes less off is not told."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Design, folder."""
    parser.add_argument("design", type=Path, metavar="DESIGN.yaml")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="takes the tables and the figures")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Evaluate the design, write tables and figures, and print the answer; always `DONE`."""
    from fusetune.covariance_design import make_covariance_design

    evaluation, figures = make_covariance_design(options.design, options.out)
    files = ["covariance.csv", "pays_most.csv", "sweeps.csv", *(file.name for file in figures)]
    if options.json:
        states = {state: _state(evaluation, state) for state in evaluation.judged}
        print_document({"states": states, "notes": evaluation.notes, "folder": options.out, "files": files})
        return DONE
    print(*_answer(evaluation), sep="\n")
    print(f"{options.out}: {', '.join(files)}")
    return DONE


def _state(evaluation: Evaluation, state: str) -> dict[str, Any]:
    told = evaluation.base[state]
    pays = [
        {"sensor": one.name, "change_percent": 100.0 * one.change(evaluation.base, state)}
        for one in evaluation.pays_most(state)
    ]
    return {"before_correction": told.before, "at_present": told.now, "unit": told.unit, "pays_most": pays}


def _answer(evaluation: Evaluation) -> Iterator[str]:
    """For each judged state what it is known to, and what pays most of each sensor."""
    for state in evaluation.judged:
        told = evaluation.base[state]
        present = "" if told.now is None else f", {told.now:.4g} at present"
        unit = f" {told.unit}" if told.unit else ""
        yield f"{state}: {told.before:.4g}{unit} just before a correction{present}"
        for one in evaluation.pays_most(state):
            change = 100.0 * one.change(evaluation.base, state)
            if change > -LEAST_PERCENT:
                break
            yield f"  {change:+6.1f} %  {one.name}"
    yield from evaluation.notes
