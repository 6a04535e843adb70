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
from fusetune.ekf2.filter.common.global_position import add_to_position, single_precision
from fusetune.ekf2.filter.common.heading_observability import is_heading_held
from fusetune.ekf2.filter.covariance import reset_covariance_block
from fusetune.ekf2.filter.observation_gain import scale_kalman_gain
from fusetune.ekf2.filter.quaternion_core.quaternion_update import update_by_gain, update_by_state
from fusetune.ekf2.numerics.rotations import quat_to_dcm, rotate_by_earth_increment
from fusetune.ekf2.releases.by_release import by_release

MAG_BIAS_LIMIT = 0.5
MAG_EARTH_LIMIT = 1.0
VELOCITY_LIMIT = 1e3
WIND_LIMIT = 1e2
TERRAIN_LIMIT = 1e4

ATTITUDE_VARIANCE_MIN, ATTITUDE_VARIANCE_MAX = 1e-9, 1.0
MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX = 1e-6, 1e6
BIAS_VARIANCE_MIN, BIAS_VARIANCE_MAX = 1e-9, 1.0
MAG_VARIANCE_MIN, MAG_VARIANCE_MAX = 1e-6, 1.0
TERRAIN_VARIANCE_MAX = 1e4
VARIANCE_MAX_RATIO = 1e6

MAX_VARIANCE_REDUCTIONS = 1000


@kernel
def _is_wind_not_estimated(ekf):
    return not ekf.cs.wind


@kernel
def _never(ekf):
    return False


_is_wind_held = by_release(_is_wind_not_estimated, "correlates_wind_always", _never)


@kernel
def clear_inhibited_state_kalman_gains(ekf):
    """Zero the gains of the states that are not being estimated now."""
    K = ekf.scratch.K
    if is_heading_held(ekf):
        K[state.ATTITUDE + 2] = 0.0
    for i in range(3):
        if ekf.gyro_bias_inhibit[i]:
            K[state.GYRO_BIAS + i] = 0.0
        if ekf.accel_bias_inhibit[i]:
            K[state.ACCEL_BIAS + i] = 0.0
    if not ekf.cs.mag:
        for i in range(state.MAG_EARTH, state.MAG_BODY + 3):
            K[i] = 0.0
    if _is_wind_held(ekf):
        K[state.WIND] = 0.0
        K[state.WIND + 1] = 0.0


@kernel
def _update_covariance(ekf, R):
    """P ← P - K PHᵀ - PH Kᵀ + S K Kᵀ, with PH = P Hᵀ and S = H P Hᵀ + R of `ekf.scratch`.

    Rows of states that neither the gain moves nor the observation depends on stay, and so do their columns.
    """
    clear_inhibited_state_kalman_gains(ekf)
    P, K, PH = ekf.P, ekf.scratch.K, ekf.scratch.PH
    S = ekf.scratch.HPH + R
    for i in range(state.ERROR_STATE_SIZE):
        k_i, ph_i = K[i], PH[i]
        if k_i != 0.0 or ph_i != 0.0:
            for j in range(state.ERROR_STATE_SIZE):
                P[i, j] -= (k_i * PH[j] + ph_i * K[j]) - (k_i * K[j]) * S


@kernel
def _observe_state(ekf, state_index):
    """Set `PH` and `HPH` of an observation of a single state: H is one there."""
    P, PH = ekf.P, ekf.scratch.PH
    for i in range(state.ERROR_STATE_SIZE):
        PH[i] = P[state_index, i]
    ekf.scratch.HPH = P[state_index, state_index]


@kernel
def reduce_variance(ekf, state_index):
    """Fuse a zero innovation of ten times the state's variance, which takes about 10 % off that variance.

    Clipping would strengthen the correlations with other states; this does not.
    """
    K, PH = ekf.scratch.K, ekf.scratch.PH
    _observe_state(ekf, state_index)
    R = 10.0 * ekf.scratch.HPH
    S = ekf.scratch.HPH + R
    for i in range(state.ERROR_STATE_SIZE):
        K[i] = PH[i] / S
    _update_covariance(ekf, R)


@kernel
def _first_above(P, index, high):
    """The first of three states whose variance exceeds `high`, or -1.

    Written out: of a loop along the diagonal the compiler makes gathers and scatters, which take longer.
    """
    if P[index, index] > high:
        return index
    if P[index + 1, index + 1] > high:
        return index + 1
    if P[index + 2, index + 2] > high:
        return index + 2
    return -1


