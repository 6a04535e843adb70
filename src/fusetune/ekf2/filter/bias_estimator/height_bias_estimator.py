"""Bias of a height source against the height reference; idle while the source is the reference or is not fused.

Mirrors PX4 v1.16 `EKF/bias_estimator/height_bias_estimator.hpp`, and what every height source does with it.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.bias_estimator.bias_estimator import (
    BIAS_ESTIMATOR,
    fuse_bias,
    initialise_bias_estimator,
    predict_bias,
    set_max_state_noise,
    set_process_noise_spectral_density,
)
from fusetune.ekf2.filter.common.height_reference import give_up_height_reference
from fusetune.ekf2.filter.common.state import POSITION

HEIGHT_BIAS_NSD = 0.13
"""Random walk of a height source's bias (m/√Hz/s)."""

HEIGHT_BIAS_ESTIMATOR = BIAS_ESTIMATOR
"""A bias estimator and whether its source is fused; the plain functions of `bias_estimator` work on it, too."""


@kernel
def initialise_height_bias_estimator(estimator):
    """State at start: no bias, known exactly, source not fused."""
    initialise_bias_estimator(estimator, 0.0)


@kernel
def predict_height_bias(ekf, estimator, sensor, dt):
    """Predict over `dt` (s) unless the source (`sensor`, a `HEIGHT_REF_…` value) is the reference or not fused."""
    if ekf.height_sensor_ref != sensor and estimator.fusion_active:
        predict_bias(estimator, dt)


@kernel
def update_height_bias(ekf, estimator, sensor, bias, variance):
    """Learn a bias (m) observed with the measurement's variance (m²), unless the source is the reference or not fused.

    To be called after the innovation was formed with the old bias, and before the filter is corrected.
    """
    set_max_state_noise(estimator, math.sqrt(variance))
    set_process_noise_spectral_density(estimator, HEIGHT_BIAS_NSD)
    if ekf.height_sensor_ref != sensor and estimator.fusion_active:
        fuse_bias(estimator, bias, variance + ekf.P[POSITION + 2, POSITION + 2])


@kernel
def start_height_source(ekf, estimator, aid):
    """Fuse the source from now on: its time-out starts, and its bias is followed unless it is the reference."""
    aid.time_last_fuse = ekf.time_delayed_us
    estimator.fusion_active = True


@kernel
def stop_height_source(ekf, estimator, sensor):
    """Fuse the source no more: its bias rests, and it is the height reference no longer."""
    give_up_height_reference(ekf, sensor)
    estimator.fusion_active = False
