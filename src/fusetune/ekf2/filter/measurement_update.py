"""Fusion of one scalar observation: Kalman gain limits, Joseph-form covariance update, state correction.

Whether an innovation passes its gate has been asked before (`common/aid_source_status`).

Innovations are prediction less observation, so the state moves by -K·innovation. For a gain K, of which some entries
may have been set to zero, the Joseph form (I - K H) P (I - K H)ᵀ + K R Kᵀ multiplies out to

    P - K (P Hᵀ)ᵀ - (P Hᵀ) Kᵀ + K (H P Hᵀ + R) Kᵀ

which is evaluated here in one pass that keeps P exactly symmetric.

Mirrors `measurementUpdate`, `fuseDirectStateMeasurement` and `fuse` of PX4 v1.16 `EKF/ekf_helper.cpp`, and the limits
of `EKF/covariance.cpp`; in double precision.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.global_position import add_to_global_position, single_precision
from fusetune.ekf2.filter.observation_gain import dot, multiply_covariance
from fusetune.ekf2.numerics.rotations import quat_to_dcm, rotate_by_earth_increment

MAG_BIAS_LIMIT = 0.5
MAG_EARTH_LIMIT = 1.0
VELOCITY_LIMIT = 1e3
WIND_LIMIT = 1e2
TERRAIN_LIMIT = 1e4

BIAS_VARIANCE_MIN = 1e-9
MAG_VARIANCE_MIN = 1e-6
VARIANCE_MAX_RATIO = 1e6

MAX_VARIANCE_REDUCTIONS = 1000


@kernel
def clear_inhibited_state_kalman_gains(ekf, params, K):
    """Zero the gains of the states that are not being estimated now."""
    for i in range(3):
        if ekf.gyro_bias_inhibit[i]:
            K[state.GYRO_BIAS + i] = 0.0
        if ekf.accel_bias_inhibit[i]:
            K[state.ACCEL_BIAS + i] = 0.0
    if not ekf.cs.mag:
        for i in range(state.MAG_EARTH, state.MAG_BODY + 3):
            K[i] = 0.0
    if not ekf.cs.wind:
        K[state.WIND] = 0.0
        K[state.WIND + 1] = 0.0


@kernel
def joseph_update(P, K, PH, S):
    """P ← P - K PHᵀ - PH Kᵀ + S K Kᵀ, with PH = P Hᵀ and S = H P Hᵀ + R."""
    for i in range(state.ERROR_STATE_SIZE):
        k_i = K[i]
        ph_i = PH[i]
        for j in range(state.ERROR_STATE_SIZE):
            P[i, j] -= (k_i * PH[j] + ph_i * K[j]) - (k_i * K[j]) * S


@kernel
def reduce_variance(ekf, params, state_index):
    """Fuse a zero innovation of ten times the state's variance, which takes about 10 % off that variance.

    Clipping would strengthen the correlations with other states; this does not.
    """
    P = ekf.P
    K = ekf.scratch.K_reduce
    PH = ekf.scratch.PH_reduce
    R = 10.0 * P[state_index, state_index]
    S = P[state_index, state_index] + R
    for i in range(state.ERROR_STATE_SIZE):
        PH[i] = P[state_index, i]
        K[i] = PH[i] / S
    clear_inhibited_state_kalman_gains(ekf, params, K)
    joseph_update(P, K, PH, S)


@kernel
def _limit_variances(ekf, index, dof, low, high):
    """Raise too small variances; return the first state whose variance exceeds `high`, or -1."""
    P = ekf.P
    for i in range(index, index + dof):
        if P[i, i] < low:
            P[i, i] = low
        elif P[i, i] > high:
            return i
    return -1


@kernel
def _limit_variance_ratio(ekf, index, dof, low, high):
    """As `_limit_variances`, and no variance of the group less than 10⁻⁶ of its largest."""
    P = ekf.P
    largest = 0.0
    for i in range(index, index + dof):
        if P[i, i] > largest:
            largest = P[i, i]
    limited_max = min(max(largest, low), high)
    limited_min = min(max(limited_max / VARIANCE_MAX_RATIO, low), high)
    return _limit_variances(ekf, index, dof, limited_min, limited_max)


@kernel
def _first_excessive_variance(ekf):
    """Raise all too small variances up to the first state whose variance is too large; return it, or -1."""
    i = _limit_variances(ekf, state.ATTITUDE, 3, 1e-9, 1.0)
    if i < 0:
        i = _limit_variances(ekf, state.VELOCITY, 6, 1e-6, 1e6)
    if i < 0:
        i = _limit_variance_ratio(ekf, state.GYRO_BIAS, 3, BIAS_VARIANCE_MIN, 1.0)
    if i < 0:
        i = _limit_variance_ratio(ekf, state.ACCEL_BIAS, 3, BIAS_VARIANCE_MIN, 1.0)
    if i < 0 and ekf.cs.mag:
        i = _limit_variance_ratio(ekf, state.MAG_EARTH, 3, MAG_VARIANCE_MIN, 1.0)
        if i < 0:
            i = _limit_variance_ratio(ekf, state.MAG_BODY, 3, MAG_VARIANCE_MIN, 1.0)
    if i < 0 and ekf.cs.wind:
        i = _limit_variance_ratio(ekf, state.WIND, 2, 1e-6, 1e6)
    if i < 0:
        i = _limit_variance_ratio(ekf, state.TERRAIN, 1, 0.0, 1e4)
    return i


@kernel
def constrain_state_variances(ekf, params):
    """Keep every variance within the limits of its group of states."""
    for _ in range(MAX_VARIANCE_REDUCTIONS):
        i = _first_excessive_variance(ekf)
        if i < 0:
            return
        reduce_variance(ekf, params, i)


@kernel
def _limited(value, limit):
    return min(max(value, -limit), limit)


@kernel
def fuse(ekf, params, K, innovation):
    """Correct the state by -K·innovation, each part within its limits."""
    north, east, down = K[state.ATTITUDE], K[state.ATTITUDE + 1], K[state.ATTITUDE + 2]
    rotate_by_earth_increment(ekf.q, -north * innovation, -east * innovation, -down * innovation)
    quat_to_dcm(ekf.q, ekf.R_to_earth)
    for i in range(3):
        ekf.vel[i] = _limited(ekf.vel[i] - K[state.VELOCITY + i] * innovation, VELOCITY_LIMIT)
        ekf.gyro_bias[i] = _limited(ekf.gyro_bias[i] - K[state.GYRO_BIAS + i] * innovation, params.EKF2_GYR_B_LIM)
        ekf.accel_bias[i] = _limited(ekf.accel_bias[i] - K[state.ACCEL_BIAS + i] * innovation, params.EKF2_ABL_LIM)
    add_to_global_position(
        ekf, -K[state.POSITION] * innovation, -K[state.POSITION + 1] * innovation, -K[state.POSITION + 2] * innovation
    )
    if ekf.cs.mag:
        for i in range(3):
            ekf.mag_I[i] = _limited(ekf.mag_I[i] - K[state.MAG_EARTH + i] * innovation, MAG_EARTH_LIMIT)
            ekf.mag_B[i] = _limited(ekf.mag_B[i] - K[state.MAG_BODY + i] * innovation, MAG_BIAS_LIMIT)
    if ekf.cs.wind:
        for i in range(2):
            ekf.wind_vel[i] = _limited(ekf.wind_vel[i] - K[state.WIND + i] * innovation, WIND_LIMIT)
    ekf.terrain = single_precision(_limited(ekf.terrain - K[state.TERRAIN] * innovation, TERRAIN_LIMIT))


@kernel
def measurement_update(ekf, params, K, H, R, innovation):
    """Fuse a scalar observation.

    Parameters
    ----------
    K : (24,) Kalman gain; the entries of states that are not estimated are zeroed in place
    H : (24,) derivative of the predicted observation by the error state
    R : observation variance
    innovation : prediction less observation

    Returns
    -------
    bool : True, as in v1.16 an update cannot fail
    """
    clear_inhibited_state_kalman_gains(ekf, params, K)
    PH = ekf.scratch.PH
    multiply_covariance(ekf.P, H, PH)
    joseph_update(ekf.P, K, PH, dot(H, PH) + R)
    constrain_state_variances(ekf, params)
    fuse(ekf, params, K, innovation)
    return True


@kernel
def fuse_direct_state(ekf, params, innovation, innovation_var, R, state_index):
    """Fuse an observation of a single state: H is one at `state_index`.

    `innovation_var` sets the gain; sources that clip or inflate it pass a value other than P + R.
    """
    P = ekf.P
    K = ekf.scratch.K
    PH = ekf.scratch.PH
    inverse = 1.0 / innovation_var
    for i in range(state.ERROR_STATE_SIZE):
        PH[i] = P[state_index, i]
        K[i] = PH[i] * inverse
    clear_inhibited_state_kalman_gains(ekf, params, K)
    joseph_update(P, K, PH, P[state_index, state_index] + R)
    constrain_state_variances(ekf, params)
    fuse(ekf, params, K, innovation)
    return True
