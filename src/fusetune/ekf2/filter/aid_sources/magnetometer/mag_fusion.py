"""Fusion of the three magnetometer axes and of declination.

Measurement models (error state in the NED tangent frame, R = R(q)):
field h = Rᵀ m_I + m_B with H_θ = Rᵀ[m_I]×, H_mI = Rᵀ, H_mB = I; declination h = atan2(m_I,y, m_I,x).

Mirrors PX4 v1.16 `EKF/aid_sources/magnetometer/mag_fusion.cpp`; the Jacobians are written out and not generated.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.magnetometer.field_limits import limit_field
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import ATTITUDE, GYRO_BIAS, MAG_BODY, MAG_EARTH
from fusetune.ekf2.filter.covariance import reset_quat_cov
from fusetune.ekf2.filter.field_covariance import reset_field_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import compute_innovation_variance, scale_kalman_gain
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import complete_attitude_jacobian
from fusetune.ekf2.filter.source_stops.heading_and_field import clear_mag_faults
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.numerics.rotations import component_in_body, wrap_pi
from fusetune.ekf2.releases.by_release import by_release

R_MAG_MIN = 0.01**2


@kernel
def predict_mag(ekf, axis):
    """Predicted field (Gauss) along one body axis."""
    R, field = ekf.R_to_earth, ekf.mag_I
    return component_in_body(R, axis, field[0], field[1], field[2]) + ekf.mag_B[axis]


@kernel
def _compute_mag_h(ekf, axis, H):
    """Write the observation Jacobian of one body axis into H (24,)."""
    R, field = ekf.R_to_earth, ekf.mag_I
    rx, ry, rz = R[0, axis], R[1, axis], R[2, axis]
    H[:] = 0.0
    H[ATTITUDE] = ry * field[2] - rz * field[1]
    H[ATTITUDE + 1] = rz * field[0] - rx * field[2]
    H[ATTITUDE + 2] = rx * field[1] - ry * field[0]
    H[MAG_EARTH] = rx
    H[MAG_EARTH + 1] = ry
    H[MAG_EARTH + 2] = rz
    H[MAG_BODY + axis] = 1.0


@kernel
def _compute_mag_h_by_quaternion(ekf, axis, H):
    """As v1.16's; the earth field in the body frame, without the body field, grows with the square of the norm."""
    _compute_mag_h(ekf, axis, H)
    complete_attitude_jacobian(ekf, H, 2.0 * (predict_mag(ekf, axis) - ekf.mag_B[axis]))


compute_mag_h = by_release(_compute_mag_h, "adds_quaternion_errors", _compute_mag_h_by_quaternion)
"""Write the observation Jacobian of one body axis into H (24,)."""


@kernel
def _earth_part(ekf, sample, axis):
    return sample[axis] - ekf.mag_B[axis]


@kernel
def _measurement(ekf, sample, axis):
    return sample[axis]


_told_field = by_release(_earth_part, "clears_field_whenever_stopped", _measurement)
"""What is told as observed along a body axis (Gauss)."""


@kernel
def judge_mag(ekf, params, sample, R_mag):
    """Innovations and variances of all axes, and their verdict, as releases before v1.16 tell them of a fused field.

    What is observed is told less the body field, in v1.13 as it is. The time of the sample is that which the status has
    already.

    Returns
    -------
    bool : whether every innovation variance is above the noise
    """
    H, aid = ekf.scratch.H, ekf.aid.mag
    sound = True
    for axis in range(3):
        compute_mag_h(ekf, axis, H)
        variance = compute_innovation_variance(ekf, H, R_mag)
        innovation = predict_mag(ekf, axis) - sample[axis]
        if axis == 2 and ekf.cs.synthetic_mag_z:
            innovation = 0.0
        set_axis(aid, axis, _told_field(ekf, sample, axis), R_mag, innovation, variance)
        sound = sound and variance >= R_mag
    update_aid_source_status(ekf, aid, 3, aid.timestamp_sample, max(params.EKF2_MAG_GATE, 1.0))
    clear_mag_faults(ekf)
    return sound


@kernel
def keep_only_mag_gains(K):
    """Let the update move nothing but the field states."""
    K[:MAG_EARTH] = 0.0
    K[MAG_BODY + 3 :] = 0.0


@kernel
def _hold_attitude(ekf, K):
    """Let the update leave roll and pitch alone."""
    K[ATTITUDE] = 0.0
    K[ATTITUDE + 1] = 0.0


@kernel
def _hold_attitude_and_bias(ekf, K):
    """Let the update leave roll, pitch and the gyro bias about x and y alone."""
    _hold_attitude(ekf, K)
    K[GYRO_BIAS] = 0.0
    K[GYRO_BIAS + 1] = 0.0


_hold_tilt = by_release(_hold_attitude, "keeps_level_gyro_bias", _hold_attitude_and_bias)


@kernel
def _recover_what_is_fused(ekf, params, update_all_states):
    """The innovation variance fell below the noise: start the covariances that made it anew."""
    if update_all_states:
        reset_quat_cov(ekf, params, params.EKF2_HEAD_NOISE)
    reset_field_covariance(ekf, params)


