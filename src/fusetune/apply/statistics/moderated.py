"""Mean differences over few flights, their spread steadied by that of the other candidates.

Five flights say little of how a difference varies from flight to flight: Student's quantile is 2.8 instead of 2. But
the other candidates, seen on the same flights, show how much differences vary here in proportion to their size. Each
variance is therefore drawn towards what the size of its own differences and that proportion, the median of the others,
let expect, as if that were known from `PRIOR_FLIGHTS` further flights.

References
----------
Smyth, "Linear models and empirical Bayes methods for assessing differential expression in microarray experiments",
Statistical Applications in Genetics and Molecular Biology 3(1), 2004 (the moderated t).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import stdtr, stdtrit

from fusetune.apply.statistics.rounding import EQUAL_WITHIN, without_rounding

Array = npt.NDArray[np.float64]

PRIOR_FLIGHTS = 4
"""Weight of the other candidates: with it the 95 % intervals of 5 to 12 flights hold the truth in 91 to 96 %
(docs/decision.md); with 8 in 89 to 95 %."""


@dataclass(frozen=True)
class Moderated:
    """Mean difference of one candidate to the present set over at least two flights, nat.

    Attributes
    ----------
    error : standard error of the mean; None where the flights do not differ
    freedom : degrees of freedom of its Student distribution
    """

    mean: float
    error: float | None
    freedom: float

    def interval(self, confidence: float) -> tuple[float, float] | None:
        """Two-sided interval of the mean; None where nothing shows its spread."""
        if self.error is None:
            return None
        reach = self.reach(confidence)
        return self.mean - reach, self.mean + reach

    def reach(self, confidence: float) -> float:
        """Half the width of the interval, 0 where nothing shows its spread."""
        return -float(stdtrit(self.freedom, 0.5 * (1.0 - confidence))) * (self.error or 0.0)

    @property
    def p_value(self) -> float | None:
        """Two-sided, against no difference; 1 where there is none beyond rounding, None where it is not known."""
        if abs(self.mean) <= EQUAL_WITHIN:
            return 1.0
        if self.error is None:
            return None
        return float(min(2.0 * stdtr(self.freedom, -abs(self.mean) / self.error), 1.0))


def moderated(differences: Array) -> list[Moderated]:
    """Mean differences of all candidates.

    Parameters
    ----------
    differences : (F, C) score of each candidate less that of the present set on each flight, F ≥ 2; twins of a
        candidate count once among the others
    """
    differences = without_rounding(differences)
    flights = len(differences)
    mean, variance = differences.mean(axis=0), differences.var(axis=0, ddof=1)
    size = np.square(differences).mean(axis=0)
    share = shares(variance, size)
    usual, others = _medians_of_others(share, size > 0.0, np.asarray(first_twins(differences)))
    weight = np.minimum(PRIOR_FLIGHTS, others)
    steady = steadied(variance, size, usual, weight, flights)
    error = np.sqrt(np.where(variance > EQUAL_WITHIN**2, steady, variance) / flights)
    return [
        Moderated(value, one if one > EQUAL_WITHIN else None, flights - 1 + freedom)
        for value, one, freedom in zip(mean.tolist(), error.tolist(), weight.astype(float).tolist(), strict=True)
    ]


def shares(variance: Array, size: Array) -> Array:
    """Shares that variances have in the mean squares, 1 where there is neither."""
    return np.minimum(np.divide(variance, size, out=np.ones_like(size), where=size > 0.0), 1.0)


def steadied(variance: Array, size: Array, usual: Array, weight: float | Array, flights: int) -> Array:
    """Variances between flights, drawn towards the usual share of the mean square as if by so many flights more."""
    return np.asarray((weight * usual * size + (flights - 1) * variance) / (weight + flights - 1))


def _medians_of_others(
    values: Array, counts: npt.NDArray[np.bool_], twin_of: npt.NDArray[np.int64]
) -> tuple[Array, npt.NDArray[np.int64]]:
    """(C,) median of the values of each candidate's others, 0 where it has none, and the number of these.

    Twins count once, and only candidates that differ from the present set at all.
    """
    rivals = np.unique(twin_of[counts[twin_of]])
    apart = rivals != twin_of[:, None]
    number = apart.sum(axis=1)
    if not rivals.size:
        return np.zeros(twin_of.size), number
    ordered = np.sort(np.where(apart, values[rivals], np.inf), axis=1)
    rows, last = np.arange(twin_of.size), np.maximum(number - 1, 0)
    median = 0.5 * (ordered[rows, last // 2] + ordered[rows, np.minimum(number // 2, last)])
    return np.where(number > 0, median, 0.0), number


def first_twins(differences: Array) -> Sequence[int]:
    """(C,) index of the first candidate that has the same differences on every flight."""
    _, first, group = np.unique(np.round(differences / EQUAL_WITHIN), axis=1, return_index=True, return_inverse=True)
    return np.asarray(first[np.ravel(group)]).tolist()
