"""How far a source can be trusted as a witness: the white share of its error, from the data of the flight.

A filter that follows a wandering measurement predicts it better, and so looks better than it is. Only as far as the
error of a source is white does predicting it well mean knowing the state well.

The variogram γ(h) = ½ E[(y(t + h) − y(t))²] of `measurement_errors` is modelled as

    γ(h) = σ_w² + σ_c² (1 − exp(−h/τ)) + a h²

* σ_w², the white noise: what is left of γ towards lag 0 ("nugget"),
* σ_c², τ: errors correlated in time, a concave rise of γ,
* a: steady drift of the inertial solution, a convex rise that is not the measurement's fault.

With γ from the data at lags that grow geometrically, σ_w², σ_c², a ≥ 0 follow for each τ of a grid from non-negative
least squares, the residuals weighted by 1/(γ √h), as the scatter of an estimated variogram grows with both. τ is the
one with the smallest remainder. It is no shorter than two samples: what forgets faster is white to the filter.

    white share = σ_w² / (σ_w² + σ_c² (1 − exp(−H/τ)))

counts what is correlated up to the horizon H, for what changes more slowly is a constant to every parameter set alike,
and the drift of the inertial solution hides it.

A filter takes errors for white. What it should be told of a source that wanders is the white noise of the same density
at low frequency, σ_e (`Whiteness.equivalent_noise`).

References
----------
Matheron, "Principles of geostatistics", 1963 (variogram, nugget, sill); Cressie and Hawkins, "Robust estimation of the
variogram", 1980; Jazwinski, "Stochastic processes and filtering theory", 1970, ch. 8 (coloured noise).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.metrics.metric import SOURCE_UNIT, Metric
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.sensors.measurement_errors import COVERED, VELOCITY_SOURCES, ErrorSeries, measurement_errors
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]

VELOCITY_HORIZON_S = 3.0
"""Of velocities: beyond it the tilt error of the inertial solution outgrows their noise."""
HORIZON_S = 10.0
"""Of everything else: about the slowest time constant with which the filter follows a source."""
CORRELATION_TIMES_S = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
USUAL_INTERVAL_S = {"gnss": 0.2, "baro": 0.05, "mag": 0.05}
"""Between two samples that a vehicle's estimator takes, by sensor: a thinned log holds fewer."""
FEWEST_SAMPLES = 30
FEWEST_LAGS = 5
_LAGS = 20
_LONGEST_LAG_SHARE = 1.0 / 3.0
_SHORTEST_CORRELATION_SAMPLES = 2.0


@dataclass(frozen=True)
class Whiteness:
    """The error of one source and axis, split into a white and a correlated part.

    Attributes
    ----------
    white_noise : σ_w, unit of the source
    correlated_noise : square root of σ_c² (1 − exp(−H/τ)), unit of the source
    correlation_time_s : τ
    samples : number of measurements behind it
    interval_s : time between two of them
    """

    source: str
    axis: int
    white_noise: float
    correlated_noise: float
    correlation_time_s: float
    samples: int
    interval_s: float

    @property
    def equivalent_noise(self) -> float:
        """White noise σ_e of the same spectral density at low frequency, unit of the source.

        σ_e² = σ_w² + σ_c² max(1, 2 min(τ, H) / Δt), with the correlated noise as far as it is seen: a filter that takes
        errors for white averages those that wander as if they were as many. Δt is that of the vehicle where the log is
        thinned.
        """
        if self.correlated_noise == 0.0:
            return self.white_noise
        interval_s = min(self.interval_s, USUAL_INTERVAL_S.get(AID_SOURCES[self.source].sensor, self.interval_s))
        alike = 2.0 * min(self.correlation_time_s, horizon_s(self.source)) / interval_s
        return float(np.hypot(self.white_noise, self.correlated_noise * np.sqrt(max(1.0, alike))))

    @property
    def white_share(self) -> float:
        """Share of the white noise in the variance of the error, 0 … 1."""
        total = self.white_noise**2 + self.correlated_noise**2
        return self.white_noise**2 / total if total > 0.0 else float("nan")


def joint_white_share(members: Sequence[Whiteness]) -> float:
    """Share of the white noise in the summed variances of several axes."""
    white = sum(one.white_noise**2 for one in members)
    total = white + sum(one.correlated_noise**2 for one in members)
    return white / total if total > 0.0 else float("nan")


WHITE_SHARE: Metric[Whiteness] = Metric(
    "white_share", "1", "σ_w² / (σ_w² + σ_c² (1 − exp(−H/τ))); of a group, of the summed variances",
    lambda one: one.white_share, "", ("apply", "report"),
)  # fmt: skip

WHITENESS_METRICS: tuple[Metric[Whiteness], ...] = (
    WHITE_SHARE,
    Metric("white_noise", SOURCE_UNIT, "σ_w", lambda one: one.white_noise, used=("apply",)),
    Metric(
        "correlated_noise",
        SOURCE_UNIT,
        "square root of σ_c² (1 − exp(−H/τ))",
        lambda one: one.correlated_noise,
        used=("apply",),
    ),
    Metric("error_correlation_s", "s", "τ", lambda one: one.correlation_time_s, used=("apply",)),
    Metric(
        "equivalent_noise",
        SOURCE_UNIT,
        "√(σ_w² + σ_c² (1 − exp(−H/τ)) max(1, 2 min(τ, H) / Δt)), the white noise of "
        "the same density at low frequency, Δt between two samples",
        lambda one: one.equivalent_noise,
        used=("apply",),
    ),
)
"""Of the error of the source itself, by axis; they belong to the flight, not to the set."""