@kernel
def _recover_all(ekf, params, update_all_states):
    """As v1.16's, with the attitude always."""
    _recover_what_is_fused(ekf, params, True)


recover_from_bad_mag_covariance = by_release(_recover_what_is_fused, "fuses_heading_or_field", _recover_all)


@kernel
def _note_heading(ekf):
    ekf.time_last_heading_fuse = ekf.time_delayed_us


@kernel
def _note_no_heading(ekf):
    """Until v1.14 only an angle counts as a heading."""


_note_heading_by_field = by_release(_note_heading, "fuses_heading_or_field", _note_no_heading)


@kernel
def _keep_jacobian(ekf, axis, H):
    """All axes are linearised at the first state."""


_renew_jacobian = by_release(_keep_jacobian, "finds_field_first", compute_mag_h)


@kernel
def _find_innovation(ekf, axis, mag):
    ekf.aid.mag.innovation[axis] = predict_mag(ekf, axis) - mag[axis]


@kernel
def _keep_innovation(ekf, axis, mag):
    """It stays the one that was found before the first axis was fused."""


_renew_innovation = by_release(_find_innovation, "finds_field_first", _keep_innovation)


@kernel
def fuse_mag(ekf, params, mag, R_mag, update_all_states, update_tilt):
    """Fuse the axes one after the other, all linearised at the first state; return whether all were fused.

    `ekf.aid.mag` holds the first axis's innovation and variance already. Of y and z both are computed anew. Without
    `update_tilt` roll and pitch stay; without `update_all_states` only the field states move.
    """
    aid = ekf.aid.mag
    if aid.innovation_rejected:
        return False

    jacobians = ekf.mag.jacobians
    for axis in range(3):
        compute_mag_h(ekf, axis, jacobians[axis])

    K = ekf.scratch.K
    healthy = True
    for axis in range(3):
        if axis == 2 and ekf.cs.synthetic_mag_z:
            continue
        H = jacobians[axis]
        _renew_jacobian(ekf, axis, H)
        variance = compute_innovation_variance(ekf, H, R_mag)
        if axis > 0:
            aid.innovation_variance[axis] = variance
            _renew_innovation(ekf, axis, mag)
        if aid.innovation_variance[axis] < R_mag:
            recover_from_bad_mag_covariance(ekf, params, update_all_states)
            return False

        scale_kalman_gain(ekf, aid.innovation_variance[axis])
        if not update_all_states:
            keep_only_mag_gains(K)
        elif not update_tilt:
            _hold_tilt(ekf, K)
        if measurement_update(ekf, params, aid.observation_variance[axis], aid.innovation[axis]):
            limit_field(ekf, params)
        else:
            healthy = False

    if not healthy:
        return False
    clear_mag_faults(ekf)
    aid.fused = True
    aid.time_last_fuse = ekf.time_delayed_us
    if update_all_states:
        _note_heading_by_field(ekf)
    return True


@kernel
def compute_declination_h(mag_I, H):
    """Write the Jacobian of declination into H (24,); return the predicted declination (rad).

    The north component is kept off zero by single-precision epsilon, as PX4's generated equations do.
    """
    sign = 1.0 if mag_I[0] > 0.0 else (-1.0 if mag_I[0] < 0.0 else 0.0)
    north = mag_I[0] + (sign + 0.5) * FLT_EPSILON
    east = mag_I[1]
    squared = north * north + east * east
    H[:] = 0.0
    H[MAG_EARTH] = -east / squared
    H[MAG_EARTH + 1] = north / squared
    return math.atan2(east, north)


@kernel
def _hold_nothing(ekf, K):
    """v1.16 lets the declination correct every state."""


@kernel
def _hold_tilt_unless_fused(ekf, K):
    """The declination leaves alone what the field does."""
    if not ekf.cs.mag_3d:
        _hold_tilt(ekf, K)


_hold_tilt_by_declination = by_release(_hold_nothing, "keeps_level_gyro_bias", _hold_tilt_unless_fused)


@kernel
def _wrapped(ekf, difference):
    return wrap_pi(difference)


@kernel
def _bounded(ekf, difference):
    """No more than 0.5 rad at a time."""
    return min(max(difference, -0.5), 0.5)


_declination_innovation = by_release(_wrapped, "bounds_declination_innovation", _bounded)


@kernel
def fuse_declination(ekf, params, declination, R, update_all_states):
    """Fuse a declination (rad) of variance R (rad²) into the earth field states; return whether it was fused."""
    H = ekf.scratch.H
    predicted = compute_declination_h(ekf.mag_I, H)
    innovation = _declination_innovation(ekf, predicted - declination)

    innovation_variance = compute_innovation_variance(ekf, H, R)
    if innovation_variance < R:
        ekf.fs.bad_mag_decl = True
        return False

    scale_kalman_gain(ekf, innovation_variance)
    if not update_all_states:
        keep_only_mag_gains(ekf.scratch.K)
    else:
        _hold_tilt_by_declination(ekf, ekf.scratch.K)
    if not measurement_update(ekf, params, R, innovation):
        ekf.fs.bad_mag_decl = True
        return False
    limit_field(ekf, params)
    ekf.fs.bad_mag_decl = False
    return True
