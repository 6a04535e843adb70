"""The earth's field and the field that turns with the vehicle, told apart from noisy magnetometer samples.

Interpolating noisy samples would hand the noise of one sample to all that are placed around it, and the estimator would
take them for independent witnesses. So the field is smoothed first, by as much as the samples are noisy: the earth's
field as a random walk in the frame of the attitudes, the body's as a constant, both under white noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fusetune.analyze.reconstruction.attitude import to_body, to_earth
from fusetune.save.checks.magnetometer_mounting import stillest_mounting
from fusetune.save.thresholds import VerdictThresholds

MIN_SAMPLES = 24
LOG_DRIFT_RANGE = (-5.0, 4.0)
"""log10 of the random walk's variance per second over the variance of the noise, 1/s: the range searched."""

GRID_STEPS = 10
BODY_FIELD_GAUSS = 0.05
"""Standard deviation, before any sample is seen, of what a calibration leaves of the field that turns with the vehicle.

Where the vehicle hardly turned, the two fields cannot be told apart and the body's is taken to be none.
"""


@dataclass(frozen=True)
class MagneticField:
    """The field without noise.

    Attributes
    ----------
    earth : (N, 3) Gauss, at the times of the samples, in the frame of the attitudes
    body : (3,) Gauss, what turns with the vehicle
    mounting : (3, 3) rotation from the axes in which the field turns as the vehicle does to those of the samples
    """

    earth: np.ndarray
    body: np.ndarray
    mounting: np.ndarray

    def seen(self, earth: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Samples (M, 3) of a field (M, 3) in the frame of the attitudes (M, 4)."""
        return (to_body(q, earth) + self.body) @ self.mounting.T


def magnetic_field(time: np.ndarray, q: np.ndarray, measured: np.ndarray) -> MagneticField:
    """Tell the two fields apart and smooth the earth's.

    The state-space model m = R(q)ᵀ e + b + noise with a random walk e, in the frame of e. The walk's gains do not
    depend on the values, so one Kalman filter runs over the samples and over what each axis of b would add to them, and
    b is the generalised least squares fit of its innovations (de Jong, The diffuse Kalman filter, Annals of Statistics,
    1991). How much the walk gains per second is the most likely value given the noise that then fits best (Harvey,
    Forecasting, Structural Time Series Models and the Kalman Filter, 1989, section 3.4).

    Parameters
    ----------
    time : (N,) µs, ascending
    q : (N, 4) attitudes
    measured : (N, 3) body field, Gauss

    Returns
    -------
    MagneticField
        Of too few samples, as measured.
    """
    # Imported here: it takes a fifth of a second to load, and few logs need it.
    from scipy.optimize import minimize_scalar

    if len(time) < MIN_SAMPLES:
        return MagneticField(to_earth(q, measured), np.zeros(3), np.eye(3))
    mounting, left = stillest_mounting(q, measured)
    mounting = mounting if left <= VerdictThresholds.max_field_scatter_left else np.eye(3)
    measured = measured @ mounting
    # (N, 3, 4): the samples in the frame of e, and the axes of b there
    series = np.stack([to_earth(q, measured), *(to_earth(q, np.tile(axis, (len(q), 1))) for axis in np.eye(3))], -1)
    interval_s = np.diff(time) * 1e-6
    stiffness = _noise_variance(series[..., 0]) / BODY_FIELD_GAUSS**2

    def cost(exponent: float) -> float:
        return _fit(series, 10.0**exponent * interval_s, stiffness)[0]

    grid = np.linspace(*LOG_DRIFT_RANGE, GRID_STEPS)
    best = int(np.argmin([cost(exponent) for exponent in grid]))
    around = (grid[max(best - 1, 0)], grid[min(best + 1, GRID_STEPS - 1)])
    exponent = minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": 0.05}).x
    step = 10.0**exponent * interval_s
    body = _fit(series, step, stiffness)[1]
    return MagneticField(_smoothed(series[..., 0] - series[..., 1:] @ body, step), body, mounting)


def _noise_variance(earth: np.ndarray) -> float:
    """Of the samples, by their second differences, which a slow field hardly enters."""
    return max(float(np.median(np.diff(earth, 2, axis=0) ** 2)) / (6.0 * 0.4549), 1e-12)


def _fit(series: np.ndarray, step: np.ndarray, stiffness: float) -> tuple[float, np.ndarray]:
    """Negative log likelihood up to a constant, and the body's field (3,).

    `step` (N-1,) are the variances that the walk gains between samples, `stiffness` the prior's precision of the body's
    field, both in units of the noise's variance.
    """
    *_, innovation, expected = _filtered(series, step)
    scaled = innovation / np.sqrt(expected)[:, None, None]
    design, target = scaled[..., 1:].reshape(-1, 3), scaled[..., 0].reshape(-1)
    information = design.T @ design + stiffness * np.eye(3)
    body = np.linalg.solve(information, design.T @ target)
    squares = float(target @ target - body @ information @ body)
    logarithms = 3.0 * float(np.log(expected).sum()) + float(np.linalg.slogdet(information)[1])
    return 0.5 * (len(target) * math.log(max(squares, 1e-300)) + logarithms), body


class _Filtered(NamedTuple):
    """A random walk of known steps under noise of variance 1, by the Kalman filter.

    `estimate` (N, …) and its `variance` (N,) after each sample; `innovation` (N-1, …) of each sample but the first and
    its `expected` variance (N-1,).
    """

    estimate: np.ndarray
    variance: np.ndarray
    innovation: np.ndarray
    expected: np.ndarray


def _filtered(value: np.ndarray, step: np.ndarray) -> _Filtered:
    result = _Filtered(np.empty_like(value), np.empty(len(value)), np.empty_like(value[1:]), np.empty(len(step)))
    result.estimate[0], result.variance[0] = value[0], 1.0
    estimate, variance = value[0], 1.0
    for k, gained in enumerate(step.tolist()):
        predicted = variance + gained
        result.expected[k] = predicted + 1.0
        result.innovation[k] = value[k + 1] - estimate
        result.variance[k + 1] = variance = predicted / (predicted + 1.0)
        result.estimate[k + 1] = estimate = estimate + variance * result.innovation[k]
    return result


def _smoothed(value: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Mean of the walk given all samples (Rauch, Tung and Striebel)."""
    estimate, variance, *_ = _filtered(value, step)
    for k in range(len(value) - 2, -1, -1):
        gain = variance[k] / (variance[k] + step[k])
        estimate[k] += gain * (estimate[k + 1] - estimate[k])
    return estimate
