"""Sets that no other one beats in two aims at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.trials import Trials

Array = npt.NDArray[np.float64]


def pareto_front(values: Array) -> npt.NDArray[np.bool_]:
    """(N,) whether no other point is at least as low in all columns of (N, A) and lower in one.

    Points with a NaN are on no front. Of equal points all are.
    """
    known = np.asarray(np.isfinite(values).all(axis=1))
    order = np.lexsort(values.T[::-1])
    front = np.zeros(len(values), dtype=bool)
    kept: list[int] = []
    for row in order[known[order]].tolist():
        others = values[kept]
        beaten = np.all(others <= values[row], axis=1) & np.any(others < values[row], axis=1)
        if not beaten.any():
            front[row] = True
            kept.append(row)
    return front


def two_aims(trials: Trials) -> tuple[Array, str]:
    """(N, 2) mean differences of each set to the present one, nat: accuracy with all sensors, and drift without GNSS.

    Accuracy is the mean over the flights of the predictions one step ahead or, on flights on which these have no
    weight, of the smoothed velocity.

    Returns
    -------
    The differences, NaN where a set has none, and which accuracy they are of: "aided", "smoothed" or "mixed"
    """
    aided, smoothed = trials.aims[AIDED], trials.aims[SMOOTHED]
    has_aided = np.isfinite(aided).any(axis=0)
    accuracy = np.where(has_aided, aided, smoothed)
    kind = AIDED if has_aided.all() else SMOOTHED if not has_aided.any() else "mixed"
    return np.column_stack([_means(accuracy), _means(trials.aims[UNAIDED])]), kind


def _means(differences: Array) -> Array:
    """Means over the flights on which any set has the figure; NaN for a set that lacks one of these."""
    told = np.isfinite(differences).any(axis=0)
    return differences[:, told].mean(axis=1) if told.any() else np.full(len(differences), np.nan)