@kernel
def _first_excessive_variance(ekf):
    """The first state whose variance is too large, or -1."""
    P = ekf.P
    i = _first_above(P, state.ATTITUDE, ATTITUDE_VARIANCE_MAX)
    if i < 0:
        i = _first_above(P, state.VELOCITY, MOTION_VARIANCE_MAX)
    if i < 0:
        i = _first_above(P, state.POSITION, MOTION_VARIANCE_MAX)
    if i < 0:
        i = _first_above(P, state.GYRO_BIAS, BIAS_VARIANCE_MAX)
    if i < 0:
        i = _first_above(P, state.ACCEL_BIAS, BIAS_VARIANCE_MAX)
    if i < 0 and ekf.cs.mag:
        i = _first_above(P, state.MAG_EARTH, MAG_VARIANCE_MAX)
        if i < 0:
            i = _first_above(P, state.MAG_BODY, MAG_VARIANCE_MAX)
    if i < 0 and ekf.cs.wind:
        if P[state.WIND, state.WIND] > MOTION_VARIANCE_MAX:
            i = state.WIND
        elif P[state.WIND + 1, state.WIND + 1] > MOTION_VARIANCE_MAX:
            i = state.WIND + 1
    if i < 0 and P[state.TERRAIN, state.TERRAIN] > TERRAIN_VARIANCE_MAX:
        i = state.TERRAIN
    return i


@kernel
def _reduce_until_within(ekf):
    for _ in range(MAX_VARIANCE_REDUCTIONS):
        i = _first_excessive_variance(ekf)
        if i < 0:
            break
        reduce_variance(ekf, i)


@kernel
def _reduce_each_once(ekf):
    _reduce_group_once(ekf, state.ATTITUDE, 3, ATTITUDE_VARIANCE_MAX)
    _reduce_group_once(ekf, state.VELOCITY, 6, MOTION_VARIANCE_MAX)
    _reduce_group_once(ekf, state.GYRO_BIAS, 6, BIAS_VARIANCE_MAX)
    if ekf.cs.mag:
        _reduce_group_once(ekf, state.MAG_EARTH, 6, MAG_VARIANCE_MAX)
    if ekf.cs.wind:
        _reduce_group_once(ekf, state.WIND, 2, MOTION_VARIANCE_MAX)
    _reduce_group_once(ekf, state.TERRAIN, 1, TERRAIN_VARIANCE_MAX)


@kernel
def _reduce_group_once(ekf, index, dof, high):
    for i in range(index, index + dof):
        if ekf.P[i, i] > high:
            reduce_variance(ekf, i)


_reduce_excessive_variances = by_release(_reduce_until_within, "reduces_variances_once", _reduce_each_once)


@kernel
def _raise_variance(P, index, low):
    if P[index, index] < low:
        P[index, index] = low


@kernel
def _raise_variances(P, index, low):
    """No variance of three states less than `low`."""
    _raise_variance(P, index, low)
    _raise_variance(P, index + 1, low)
    _raise_variance(P, index + 2, low)


@kernel
def _raise_variances_of_group(P, index, low):
    """No variance of three states less than `low`, nor than 10⁻⁶ of the largest of them."""
    a, b, c = P[index, index], P[index + 1, index + 1], P[index + 2, index + 2]
    smallest, largest = min(a, b, c), max(a, b, c)
    # the usual case, without a division
    if not (low <= smallest and largest < 0.999 * VARIANCE_MAX_RATIO * smallest):
        _raise_variances(P, index, max(largest / VARIANCE_MAX_RATIO, low))


@kernel
def _raise_small_variances(ekf):
    P = ekf.P
    _raise_variances(P, state.ATTITUDE, ATTITUDE_VARIANCE_MIN)
    _raise_variances(P, state.VELOCITY, MOTION_VARIANCE_MIN)
    _raise_variances(P, state.POSITION, MOTION_VARIANCE_MIN)
    _raise_variances_of_group(P, state.GYRO_BIAS, BIAS_VARIANCE_MIN)
    _raise_variances_of_group(P, state.ACCEL_BIAS, BIAS_VARIANCE_MIN)
    if ekf.cs.mag:
        _raise_variances_of_group(P, state.MAG_EARTH, MAG_VARIANCE_MIN)
        _raise_variances_of_group(P, state.MAG_BODY, MAG_VARIANCE_MIN)
    if ekf.cs.wind:
        largest = max(P[state.WIND, state.WIND], P[state.WIND + 1, state.WIND + 1])
        low = max(largest / VARIANCE_MAX_RATIO, MOTION_VARIANCE_MIN)
        _raise_variance(P, state.WIND, low)
        _raise_variance(P, state.WIND + 1, low)
    _raise_variance(P, state.TERRAIN, 0.0)


@kernel
def _reduce_and_raise_variances(ekf):
    _reduce_excessive_variances(ekf)
    _raise_small_variances(ekf)


@kernel
def _clip_variance(P, index, low, high):
    P[index, index] = min(max(P[index, index], low), high)


@kernel
def _clip_variances(P, index, dof, low, high):
    for i in range(index, index + dof):
        _clip_variance(P, i, low, high)