def horizon_s(source: str) -> float:
    """Horizon H up to which correlation counts, s."""
    return VELOCITY_HORIZON_S if source in VELOCITY_SOURCES else HORIZON_S


def source_whiteness(
    record: ReplayedSet, states: FilterStates, flight: Flight, intervals: Sequence[Interval]
) -> dict[tuple[str, int], Whiteness]:
    """Whiteness of every source that the set fuses, by source and axis.

    Parameters
    ----------
    record, states : replay of this flight
    flight : canonical, for GNSS positions in full resolution
    intervals : measurements inside them count, µs; no pair spans two of them
    """
    found = {}
    for source in COVERED:
        series = measurement_errors(record, states, flight, source)
        if series is None:
            continue
        for axis, one in enumerate(series_whiteness(source, series, intervals)):
            if one is not None:
                found[source, axis] = one
    return found


def series_whiteness(source: str, series: ErrorSeries, intervals: Sequence[Interval]) -> list[Whiteness | None]:
    """Whiteness of each axis of a series, None where there are too few samples."""
    interval = np.full(series.time.shape, -1)
    for number, (start, stop) in enumerate(intervals):
        interval[(series.time >= start) & (series.time < stop)] = number
    rows = interval >= 0
    time, values, interval = series.time[rows], series.values[rows], interval[rows]
    axes = range(series.values.shape[1])
    if time.size < FEWEST_SAMPLES:
        return [None for _ in axes]
    step_s = float(np.median(np.diff(time))) * 1e-6
    lags = variogram_lags(time.size, step_s, horizon_s(source))
    if lags.size < FEWEST_LAGS:
        return [None for _ in axes]
    gamma = variogram(time, values, interval, lags)
    results: list[Whiteness | None] = []
    for axis in axes:
        white, correlated, tau = fit_variogram(np.asarray(lags * step_s, dtype=np.float64), gamma[:, axis], step_s)
        seen = correlated * -np.expm1(-horizon_s(source) / tau)
        results.append(Whiteness(source, axis, float(np.sqrt(white)), float(np.sqrt(seen)), tau, time.size, step_s))
    return results


def variogram_lags(samples: int, step_s: float, longest_s: float) -> npt.NDArray[np.int64]:
    """Lags in samples, growing geometrically up to the horizon or a third of the samples."""
    longest = min(longest_s / step_s, samples * _LONGEST_LAG_SHARE)
    if longest < 1.0:
        return np.zeros(0, dtype=np.int64)
    return np.unique(np.rint(np.geomspace(1.0, longest, _LAGS)).astype(np.int64))


def variogram(
    time: npt.NDArray[np.int64],
    values: Array,
    interval: npt.NDArray[np.int64],
    lags: npt.NDArray[np.int64],
) -> Array:
    """Robust variogram: fourth power of the mean root of |differences|, made unbiased for normal ones.

    Parameters
    ----------
    time : (N,) µs; pairs that lie further apart than their lag (lost samples) do not count
    values : (N, D)
    interval : (N,) number of the scored interval; no pair spans two
    lags : (L,) in samples

    Returns
    -------
    (L, D) array, NaN where a lag has no pairs
    """
    step = float(np.median(np.diff(time)))
    result = np.full((lags.size, values.shape[1]), np.nan)
    for row, lag in enumerate(lags):
        apart = time[lag:] - time[:-lag]
        near = (np.abs(apart - lag * step) < 0.5 * step * np.sqrt(lag)) & (interval[lag:] == interval[:-lag])
        if near.any():
            root = np.sqrt(np.abs(values[lag:][near] - values[:-lag][near]))
            # Half of the squared difference, hence the factor ½.
            result[row] = 0.5 * np.mean(root, axis=0) ** 4 / (0.457 + 0.494 / np.count_nonzero(near))
    return result


def fit_variogram(lag_s: Array, gamma: Array, step_s: float) -> tuple[float, float, float]:
    """White variance σ_w², correlated variance σ_c² and its time τ, s, of an estimated variogram.

    Parameters
    ----------
    lag_s, gamma : (L,) lags, s, and values; NaN and 0 do not count
    step_s : spacing of the samples
    """
    usable = np.isfinite(gamma) & (gamma > 0.0)
    if np.count_nonzero(usable) < FEWEST_LAGS:
        return float("nan"), float("nan"), float("nan")
    lag_s, gamma = lag_s[usable], gamma[usable]
    weight = 1.0 / (gamma * np.sqrt(lag_s))
    # Columns of unit size, or the solver's tolerance would decide.
    size, longest = float(gamma.mean()), float(lag_s[-1])
    best = (np.inf, 0.0, 0.0, CORRELATION_TIMES_S[-1])
    for tau in CORRELATION_TIMES_S:
        if tau < _SHORTEST_CORRELATION_SAMPLES * step_s:
            continue
        columns = np.column_stack([np.ones_like(lag_s), -np.expm1(-lag_s / tau), np.square(lag_s / longest)])
        solution, remainder = nnls(size * columns * weight[:, None], gamma * weight)
        if remainder < best[0]:
            best = (remainder, size * solution[0], size * solution[1], tau)
    return float(best[1]), float(best[2]), float(best[3])
