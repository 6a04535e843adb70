"""The curve of `diagnosis/reliability.py`: `python -m benchmarks.diagnosis_study.reliability_fit FOLDER`.

The folder is that of a study of fresh flights (`--fresh`): levels were set with the others, on which unsure diagnoses
are right more often than they will be. How good the curve is, flights say that had no say in it: each fifth of the
numbers by the curve of the rest.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from fusetune.analyze.diagnosis.reliability import LARGEST, said_of

from .kinds import KINDS
from .tables import CONFIDENCES
from .verdicts import Verdict, kept_verdicts

Array = npt.NDArray[np.float64]
SHRINKAGE = 3.0
"""Weight of an offset of 0 and a slope of 1; of 1, 3, 10 and 30 that with the least loss on what was left out."""
FOLDS = 5
SUREST = 0.85
"""What is said beyond is told as the largest share, or nearly: it counts as so much."""


def main() -> None:
    """Print the curve, and what it says of diagnoses that it was not fitted to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of the study")
    said, right, fold = diagnoses(kept_verdicts(parser.parse_args().folder / "verdicts"))
    offset, slope = fitted_curve(said, right)
    print(f"offset {offset:.2f}, slope {slope:.2f}")
    told = cross_validated(said, right, fold)
    for least, most in pairwise(CONFIDENCES):
        own = (told >= least) & (told < most)
        if own.any():
            print(f"{own.sum()} diagnoses: told {told[own].mean():.1%}, right {right[own].mean():.1%}")


def diagnoses(verdicts: Iterable[Verdict]) -> tuple[Array, Array, npt.NDArray[np.int64]]:
    """What was said of each diagnosis before the curve, whether it was right, and the fold of its flight, (N,) each."""
    rows = [
        (min(said_of(one.confidence), SUREST), float(one.id in verdict.injected), verdict.number % FOLDS)
        for verdict in verdicts
        for one in verdict.named
        if one.id in KINDS
    ]
    said, right, fold = np.array(rows).T
    return said, right, fold.astype(np.int64)


def fitted_curve(said: Array, right: Array) -> tuple[float, float]:
    """Offset and slope of the logistic curve over the odds of what is said, with the least loss and shrinkage."""
    odds = np.log(said / (1.0 - said))

    def loss(curve: Array) -> float:
        share = np.clip(_share(odds, curve[0], curve[1]), 1e-9, 1.0 - 1e-9)
        missed = np.sum(right * np.log(share) + (1.0 - right) * np.log1p(-share))
        return float(0.5 * SHRINKAGE * (curve[0] ** 2 + (curve[1] - 1.0) ** 2) - missed)

    offset, slope = minimize(loss, np.array([0.0, 1.0]), method="Nelder-Mead").x
    return float(offset), float(slope)


def cross_validated(said: Array, right: Array, fold: npt.NDArray[np.int64]) -> Array:
    """Share that the curve of the other folds tells of each diagnosis, (N,)."""
    told: Array = np.empty(said.size)
    for one in np.unique(fold):
        own = fold == one
        curve = fitted_curve(said[~own], right[~own])
        told[own] = np.minimum(_share(np.log(said[own] / (1.0 - said[own])), *curve), LARGEST)
    return told


def _share(odds: Array, offset: float, slope: float) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-(offset + slope * odds))))


if __name__ == "__main__":
    main()
