"""Bias of a height source against the height reference; idle while the source is the reference or is not fused."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.bias_estimator.bias_estimator import (
    BIAS_ESTIMATOR,
    fuse_bias,
    initialise_bias_estimator,
    predict_bias,
)

HEIGHT_BIAS_ESTIMATOR = BIAS_ESTIMATOR
"""A bias estimator and whether its source is fused; the plain functions of `bias_estimator` work on it, too."""


@kernel
def initialise_height_bias_estimator(estimator):
    """State at start: no bias, known exactly, source not fused."""
    initialise_bias_estimator(estimator, 0.0)
    estimator.fusion_active = False


@kernel
def predict_height_bias(ekf, estimator, sensor, dt):
    """Predict over `dt` (s) unless the source (`sensor`, a `HEIGHT_REF_…` value) is the reference or not fused."""
    if ekf.height_sensor_ref != sensor and estimator.fusion_active:
        predict_bias(estimator, dt)


@kernel
def fuse_height_bias(ekf, estimator, sensor, bias, bias_var):
    """Fuse an observed bias (m) unless the source is the reference or not fused."""
    if ekf.height_sensor_ref != sensor and estimator.fusion_active:
        fuse_bias(estimator, bias, bias_var)
