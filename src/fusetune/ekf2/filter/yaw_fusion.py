"""Fusion of a heading observation.

With the attitude error in the NED frame, a heading error is the attitude error about down: H has a one there and
zeros elsewhere. Antenna heading passes its own H.

Mirrors PX4 v1.16 `EKF/yaw_fusion.cpp`, whose resets stand in `resets/`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import ATTITUDE, ERROR_STATE_SIZE, MAG_BODY, MAG_EARTH
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance, reset_gyro_bias_z_cov
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import compute_kalman_gain, multiply_covariance
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import attitude_variance, write_yaw_jacobian
from fusetune.ekf2.releases.by_release import by_release

LANDED_TIME_BEFORE_FORCED_YAW_US = 5_000_000
FORCED_YAW_INTERVAL_US = 1_000_000


@kernel
def _compute_by_down_error(ekf, variance, H):
    for i in range(ERROR_STATE_SIZE):
        H[i] = 0.0
    H[ATTITUDE + 2] = 1.0
    return ekf.P[ATTITUDE + 2, ATTITUDE + 2] + variance


@kernel
def _compute_by_quaternion(ekf, variance, H):
    write_yaw_jacobian(ekf, H)
    return attitude_variance(ekf, H) + variance


compute_yaw_innov_var_and_h = by_release(_compute_by_down_error, "adds_quaternion_errors", _compute_by_quaternion)
"""Write H of a heading observation into `H` (24,) and return its innovation variance (rad²)."""


@kernel
def _keep_all_gains(ekf):
    """A yaw corrects whatever is estimated."""


@kernel
def _keep_none_of_field(ekf):
    """The field states stay, though they may have a covariance in the update that ended their fusion."""
    for i in range(MAG_EARTH, MAG_BODY + 3):
        ekf.scratch.K[i] = 0.0


_keep_gains_of_yaw = by_release(_keep_all_gains, "forces_every_yaw", _keep_none_of_field)


@kernel
def fuse_yaw(ekf, params, aid, H_yaw):
    """Fuse a judged heading observation; return whether it was fused.

    On ground a rejected heading is fused all the same, limited to the gate, once per second and not within five
    seconds of landing: it may come from interference or a wrong initial gyro bias.
    """
    if not aid.innovation_variance[0] >= aid.observation_variance[0]:
        ekf.fs.bad_hdg = True
        initialise_covariance(ekf, params)
        return False
    ekf.fs.bad_hdg = False

    compute_kalman_gain(ekf, H_yaw, aid.innovation_variance[0])
    _keep_gains_of_yaw(ekf)
    ekf.reject.yaw = aid.innovation_rejected
    if aid.innovation_rejected:
        if not _may_force_yaw(ekf, aid):
            return False
        limit = max(params.EKF2_HDG_GATE, 1.0) * math.sqrt(aid.innovation_variance[0])
        aid.innovation[0] = min(max(aid.innovation[0], -limit), limit)
        reset_gyro_bias_z_cov(ekf, params)
        multiply_covariance(ekf, H_yaw)

    fused = measurement_update(ekf, params, aid.observation_variance[0], aid.innovation[0])
    aid.fused = fused
    ekf.fs.bad_hdg = not fused
    if fused:
        ekf.time_last_heading_fuse = ekf.time_delayed_us
        aid.time_last_fuse = ekf.time_delayed_us
    return fused


@kernel
def _may_force_yaw(ekf, aid):
    return (
        not ekf.cs.in_air
        and is_timed_out(ekf, ekf.time_last_in_air, LANDED_TIME_BEFORE_FORCED_YAW_US)
        and _is_force_due(ekf, aid)
    )


@kernel
def _once_per_second(ekf, aid):
    return is_timed_out(ekf, aid.time_last_fuse, FORCED_YAW_INTERVAL_US)


@kernel
def _always(ekf, aid):
    return True


_is_force_due = by_release(_once_per_second, "forces_every_yaw", _always)


@kernel
def judge_angle(ekf, params, aid, observation, innovation, R):
    """Judge an angle (rad) that is observed for the yaw with variance R (rad²); its H is left in `ekf.scratch.H`."""
    variance = compute_yaw_innov_var_and_h(ekf, R, ekf.scratch.H)
    set_axis(aid, 0, observation, R, innovation, variance)
    update_aid_source_status(ekf, aid, 1, aid.timestamp_sample, max(params.EKF2_HDG_GATE, 1.0))
