"""How the samples of a sensor are distributed about what it measures: outliers, normality, steps, standstill.

What is measured moves, so each sample is held against the median of its four neighbours, two on either side: a steady
change cancels, and one wrong sample does not spoil the others. At rest and in flight the same figure is thus of the
same thing, the noise from sample to sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.sensor_noise.sensor_series import SensorSeries

Array = npt.NDArray[np.float64]

_VARIANCE_WITH_NEIGHBOURS = 1.0 + 0.29824
"""Of a sample less the median of four others, all normal with variance 1: that median is the mean of the second and
the third of four, whose variances and covariance are 0.3605, 0.3605 and 0.2359 (Godwin, *Ann. Math. Stat.* 20, 1949).
"""
_SIGMA_PER_MAD = 1.482602
OUTLIER = 5.0
"""Robust z beyond which a sample is an outlier: of normal samples one in 1.7 million is."""
BEYOND_3_SIGMA = 0.0026998
"""Share of a normal distribution."""
HISTOGRAM_EDGES: Array = np.linspace(-6.0, 6.0, 49)
"""Bins of the histogram, in robust standard deviations; what lies beyond is counted with the outermost."""
QUANTILES = (0.0, 0.02, 0.25, 0.5, 0.75, 0.98, 1.0)
FEWEST_SAMPLES = 30
_FEW_VALUES = 0.25
"""So few distinct values for the number of samples mean that the sensor's steps show."""


@dataclass(frozen=True)
class Distribution:
    """One axis at rest or in flight.

    Attributes
    ----------
    samples : behind it
    spread : robust standard deviation from sample to sample, unit of the sensor
    outliers : samples beyond 5 of those
    beyond_3_sigma : share of the samples beyond 3; 0.0027 of a normal distribution
    kurtosis : excess kurtosis of those that are no outliers; 0 of a normal distribution
    step : size of the sensor's steps where they show, unit of the sensor; 0 where they do not
    repeated : share of samples that are the same as the one before
    histogram : counts in `HISTOGRAM_EDGES`
    quantiles : of the deviations from the neighbours at `QUANTILES`, unit of the sensor
    """

    samples: int
    spread: float
    outliers: int
    beyond_3_sigma: float
    kurtosis: float
    step: float
    repeated: float
    histogram: tuple[int, ...]
    quantiles: tuple[float, ...]

    @property
    def tail_factor(self) -> float:
        """How many times more samples lie beyond three standard deviations than of a normal distribution."""
        return self.beyond_3_sigma / BEYOND_3_SIGMA

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in vars(self).items()}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Distribution:
        """Read what `document` made."""
        arguments: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in document.items()
        }
        return cls(**arguments)


def deviations(values: Array) -> Array:
    """Each sample less the median of its four neighbours, (N, axes), scaled so that white noise keeps its size.

    The first two and the last two have fewer neighbours and are NaN.
    """
    found = np.full(values.shape, np.nan)
    if len(values) < 5:
        return found
    first, second, third, fourth = values[:-4], values[1:-3], values[3:-1], values[4:]
    low = np.maximum(np.minimum(first, second), np.minimum(third, fourth))
    high = np.minimum(np.maximum(first, second), np.maximum(third, fourth))
    # the two that are neither smallest nor largest of four; their order does not matter for the mean
    found[2:-2] = (values[2:-2] - 0.5 * (low + high)) / np.sqrt(_VARIANCE_WITH_NEIGHBOURS)
    return found


def outlying(deviation: Array) -> npt.NDArray[np.bool_]:
    """Which samples (N, axes) are outliers of their axis; NaN are none."""
    known = np.isfinite(deviation).all(axis=1)
    found = np.zeros(deviation.shape, np.bool_)
    if known.any():
        inner = deviation[known]
        found[known] = np.abs(standardised(inner)) > OUTLIER
    return found


def standardised(deviation: Array) -> Array:
    """Robust z of each deviation (N, axes), none NaN: from the median of its axis, in robust standard deviations."""
    return _standardised(deviation, _spread(deviation))


def _standardised(deviation: Array, spread: npt.ArrayLike) -> Array:
    return np.asarray((deviation - np.median(deviation, axis=0)) / np.where(np.greater(spread, 0.0), spread, np.inf))


def distributions(series: SensorSeries, intervals: Sequence[Interval]) -> tuple[Distribution, ...]:
    """The distribution of each axis inside the intervals, µs; empty where there are fewer than thirty samples."""
    pieces = series.pieces(intervals, 5.0 * series.step_s)
    if sum(len(one) for one in pieces) < FEWEST_SAMPLES:
        return ()
    values = np.concatenate(pieces)
    deviation = np.concatenate([deviations(one)[2:-2] for one in pieces])
    same = np.concatenate([np.diff(one, axis=0) == 0.0 for one in pieces])
    return tuple(_distribution(deviation[:, i], values[:, i], same[:, i]) for i in range(values.shape[1]))


def _distribution(deviation: Array, values: Array, same: npt.NDArray[np.bool_]) -> Distribution:
    # medians, quantiles and counts are quicker of what is in order, and nothing here asks when a sample was
    deviation = np.sort(deviation)
    spread = float(_spread(deviation))
    z = _standardised(deviation, spread)
    inner = z[np.abs(z) <= OUTLIER]
    squares = np.square(inner)
    variance = float(np.mean(squares))
    # a bin holds its lower edge, the last one both
    beyond = np.searchsorted(z, HISTOGRAM_EDGES[1:-1])
    counts = np.diff(beyond, prepend=0, append=len(z))
    return Distribution(
        samples=len(deviation),
        spread=spread,
        outliers=len(z) - len(inner),
        beyond_3_sigma=float(np.mean(np.abs(z) > 3.0)),
        kurtosis=float(np.mean(np.square(squares))) / variance**2 - 3.0 if variance > 0.0 else 0.0,
        step=_step(values),
        repeated=float(same.mean()) if len(same) else 0.0,
        histogram=tuple(counts.tolist()),
        quantiles=tuple(np.quantile(deviation, QUANTILES).tolist()),
    )


def _spread(deviation: Array) -> Array:
    """Robust standard deviation along the first axis; the plain one where more than half of the samples agree."""
    centre = np.median(deviation, axis=0)
    robust = _SIGMA_PER_MAD * np.median(np.abs(deviation - centre), axis=0)
    return np.asarray(np.where(robust > 0.0, robust, np.std(deviation, axis=0)))


def _step(values: Array) -> float:
    distinct = np.unique(values)
    if len(distinct) < 2 or len(distinct) > _FEW_VALUES * len(values):
        return 0.0
    return float(np.median(np.diff(distinct)))
