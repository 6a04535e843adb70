"""North and east bias of a position source against the position reference."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.bias_estimator.bias_estimator import (
    BIAS_ESTIMATOR,
    fuse_bias,
    initialise_bias_estimator,
    predict_bias,
    reset_bias,
    set_max_state_noise,
    set_process_noise_spectral_density,
)

POSITION_BIAS_ESTIMATOR = np.dtype(
    [("north", BIAS_ESTIMATOR), ("east", BIAS_ESTIMATOR), ("fusion_active", "?")], align=True
)


@kernel
def initialise_position_bias_estimator(estimator):
    """State at start: no bias, standard variance of 0.1 m², source not fused."""
    initialise_bias_estimator(estimator.north, 0.1)
    initialise_bias_estimator(estimator.east, 0.1)
    estimator.fusion_active = False


@kernel
def predict_position_bias(ekf, estimator, sensor, dt):
    """Predict over `dt` (s) unless the source (`sensor`, a `POSITION_REF_…` value) is the reference or not fused."""
    if ekf.position_sensor_ref != sensor and estimator.fusion_active:
        predict_bias(estimator.north, dt)
        predict_bias(estimator.east, dt)


@kernel
def fuse_position_bias(ekf, estimator, sensor, north, east, north_var, east_var):
    """Fuse an observed bias (m) unless the source is the reference or not fused."""
    if ekf.position_sensor_ref != sensor and estimator.fusion_active:
        fuse_bias(estimator.north, north, north_var)
        fuse_bias(estimator.east, east, east_var)


@kernel
def set_position_bias(estimator, north, east):
    """Replace the bias; its variance stays."""
    estimator.north.bias = north
    estimator.east.bias = east


@kernel
def reset_position_bias(estimator):
    """Forget the bias of both axes."""
    reset_bias(estimator.north)
    reset_bias(estimator.east)


@kernel
def set_position_bias_noise(estimator, nsd, max_noise_north, max_noise_east):
    """Random-walk density (m/√Hz/s) and upper limits of the standard deviations (m)."""
    set_process_noise_spectral_density(estimator.north, nsd)
    set_process_noise_spectral_density(estimator.east, nsd)
    set_max_state_noise(estimator.north, max_noise_north)
    set_max_state_noise(estimator.east, max_noise_east)
