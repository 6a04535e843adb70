"""A slowly wandering quantity under white noise: how much of each, and the quantity itself.

Interpolating noisy samples would hand the noise of one sample to all that are placed around it, and the estimator would
take them for independent witnesses. So the samples are smoothed first, by as much as they are noisy.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import minimize_scalar

MIN_SAMPLES = 24
LOG_DRIFT_RANGE = (-3.0, 4.0)
"""log10 of the random walk's variance per second over the variance of the noise, 1/s: the range searched.

The estimate of a small drift piles up at none at all, so there is a least one: at two samples a second it averages over
some twenty seconds on each side.
"""

GRID_STEPS = 8


def smoothed_random_walk(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Smooth each column of `value` (N, D), sampled at `time` (N,) µs, as a random walk under white noise.

    Kalman filter and Rauch-Tung-Striebel smoother; too few samples are returned as they are. Between two samples the
    estimate of a random walk is on the line between its estimates at the two.
    """
    if len(time) < MIN_SAMPLES:
        return value
    interval_s = np.diff(time) * 1e-6
    smooth = value.copy()
    for column in range(value.shape[1]):
        drift = relative_drift(interval_s, value[:, column])
        smooth[:, column] = _smoothed(value[:, column], drift * interval_s)
    return smooth


def relative_drift(interval_s: np.ndarray, value: np.ndarray) -> float:
    """Variance per second of the random walk over the variance of the white noise, 1/s, by maximum likelihood.

    The likelihood is that of the Kalman filter's innovations, the noise variance being the one that fits them best
    (Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 1989, section 3.4).
    """
    values = value.tolist()

    def cost(exponent: float) -> float:
        return _negative_log_likelihood(values, (10.0**exponent * interval_s).tolist())

    grid = np.linspace(*LOG_DRIFT_RANGE, GRID_STEPS)
    best = int(np.argmin([cost(exponent) for exponent in grid]))
    around = (grid[max(best - 1, 0)], grid[min(best + 1, GRID_STEPS - 1)])
    return float(10.0 ** minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": 0.05}).x)


def _negative_log_likelihood(value: list[float], step: list[float]) -> float:
    """Up to a constant; `step` are the variances that the walk gains between samples, in units of the noise's."""
    estimate, variance = value[0], 1.0
    squares, logarithms = 0.0, 0.0
    for sample, gained in zip(value[1:], step, strict=True):
        predicted = variance + gained
        expected = predicted + 1.0
        innovation = sample - estimate
        squares += innovation * innovation / expected
        logarithms += math.log(expected)
        variance = predicted / expected
        estimate += variance * innovation
    return 0.5 * (len(step) * math.log(max(squares, 1e-300)) + logarithms)


def _smoothed(value: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Mean of the walk given all samples; variances in units of the noise's."""
    estimate, variance = np.empty_like(value), np.empty(len(value))
    estimate[0], variance[0] = value[0], 1.0
    for k in range(1, len(value)):
        predicted = variance[k - 1] + step[k - 1]
        variance[k] = predicted / (predicted + 1.0)
        estimate[k] = estimate[k - 1] + variance[k] * (value[k] - estimate[k - 1])
    for k in range(len(value) - 2, -1, -1):
        gain = variance[k] / (variance[k] + step[k])
        estimate[k] += gain * (estimate[k + 1] - estimate[k])
    return estimate
