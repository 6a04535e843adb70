"""Means over flights of what the surfaces say, and how sure they are: what flights differ by, and what no set tells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from fusetune.apply.sensitivity.surface import compressed
from fusetune.apply.statistics.moderated import moderated
from fusetune.apply.trials import Trials

Array = npt.NDArray[np.float64]

_MOST_COMPARED = 24


@dataclass(frozen=True, eq=False)
class Spread:
    """Means of M differences over the flights, nat.

    Attributes
    ----------
    mean : (M,)
    error : (M,) standard error; NaN where nothing shows it
    reach : (M,) half the width of the interval; NaN where nothing shows it
    """

    mean: Array
    error: Array
    reach: Array

    @property
    def lower(self) -> Array:
        """(M,) lower end of the interval."""
        return self.mean - self.reach

    @property
    def upper(self) -> Array:
        """(M,) upper end of the interval."""
        return self.mean + self.reach


def spread_of(differences: Array, uncertainty: Array, compared: Array, confidence: float) -> Spread:
    """Mean over flights with its interval: Student's, steadied by the sets that were tried (`moderated`), and wider by
    what the surface does not know.

    Parameters
    ----------
    differences : (M, F)
    uncertainty : (M,) standard deviation of the surface's mean
    compared : (F, K) differences of sets that were tried on all flights
    """
    mean = differences.mean(axis=1)
    if differences.shape[1] < 2:
        unknown = np.full(len(mean), np.nan)
        return Spread(mean, unknown, unknown)
    found = [moderated(np.column_stack([one, compared]))[0] for one in differences]
    error = np.hypot([one.error or 0.0 for one in found], uncertainty)
    reach = np.hypot([one.reach(confidence) for one in found], ndtri(0.5 * (1.0 + confidence)) * uncertainty)
    return Spread(mean, error, reach)


def compared_sets(trials: Trials) -> Array:
    """(F, K) differences of at most some two dozen sets that were tried on all flights, evenly among these."""
    complete = compressed(trials.differences[np.isfinite(trials.differences).all(axis=1)])
    if len(complete) > _MOST_COMPARED:
        complete = complete[np.linspace(0, len(complete) - 1, _MOST_COMPARED).round().astype(int)]
    return np.asarray(complete.T)
