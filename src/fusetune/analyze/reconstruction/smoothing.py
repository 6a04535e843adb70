"""A slowly wandering quantity under white noise: how much of each, and the quantity itself.

Interpolating noisy samples would hand the noise of one sample to all that are placed around it, and the estimator would
take them for independent witnesses. So the samples are smoothed first, by as much as they are noisy.
"""

from __future__ import annotations

import numpy as np

MIN_SAMPLES = 24


def smoothed_random_walk(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Smooth each column of `value` (N, D), sampled at `time` (N,) µs, as a random walk under white noise.

    Kalman filter and Rauch-Tung-Striebel smoother; too few samples are returned as they are.
    """
    if len(time) < MIN_SAMPLES:
        return value
    smooth = value.copy()
    for column in range(value.shape[1]):
        noise, drift = noise_and_drift(time, value[:, column])
        if noise > 0.0:
            smooth[:, column] = _smoothed(value[:, column], np.diff(time) * 1e-6 * drift, noise)
    return smooth


def noise_and_drift(time: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    """Variance of the white noise, and variance per second of the random walk.

    A difference over a time t has the variance 2 noise + t drift; two differences, from one sample to the next and to
    the one after it, tell both. Longer ones would not: nothing wanders off for ever.
    """
    one, two = (float(np.mean((value[lag:] - value[:-lag]) ** 2)) for lag in (1, 2))
    interval_s = float(np.median(np.diff(time))) * 1e-6
    drift = max(two - one, 0.0) / interval_s
    return 0.5 * max(one - drift * interval_s, 0.0), drift


def _smoothed(value: np.ndarray, step: np.ndarray, noise: float) -> np.ndarray:
    estimate, variance = np.empty_like(value), np.empty(len(value))
    estimate[0], variance[0] = value[0], noise
    for k in range(1, len(value)):
        predicted = variance[k - 1] + step[k - 1]
        gain = predicted / (predicted + noise)
        estimate[k] = estimate[k - 1] + gain * (value[k] - estimate[k - 1])
        variance[k] = (1.0 - gain) * predicted
    for k in range(len(value) - 2, -1, -1):
        gain = variance[k] / (variance[k] + step[k])
        estimate[k] += gain * (estimate[k + 1] - estimate[k])
    return estimate
