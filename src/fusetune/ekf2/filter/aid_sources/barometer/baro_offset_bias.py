"""What the barometer of v1.13 drifts by, held against the height of GNSS: a scalar Kalman filter that watches itself.

Innovations beyond 3 σ are not fused; where they stay on one side, the drift is taken to be larger.

Mirrors PX4 v1.13 `EKF/baro_bias_estimator.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.numerics.constants import FLT_EPSILON

BARO_OFFSET_BIAS = np.dtype(fields("f8", "bias", "variance", "interval", "ratio_lpf", "ratio_gain"), align=True)
"""Bias (m) and its variance, the interval (s) between samples, the low-passed test ratio with the sign of the
innovation, and the gain of that low-pass."""

FIRST_VARIANCE = 0.1
FIRST_INTERVAL_S = 0.01
DRIFT_RATE = 0.005
"""Metres per second."""

LEAST_VARIANCE = 1e-8
LARGEST_BIAS = 100.0
GATE = 3.0
RATIO_TIME_S = 10.0
LARGE_RATIO = 0.2
BOOST = 1e3
CHANGED_INTERVAL_S = 0.001


@kernel
def initialise_baro_bias(bias):
    """What is not zero at start."""
    bias.variance = FIRST_VARIANCE
    bias.interval = FIRST_INTERVAL_S


@kernel
def _limit_variance(bias, noise):
    bias.variance = min(max(bias.variance, LEAST_VARIANCE), noise * noise)


@kernel
def predict_baro_bias(bias, interval, noise):
    """Let the bias be less certain after an interval (s); it is never less so than a sample of this noise (m)."""
    bias.variance += (DRIFT_RATE * interval) ** 2
    _limit_variance(bias, noise)
    if interval > FLT_EPSILON and abs(bias.interval - interval) > CHANGED_INTERVAL_S:
        bias.ratio_gain = interval / (interval + RATIO_TIME_S)
        bias.interval = interval


@kernel
def fuse_baro_bias(bias, measured, variance, noise):
    """Correct the bias by one that was measured (m) with a variance (m²)."""
    innovation, innovation_variance = measured - bias.bias, bias.variance + variance
    ratio = innovation * innovation / (GATE * GATE * innovation_variance)
    if ratio < 1.0:
        gain = bias.variance / innovation_variance
        bias.bias = min(max(bias.bias + gain * innovation, -LARGEST_BIAS), LARGEST_BIAS)
        bias.variance -= gain * bias.variance
        _limit_variance(bias, noise)
    if abs(bias.ratio_lpf) > LARGE_RATIO:
        bias.variance += BOOST * (DRIFT_RATE * bias.interval) ** 2
    signed = math.copysign(min(ratio, 1.0), innovation) if innovation != 0.0 else 0.0
    bias.ratio_lpf += bias.ratio_gain * (signed - bias.ratio_lpf)
