"""How a figure is spread over flights: quantiles, a histogram that one odd flight does not flatten, a robust scale."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MOST_BINS = 40
_REACH_IN_QUARTILES = 3.0
"""Tukey's outer fences: what lies this many interquartile ranges beyond the quartiles is counted, not binned."""

_QN_CONSTANT = 2.21914
_QN_SMALL = (1.0, 1.0, 0.399, 0.994, 0.512, 0.844, 0.611, 0.857, 0.669, 0.872)
"""Corrections of Qn for up to 9 values, by their number (Croux and Rousseeuw 1992)."""


@dataclass(frozen=True)
class Distribution:
    """Of one figure over `n` flights, in its unit; `standard_deviation` is None of one flight."""

    n: int
    mean: float
    standard_deviation: float | None
    minimum: float
    p05: float
    p25: float
    median: float
    p75: float
    p95: float
    maximum: float


@dataclass(frozen=True)
class Histogram:
    """Counts between edges; `below` and `above` lie beyond Tukey's outer fences."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]
    below: int
    above: int


def distribution(values: Array) -> Distribution | None:
    """Of the values that are numbers; None where there is none."""
    known = values[np.isfinite(values)]
    if not known.size:
        return None
    low, p05, p25, median, p75, p95, high = np.quantile(known, (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)).tolist()
    spread = float(known.std(ddof=1)) if known.size > 1 else None
    return Distribution(known.size, float(known.mean()), spread, low, p05, p25, median, p75, p95, high)


def histogram(values: Array) -> Histogram | None:
    """Bins of Freedman and Diaconis's width within Tukey's outer fences; None where there is no value.

    Where more than half of the values are one, which has no interquartile range, bins of Sturges's number cover all.

    References
    ----------
    Freedman and Diaconis, "On the histogram as a density estimator: L2 theory", Z. Wahrscheinlichkeitstheorie 57, 1981.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return None
    lower, upper = np.quantile(known, (0.25, 0.75))
    low, high = float(known.min()), float(known.max())
    between = float(upper - lower)
    if between > 0.0:
        low = max(low, float(lower) - _REACH_IN_QUARTILES * between)
        high = min(high, float(upper) + _REACH_IN_QUARTILES * between)
        bins = math.ceil((high - low) / (2.0 * between * known.size ** (-1.0 / 3.0)))
    else:
        bins = math.ceil(math.log2(known.size)) + 1 if high > low else 1
    counts, edges = np.histogram(known, min(max(bins, 1), MOST_BINS), (low, high))
    below, above = int(np.count_nonzero(known < low)), int(np.count_nonzero(known > high))
    return Histogram(tuple(edges.tolist()), tuple(counts.tolist()), below, above)


def robust_scale(values: Array) -> float:
    """Qn: the standard deviation of normal values, told by the quarter of their distances that is smallest.

    As efficient as 82 % of the values by the standard deviation, and up to half of them may be anything. 0 where so
    many are equal that none of the small distances differs from 0.

    References
    ----------
    Rousseeuw and Croux, "Alternatives to the median absolute deviation", J. American Statistical Association 88, 1993.
    """
    n = values.size
    if n < 2:
        return 0.0
    half = n // 2 + 1
    first, second = np.triu_indices(n, 1)
    distances = np.abs(values[first] - values[second])
    place = half * (half - 1) // 2 - 1
    correction = _QN_SMALL[n] if n < len(_QN_SMALL) else n / (n + (1.4 if n % 2 else 3.8))
    return float(_QN_CONSTANT * correction * np.partition(distances, place)[place])
