"""Limits of covariance and state.

Mirrors `fixCovarianceErrors` of PX4 v1.14 `EKF/covariance.cpp` and `constrainStates` of `EKF/ekf_helper.cpp`. Where PX4
forces symmetry, the covariance is symmetric here: every update writes both halves alike.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.accel_bias_doubt import (
    DOUBT_BEFORE_RESET_US,
    SHARE_OF_LIMIT,
    contradicts_height,
    contradicts_vertical_velocity,
    down_accel_bias,
)
from fusetune.ekf2.filter.common.covariance_blocks import uncorrelate_block, zero_covariance_block
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3
from fusetune.ekf2.numerics.constants import ONE_G

VARIANCE_MAX = 1.0
MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX = 1e-6, 1e6
ACCEL_BIAS_VARIANCE_SAFE, ACCEL_BIAS_VARIANCE_MIN, ACCEL_BIAS_VARIANCE_RATIO = 1e-9, 5e-8, 0.01
ACCEL_BIAS_UNCERTAINTY_MAX = 0.1 * ONE_G

MAG_EARTH_LIMIT, MAG_BIAS_LIMIT, WIND_LIMIT = 1.0, 0.5, 100.0


@kernel
def _clip(ekf, index, low, high):
    """Written only where it is beyond: the usual case costs two comparisons."""
    variance = ekf.P[index, index]
    if variance < low:
        ekf.P[index, index] = low
    elif variance > high:
        ekf.P[index, index] = high


@kernel
def _clip_three(ekf, index, low, high):
    _clip(ekf, index, low, high)
    _clip(ekf, index + 1, low, high)
    _clip(ekf, index + 2, low, high)


@kernel
def limit_covariance(ekf, params):
    """Keep variances within their limits, and those of what is not estimated at zero."""
    _clip_three(ekf, state.ATTITUDE, 0.0, VARIANCE_MAX)
    _clip(ekf, Q3, 0.0, VARIANCE_MAX)
    _clip_three(ekf, state.VELOCITY, MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX)
    _clip_three(ekf, state.POSITION, MOTION_VARIANCE_MIN, MOTION_VARIANCE_MAX)
    _clip_three(ekf, state.GYRO_BIAS, 0.0, VARIANCE_MAX)
    inhibit = ekf.accel_bias_inhibit
    if not (inhibit[0] and inhibit[1] and inhibit[2]):
        _limit_accel_bias(ekf)
        _check_accel_bias(ekf, params)
    if ekf.cs.mag_3d:
        _clip_three(ekf, state.MAG_EARTH, 0.0, VARIANCE_MAX)
        _clip_three(ekf, state.MAG_BODY, 0.0, VARIANCE_MAX)
    elif _is_any_left(ekf, state.MAG_EARTH) or _is_any_left(ekf, state.MAG_BODY):
        zero_covariance_block(ekf, state.MAG_EARTH, 6)
    if ekf.cs.wind:
        _clip(ekf, state.WIND, 0.0, MOTION_VARIANCE_MAX)
        _clip(ekf, state.WIND + 1, 0.0, MOTION_VARIANCE_MAX)
    elif ekf.P[state.WIND, state.WIND] != 0.0 or ekf.P[state.WIND + 1, state.WIND + 1] != 0.0:
        zero_covariance_block(ekf, state.WIND, 2)


@kernel
def _is_any_left(ekf, index):
    P = ekf.P
    return P[index, index] != 0.0 or P[index + 1, index + 1] != 0.0 or P[index + 2, index + 2] != 0.0


@kernel
def _limit_accel_bias(ekf):
    """Of the axes that are learnt: none of less than a hundredth of the largest variance, nor above 0.1 g."""
    P, inhibit = ekf.P, ekf.accel_bias_inhibit
    largest, is_unsafe = ACCEL_BIAS_VARIANCE_SAFE, False
    for i in range(3):
        variance = P[state.ACCEL_BIAS + i, state.ACCEL_BIAS + i]
        if not inhibit[i]:
            if variance > largest:
                largest = variance
            elif variance < ACCEL_BIAS_VARIANCE_SAFE:
                is_unsafe = True
    low = max(ACCEL_BIAS_VARIANCE_RATIO * largest, ACCEL_BIAS_VARIANCE_MIN)
    deviation = ACCEL_BIAS_UNCERTAINTY_MAX * ekf.quaternion.mean_dt
    for i in range(3):
        if not inhibit[i]:
            _clip(ekf, state.ACCEL_BIAS + i, low, deviation * deviation)
    if is_unsafe:
        uncorrelate_block(ekf, state.ACCEL_BIAS, 3)


@kernel
def _check_accel_bias(ekf, params):
    """Uncorrelate a bias near its limit that height and vertical velocity have contradicted for 7 s."""
    core = ekf.quaternion
    down_bias = down_accel_bias(ekf)
    doubtful = (
        abs(down_bias) > SHARE_OF_LIMIT * params.EKF2_ABL_LIM * core.mean_dt
        and contradicts_vertical_velocity(ekf, down_bias, ekf.cs.ev_vel)
        and contradicts_height(ekf, down_bias)
    )
    if not doubtful:
        core.time_accel_bias_passed = ekf.time_delayed_us
    if is_timed_out(ekf, core.time_accel_bias_passed, DOUBT_BEFORE_RESET_US):
        uncorrelate_block(ekf, state.ACCEL_BIAS, 3)
        core.time_accel_bias_passed = ekf.time_delayed_us


@kernel
def _limited(value, limit):
    return min(max(value, -limit), limit)


@kernel
def limit_states(ekf, gyro_bias_limit, accel_bias_limit):
    """Keep what fusions have moved within limits (rad/s, m/s² of the biases), once per prediction."""
    dt = ekf.quaternion.mean_dt
    for i in range(3):
        ekf.gyro_bias[i] = _limited(ekf.gyro_bias[i], gyro_bias_limit * dt)
        ekf.accel_bias[i] = _limited(ekf.accel_bias[i], accel_bias_limit * dt)
        ekf.mag_I[i] = _limited(ekf.mag_I[i], MAG_EARTH_LIMIT)
        ekf.mag_B[i] = _limited(ekf.mag_B[i], MAG_BIAS_LIMIT)
    ekf.wind_vel[0] = _limited(ekf.wind_vel[0], WIND_LIMIT)
    ekf.wind_vel[1] = _limited(ekf.wind_vel[1], WIND_LIMIT)
