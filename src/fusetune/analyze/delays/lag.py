"""The lag of a measured series behind the motion that it measures, with an interval.

With the motion w(t) of the IMU and a measurement z_k stamped t_k,

    z_k = w(t_k − D) + drift(t_k) + e_k

where D is the delay, and the drift of the inertial solution is smooth. D follows from generalised least squares:

* the series and the motion are differenced, once for a velocity, twice for a position, which leaves of the drift what
  is of the kind of an error correlated in time;
* an autoregressive model of the residuals, fitted to themselves, makes them white, and the regressors with them
  (Cochrane and Orcutt, 1949); so errors of the sensor that wander cost certainty, and do not pass for delay;
* the regressors are the rate of the motion at t_k − D, whose factor is the change of D, and what can be wrong with the
  motion itself: its scale and, of vectors, its heading. Residuals beyond what is usual weigh less (Huber, 1964);
* the motion is looked up at the new D, and all is done again until D stands. At its end nothing is linearised.

The interval is that of the jackknife over blocks of some seconds (Tukey, 1958), or what the residuals promise, where
that is wider.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from fusetune.analyze.metrics.whitened_regression import Fit, Rows, generalised, order_of, runs

Array = npt.NDArray[np.float64]

LARGEST_CHANGE_S = 0.3
"""Further from what it is told no delay is looked for."""
FASTEST_HZ = 20.0
"""Of a faster series not every sample is taken: motion of vehicles is slower."""
_ROUNDS = 15
_STANDS_S = 2e-4
_GREATEST_STEP_S = 0.1
_RATE_OVER_S = 0.04
_PROBE_S = 0.015
_LEAST_SLOPE = 0.25


@dataclass(frozen=True)
class LaggedSeries:
    """What a sensor measured, and the motion that it measures.

    Attributes
    ----------
    time : (N,) stamps of the messages less no delay, µs, ascending
    measured : (N, D)
    motion_time : (M,) µs, ascending
    motion : (M, D) in the unit of the measurement, up to a drift
    differences : how often the series is differenced: 1 for a velocity, 2 for a position
    turns : whether the first two columns are a vector whose heading may be wrong
    arms : (M, D, 3) what a metre of lever arm along each axis of the body adds to the motion; of none if None
    """

    time: npt.NDArray[np.int64]
    measured: Array
    motion_time: npt.NDArray[np.int64]
    motion: Array
    differences: int = 1
    turns: bool = False
    arms: Array | None = None

    def rows(self, selected: npt.NDArray[np.bool_]) -> LaggedSeries:
        """The same with some of the messages, (N,) bool."""
        return replace(self, time=self.time[selected], measured=self.measured[selected])


@dataclass(frozen=True)
class Lag:
    """D and its standard error, s, and the degrees of freedom behind that."""

    delay_s: float
    standard_error_s: float
    freedom: int
    samples: int

    def half_width_s(self, confidence: float) -> float:
        """Half of the interval of the delay, s."""
        return float(stdtrit(self.freedom, 0.5 + 0.5 * confidence)) * self.standard_error_s


def lag_of(series: LaggedSeries, told_s: float) -> Lag | None:
    """Delay of a series; None where there is too little of it, or where no delay near the told one fits."""
    regression = _Regression(series)
    delay_s = told_s
    for _ in range(_ROUNDS):
        fit = regression.at(delay_s)
        if fit is None:
            return None
        change = float(np.clip(fit.solution[0], -_GREATEST_STEP_S, _GREATEST_STEP_S))
        delay_s += change
        if abs(delay_s - told_s) > LARGEST_CHANGE_S:
            return None
        if abs(change) < _STANDS_S:
            break
    else:
        return None
    errors = fit.standard_errors()
    around = [regression.at(delay_s + side) for side in (-_PROBE_S, _PROBE_S)]
    if errors is None or around[0] is None or around[1] is None:
        return None
    # Noise in the rate makes each step too short, and the regression too sure of it, by the same factor.
    slope = float(around[0].solution[0] - around[1].solution[0]) / (2.0 * _PROBE_S)
    if slope < _LEAST_SLOPE:
        return None
    standard_errors, blocks = errors
    return Lag(delay_s, float(standard_errors[0]) / min(slope, 1.0), blocks - 1, fit.residual.size)


class _Regression:
    """The regression at any delay."""

    def __init__(self, series: LaggedSeries) -> None:
        step_s = float(np.median(np.diff(series.time))) * 1e-6 if series.time.size > 1 else 1.0
        every = max(1, int(1.0 / (FASTEST_HZ * step_s) + 0.5)) if step_s > 0.0 else 1
        self._series = series = replace(series, time=series.time[::every], measured=series.measured[::every])
        step_s *= every
        self._runs = list(runs(series.time))
        self._order = order_of(step_s)
        self._half_s = min(0.5 * step_s, _RATE_OVER_S)
        self._seconds = series.motion_time * 1e-6

    def at(self, delay_s: float) -> Fit | None:
        """The best change of a delay; None where there are too few samples."""
        series = self._series
        at: Array = np.asarray(series.time * 1e-6 - delay_s, np.float64)
        inside = (at - self._half_s >= self._seconds[0]) & (at + self._half_s <= self._seconds[-1])
        left, design = series.measured - self._looked_up(at, series.motion), self._design(at)
        rows = []
        for run in self._runs:
            used = inside[run]
            if np.count_nonzero(used) > 2 * self._order + 2 + series.differences:
                one, other = (np.diff(part[run][used], series.differences, axis=0) for part in (left, design))
                rows.append(Rows(one, other, at[run][used][series.differences :]))
        return generalised(rows, self._order) if rows else None

    def _looked_up(self, when: Array, values: Array) -> Array:
        flat = values.reshape(values.shape[0], -1)
        found = np.column_stack([np.interp(when, self._seconds, column) for column in flat.T])
        return found.reshape(when.size, *values.shape[1:])

    def _design(self, at: Array) -> Array:
        """(N, D, P) regressors: rate, scale, heading, lever arm."""
        series, half = self._series, self._half_s
        motion = self._looked_up(at, series.motion)
        # a delay longer by d would give w(t − D − d), which is d times the rate less
        rate = self._looked_up(at + half, series.motion) - self._looked_up(at - half, series.motion)
        columns = [-rate / (2.0 * half), motion]
        if series.turns:
            across = np.zeros_like(motion)
            across[:, 0], across[:, 1] = -motion[:, 1], motion[:, 0]
            columns.append(across)
        design = np.stack(columns, axis=2)
        return design if series.arms is None else np.concatenate([design, self._looked_up(at, series.arms)], axis=2)
