"""Scalar Kalman filter of a random-walk bias, with a watch on its innovation sequence.

State model x[k+1] = x[k] + v, observation y[k] = x[k] + w. An innovation beyond 3 σ is not fused. When the filtered
signed test ratio grows large, or innovations keep one sign for more than 10 s worth of observations, the process noise
is raised a thousandfold until the offset is gone.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

GATE_SIZE = 3.0
MONITORING_TIME_CONSTANT_S = 10.0
PROCESS_VARIANCE_BOOST = 1.0e3
OFFSET_TEST_RATIO = 0.2
MINIMUM_VARIANCE = 1e-8
MINIMUM_NOISE = 0.01

BIAS_ESTIMATOR_FIELDS = [
    ("bias", "f8"),
    ("bias_var", "f8"),
    ("dt", "f8"),
    ("process_psd", "f8"),
    ("bias_var_max", "f8"),
    ("test_ratio_lpf", "f8"),
    ("test_ratio_lpf_alpha", "f8"),
    ("time_since_negative_innovation", "f8"),
    ("time_since_positive_innovation", "f8"),
    # last observation, as published
    ("innovation", "f8"),
    ("innovation_variance", "f8"),
    ("innovation_test_ratio", "f8"),
    # whether the source is fused, for those that idle otherwise
    ("fusion_active", "?"),
]

BIAS_ESTIMATOR = np.dtype(BIAS_ESTIMATOR_FIELDS, align=True)


@kernel
def initialise_bias_estimator(estimator, bias_var):
    """State before the first observation."""
    estimator.bias = 0.0
    estimator.bias_var = bias_var
    estimator.dt = 0.01
    estimator.process_psd = 1.25e-6
    estimator.bias_var_max = 2.0
    estimator.test_ratio_lpf = 0.0
    # PX4 gives the filter a gain only when the update interval differs from 10 ms by more than 1 ms
    estimator.test_ratio_lpf_alpha = 0.0
    estimator.time_since_negative_innovation = 0.0
    estimator.time_since_positive_innovation = 0.0
    estimator.innovation = 0.0
    estimator.innovation_variance = 0.0
    estimator.innovation_test_ratio = np.inf


@kernel
def reset_bias(estimator):
    """Forget the bias and what was noted of its innovations; noise settings stay."""
    estimator.bias = 0.0
    estimator.bias_var = 0.0
    estimator.test_ratio_lpf = 0.0
    estimator.time_since_negative_innovation = 0.0
    estimator.time_since_positive_innovation = 0.0


@kernel
def set_bias(estimator, bias):
    """Replace the bias; its variance stays."""
    estimator.bias = bias


@kernel
def set_process_noise_spectral_density(estimator, noise):
    """Random-walk density, in units of the bias per √Hz and second."""
    estimator.process_psd = noise * noise


@kernel
def set_max_state_noise(estimator, noise):
    """Upper limit of the bias' standard deviation."""
    estimator.bias_var_max = max(MINIMUM_NOISE * MINIMUM_NOISE, noise * noise)


@kernel
def is_offset_detected(estimator):
    """Whether the innovations have been too large on average, or of one sign for too long."""
    return (
        abs(estimator.test_ratio_lpf) > OFFSET_TEST_RATIO
        or estimator.time_since_positive_innovation > MONITORING_TIME_CONSTANT_S
        or estimator.time_since_negative_innovation > MONITORING_TIME_CONSTANT_S
    )


@kernel
def predict_bias(estimator, dt):
    """Let the bias' variance grow over `dt` seconds."""
    growth = estimator.process_psd * dt
    if is_offset_detected(estimator):
        growth *= PROCESS_VARIANCE_BOOST
    estimator.bias_var += growth
    _constrain_variance(estimator)
    if dt > 1.2e-7 and abs(estimator.dt - dt) > 0.001:
        estimator.test_ratio_lpf_alpha = dt / (dt + MONITORING_TIME_CONSTANT_S)
        estimator.dt = dt


@kernel
def fuse_bias(estimator, measurement, measurement_var):
    """Correct the bias by one observation of it."""
    innovation_variance = estimator.bias_var + max(MINIMUM_NOISE * MINIMUM_NOISE, measurement_var)
    innovation = measurement - estimator.bias
    test_ratio = innovation * innovation / (GATE_SIZE * GATE_SIZE * innovation_variance)
    if test_ratio < 1.0:
        gain = estimator.bias_var / innovation_variance
        estimator.bias += gain * innovation
        estimator.bias_var -= gain * estimator.bias_var
        _constrain_variance(estimator)
    _watch_innovations(estimator, innovation, test_ratio)
    estimator.innovation = innovation
    estimator.innovation_variance = innovation_variance
    estimator.innovation_test_ratio = test_ratio


@kernel
def _watch_innovations(estimator, innovation, test_ratio):
    signed_ratio = 0.0
    if innovation != 0.0:
        signed_ratio = math.copysign(min(test_ratio, 1.0), innovation)
    estimator.test_ratio_lpf += estimator.test_ratio_lpf_alpha * (signed_ratio - estimator.test_ratio_lpf)
    # the clocks advance by the filter's update interval per observation, however long observations are apart
    if innovation > 0.0:
        estimator.time_since_positive_innovation = 0.0
        estimator.time_since_negative_innovation += estimator.dt
    else:
        estimator.time_since_negative_innovation = 0.0
        estimator.time_since_positive_innovation += estimator.dt


@kernel
def _constrain_variance(estimator):
    estimator.bias_var = min(max(estimator.bias_var, MINIMUM_VARIANCE), estimator.bias_var_max)