@kernel
def _clip_variances_of_group(P, index, dof, low, high):
    """As `_clip_variances`, the largest of the group at most 10⁶ times the least."""
    largest = 0.0
    for i in range(index, index + dof):
        largest = max(largest, P[i, i])
    largest = min(max(largest, low), high)
    _clip_variances(P, index, dof, min(max(largest / VARIANCE_MAX_RATIO, low), high), largest)


@kernel
def _clip_all_variances(ekf):
    P = ekf.P
    _clip_variances(P, state.ATTITUDE, 3, ATTITUDE_VARIANCE_MIN, ATTITUDE_VARIANCE_MAX)
    _clip_variances(P, state.VELOCITY, 3, MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX)
    _clip_variances(P, state.POSITION, 3, MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX)
    _clip_variances_of_group(P, state.GYRO_BIAS, 3, BIAS_VARIANCE_MIN, BIAS_VARIANCE_MAX)
    _clip_variances_of_group(P, state.ACCEL_BIAS, 3, BIAS_VARIANCE_MIN, BIAS_VARIANCE_MAX)
    if ekf.cs.mag:
        _clip_variances_of_group(P, state.MAG_EARTH, 3, MAG_VARIANCE_MIN, MAG_VARIANCE_MAX)
        _clip_variances_of_group(P, state.MAG_BODY, 3, MAG_VARIANCE_MIN, MAG_VARIANCE_MAX)
    if ekf.cs.wind:
        _clip_variances_of_group(P, state.WIND, 2, MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX)


constrain_state_variances = by_release(_reduce_and_raise_variances, "clips_variances", _clip_all_variances)
"""Keep every variance within the limits of its group of states; `ekf.scratch.K` and `PH` are not kept."""


@kernel
def _hold_heading_and_constrain(ekf, params):
    """As v1.16's, after a heading that nothing observes was uncorrelated, with a bounded variance."""
    if is_heading_held(ekf):
        heading = state.ATTITUDE + 2
        bounded = min(ekf.P[heading, heading], params.EKF2_HEAD_NOISE * params.EKF2_HEAD_NOISE)
        reset_covariance_block(ekf, heading, 1, bounded)
    constrain_state_variances(ekf)


@kernel
def _constrain(ekf, params):
    constrain_state_variances(ekf)


constrain_covariance = by_release(_constrain, "holds_unobservable_heading", _hold_heading_and_constrain)
"""Keep the covariance within its limits, with what the parameters say of them."""


@kernel
def _limited(value, limit):
    return min(max(value, -limit), limit)


@kernel
def fuse(ekf, params, innovation):
    """Correct the state by -K·innovation, K of `ekf.scratch`, each part within its limits."""
    K = ekf.scratch.K
    north, east, down = K[state.ATTITUDE], K[state.ATTITUDE + 1], K[state.ATTITUDE + 2]
    rotate_by_earth_increment(ekf.q, -north * innovation, -east * innovation, -down * innovation)
    quat_to_dcm(ekf.q, ekf.R_to_earth)
    for i in range(3):
        ekf.vel[i] = _limited(ekf.vel[i] - K[state.VELOCITY + i] * innovation, VELOCITY_LIMIT)
        ekf.gyro_bias[i] = _limited(ekf.gyro_bias[i] - K[state.GYRO_BIAS + i] * innovation, params.EKF2_GYR_B_LIM)
        ekf.accel_bias[i] = _limited(ekf.accel_bias[i] - K[state.ACCEL_BIAS + i] * innovation, params.EKF2_ABL_LIM)
    add_to_position(
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
def _update_in_joseph_form(ekf, params, R, innovation):
    _update_covariance(ekf, R)
    fuse(ekf, params, innovation)
    constrain_covariance(ekf, params)
    return True


measurement_update = by_release(_update_in_joseph_form, "adds_quaternion_errors", update_by_gain)
"""Fuse a scalar observation whose `PH` and `K` stand in `ekf.scratch`, as `compute_kalman_gain` left them.

Entries of K that were set to zero stay zero; those of states that are not estimated are zeroed here. Takes `ekf`,
`params`, the observation's variance and its innovation, prediction less observation. Returns whether it was fused; in
v1.15 and since then an update cannot fail.
"""


@kernel
def _fuse_state_in_joseph_form(ekf, params, innovation, innovation_var, R, state_index):
    _observe_state(ekf, state_index)
    scale_kalman_gain(ekf, innovation_var)
    return _update_in_joseph_form(ekf, params, R, innovation)


fuse_direct_state = by_release(_fuse_state_in_joseph_form, "adds_quaternion_errors", update_by_state)
"""Fuse an observation of a single state: H is one at `state_index`.

Takes `ekf`, `params`, `innovation`, `innovation_var`, `R`, `state_index`. `innovation_var` sets the gain; sources that
clip or inflate it pass a value other than P + R.
"""
