"""Fusion of a scalar observation without Joseph's form: P ← P - S K Kᵀ, S the innovation variance.

Where that would make a variance negative, the covariances of the state are zeroed and nothing is fused. Gains that were
set to zero leave the covariances of their states with each other alone. v1.13 takes K H P off instead, which is the
same unless gains were set to zero.

Mirrors `measurementUpdate` of PX4 v1.14 `EKF/ekf.h`, `fuseVelPosHeight` of `EKF/vel_pos_fusion.cpp` and `fuse` of
`EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.covariance_blocks import zero_covariance_block
from fusetune.ekf2.filter.common.global_position import add_to_position
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3
from fusetune.ekf2.filter.quaternion_core.quaternion_limits import limit_covariance
from fusetune.ekf2.numerics.rotations import quat_normalise, quat_to_dcm
from fusetune.ekf2.releases.by_release import by_release


@kernel
def scale_gain(ekf, innovation_variance):
    """Write P Hᵀ / S into `ekf.scratch.K` (24,), and keep S."""
    K, PH = ekf.scratch.K, ekf.scratch.PH
    ekf.quaternion.innovation_variance = innovation_variance
    inverse = 1.0 / innovation_variance
    for i in range(state.ERROR_STATE_SIZE):
        K[i] = PH[i] * inverse


@kernel
def update_by_gain(ekf, params, R, innovation):
    """Fuse an observation whose gain stands in `ekf.scratch.K`, of the innovation variance that scaled it.

    Returns
    -------
    bool : whether it was fused, which the covariance may not allow
    """
    _clear_gains(ekf)
    if not _update_covariance(ekf):
        return False
    limit_covariance(ekf, params)
    _correct_states(ekf, innovation)
    _renew_rotation(ekf)
    return True


@kernel
def _take_off_gain_squared(ekf):
    """P ← P - S K Kᵀ; returns whether all variances stay positive. `ekf.scratch.PH` becomes K √S."""
    P, K, root = ekf.P, ekf.scratch.PH, math.sqrt(ekf.quaternion.innovation_variance)
    for i in range(state.ERROR_STATE_SIZE):
        K[i] = ekf.scratch.K[i] * root
    healthy = True
    for i in range(state.ERROR_STATE_SIZE):
        if P[i, i] < K[i] * K[i]:
            zero_covariance_block(ekf, i, 1)
            healthy = False
    if healthy:
        for i in range(state.ERROR_STATE_SIZE):
            k_i = K[i]
            if k_i != 0.0:
                for j in range(state.ERROR_STATE_SIZE):
                    P[i, j] -= k_i * K[j]
    return healthy


@kernel
def _take_off_gain_times_covariance(ekf):
    """P ← P - K H P made symmetric, ½ (K PHᵀ + PH Kᵀ) with PH = P Hᵀ; returns whether all variances stay positive."""
    P, K, PH = ekf.P, ekf.scratch.K, ekf.scratch.PH
    healthy = True
    for i in range(state.ERROR_STATE_SIZE):
        if P[i, i] < K[i] * PH[i]:
            zero_covariance_block(ekf, i, 1)
            healthy = False
    if healthy:
        for i in range(state.ERROR_STATE_SIZE):
            k_i, ph_i = K[i], PH[i]
            if k_i != 0.0 or ph_i != 0.0:
                for j in range(state.ERROR_STATE_SIZE):
                    P[i, j] -= 0.5 * (k_i * PH[j] + ph_i * K[j])
    return healthy


_update_covariance = by_release(_take_off_gain_squared, "updates_by_jacobian", _take_off_gain_times_covariance)


@kernel
def _clear_gains_of_unestimated(ekf):
    K = ekf.scratch.K
    for i in range(3):
        if ekf.gyro_bias_inhibit[i]:
            K[state.GYRO_BIAS + i] = 0.0
        if ekf.accel_bias_inhibit[i]:
            K[state.ACCEL_BIAS + i] = 0.0
    if not ekf.cs.mag_3d:
        for i in range(state.MAG_EARTH, state.MAG_BODY + 3):
            K[i] = 0.0
    if not ekf.cs.wind:
        K[state.WIND] = 0.0
        K[state.WIND + 1] = 0.0


@kernel
def _clear_gains_of_accel_bias(ekf):
    """The covariances of the others are zero where they are not estimated."""
    for i in range(3):
        if ekf.accel_bias_inhibit[i]:
            ekf.scratch.K[state.ACCEL_BIAS + i] = 0.0


_clear_gains = by_release(_clear_gains_of_unestimated, "updates_by_jacobian", _clear_gains_of_accel_bias)
"""Zero the gains of what is not estimated now."""


@kernel
def _rotate_by_new_quaternion(ekf):
    quat_to_dcm(ekf.q, ekf.R_to_earth)


@kernel
def _keep_rotation(ekf):
    """It follows the quaternion at the next prediction."""


_renew_rotation = by_release(_rotate_by_new_quaternion, "updates_by_jacobian", _keep_rotation)


@kernel
def _correct_states(ekf, innovation):
    K, q = ekf.scratch.K, ekf.q
    q[0] -= K[0] * innovation
    q[1] -= K[1] * innovation
    q[2] -= K[2] * innovation
    q[3] -= K[Q3] * innovation
    quat_normalise(q)
    for i in range(3):
        ekf.vel[i] -= K[state.VELOCITY + i] * innovation
        ekf.gyro_bias[i] -= K[state.GYRO_BIAS + i] * innovation
        ekf.accel_bias[i] -= K[state.ACCEL_BIAS + i] * innovation
        ekf.mag_I[i] -= K[state.MAG_EARTH + i] * innovation
        ekf.mag_B[i] -= K[state.MAG_BODY + i] * innovation
    add_to_position(
        ekf, -K[state.POSITION] * innovation, -K[state.POSITION + 1] * innovation, -K[state.POSITION + 2] * innovation
    )
    ekf.wind_vel[0] -= K[state.WIND] * innovation
    ekf.wind_vel[1] -= K[state.WIND + 1] * innovation


@kernel
def update_by_state(ekf, params, innovation, innovation_var, R, state_index):
    """Fuse an observation of a velocity or position, and note when which of them was fused."""
    P, PH = ekf.P, ekf.scratch.PH
    for i in range(state.ERROR_STATE_SIZE):
        PH[i] = P[state_index, i]
    scale_gain(ekf, innovation_var)
    fused = update_by_gain(ekf, params, R, innovation)
    if fused:
        _note_fused_state(ekf, state_index)
    return fused


@kernel
def _note_fused_state(ekf, state_index):
    if state.VELOCITY <= state_index < state.VELOCITY + 2:
        ekf.time_last_hor_vel_fuse = ekf.time_delayed_us
    elif state_index == state.VELOCITY + 2:
        ekf.time_last_ver_vel_fuse = ekf.time_delayed_us
    elif state.POSITION <= state_index < state.POSITION + 2:
        ekf.time_last_hor_pos_fuse = ekf.time_delayed_us
    elif state_index == state.POSITION + 2:
        ekf.time_last_hgt_fuse = ekf.time_delayed_us
