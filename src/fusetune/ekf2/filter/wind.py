"""Wind states: what remains of them between aid sources, and their resets.

Mirrors PX4 v1.16 `EKF/wind.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_mask import MASK_DRAG
from fusetune.ekf2.filter.common.state import WIND
from fusetune.ekf2.filter.covariance import INITIAL_WIND_UNCERTAINTY, reset_covariance_block, reset_wind_cov
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import compute_kalman_gain
from fusetune.ekf2.numerics.rotations import rotate_to_body
from fusetune.ekf2.releases.by_release import by_release

WIND_MEMORY = np.dtype([("external_init", "?")], align=True)
"""Sub-record `ekf.wind`: whether the wind was given from outside and no source has used it yet."""


@kernel
def air_velocity(ekf):
    """Velocity (m/s, NED) of the vehicle through the air."""
    return ekf.vel[0] - ekf.wind_vel[0], ekf.vel[1] - ekf.wind_vel[1], ekf.vel[2]


@kernel
def air_velocity_body(ekf):
    """Velocity (m/s, FRD) of the vehicle through the air."""
    x, y, z = air_velocity(ekf)
    return rotate_to_body(ekf.R_to_earth, x, y, z)


@kernel
def _start_wind_as_it_is(ekf):
    """The wind keeps its value, with the variances of one of which nothing is known, unless an operator gave it."""
    if not ekf.wind.external_init:
        reset_wind_cov(ekf)


@kernel
def reset_wind_to_zero(ekf):
    """Nothing is known of the wind."""
    ekf.wind_vel[0], ekf.wind_vel[1] = 0.0, 0.0
    reset_wind_cov(ekf)


start_wind = by_release(_start_wind_as_it_is, "starts_wind_at_zero", reset_wind_to_zero)


@kernel
def _is_asked_for(ekf, params):
    return int(params.EKF2_DRAG_CTRL) > 0


@kernel
def _is_asked_for_by_mask(ekf, params):
    return (int(params.EKF2_AID_MASK) & MASK_DRAG) != 0


is_drag_enabled = by_release(_is_asked_for, "selects_sources_by_mask", _is_asked_for_by_mask)
"""Whether the wind is to be estimated from drag."""


@kernel
def reset_wind_to(ekf, north, east, var_north, var_east):
    """Set the wind (m/s, towards NE) and its variances; a variance that is not finite leaves the covariance alone."""
    ekf.wind_vel[0], ekf.wind_vel[1] = north, east
    largest = INITIAL_WIND_UNCERTAINTY * INITIAL_WIND_UNCERTAINTY
    if math.isfinite(var_north):
        reset_covariance_block(ekf, WIND, 1, min(largest, var_north))
    if math.isfinite(var_east):
        reset_covariance_block(ekf, WIND + 1, 1, min(largest, var_east))


@kernel
def reset_wind_to_external_observation(ekf, speed, direction, speed_accuracy, direction_accuracy):
    """Take the wind that an operator gave, on ground only.

    Parameters
    ----------
    speed, speed_accuracy : m/s
    direction, direction_accuracy : rad; the direction that the wind blows to
    """
    if ekf.cs.in_air:
        return
    speed = max(speed, 0.0)
    c, s = math.cos(direction), math.sin(direction)
    along = speed_accuracy * speed_accuracy
    across = speed * speed * direction_accuracy * direction_accuracy
    ekf.events.reset_wind_to_ext_obs = True
    ekf.wind.external_init = True
    reset_wind_to(ekf, speed * c, speed * s, c * c * along + s * s * across, s * s * along + c * c * across)


@kernel
def fuse_into_wind(ekf, params, aid, H, update_wind_only):
    """Fuse a judged observation of the air's velocity: into the wind alone, or into every state."""
    K = ekf.scratch.K
    compute_kalman_gain(ekf, H, aid.innovation_variance[0])
    if update_wind_only:
        keep_only_wind_gains(K)
    aid.fused = measurement_update(ekf, params, aid.observation_variance[0], aid.innovation[0])
    if aid.fused:
        aid.time_last_fuse = ekf.time_delayed_us


@kernel
def keep_only_wind_gains(K):
    """Let an update move the wind states alone."""
    for i in range(WIND):
        K[i] = 0.0
    for i in range(WIND + 2, K.shape[0]):
        K[i] = 0.0
