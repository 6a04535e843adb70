"""Covariance: initial values and block resets.

Mirrors PX4 v1.16 `EKF/covariance.cpp`, whose prediction and limits stand in `prediction.py` and
`measurement_update.py`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.covariance_blocks import (
    reset_covariance_block,
    uncorrelate_block,
    uncorrelate_set_variance_vector,
)
from fusetune.ekf2.filter.common.imu_rates import bias_unit
from fusetune.ekf2.filter.quaternion_core.quaternion_covariance import (
    tilt_variance_of_quaternion,
    yaw_variance_of_quaternion,
)
from fusetune.ekf2.filter.quaternion_core.quaternion_start import (
    initialise_quaternion_covariance,
    reset_quaternion_covariance,
)
from fusetune.ekf2.releases.by_release import by_release, does

__all__ = ["reset_covariance_block", "uncorrelate_block", "uncorrelate_set_variance_vector"]

INITIAL_WIND_UNCERTAINTY = 1.0

_filters_terrain_apart = does("filters_terrain_apart")


@kernel
def _reset_attitude_cov(ekf, params, yaw_noise):
    tilt_sigma = max(params.EKF2_ANGERR_INIT, 0.01)
    tilt_variance = tilt_sigma * tilt_sigma
    uncorrelate_set_variance_vector(ekf, state.ATTITUDE, tilt_variance, tilt_variance, yaw_noise * yaw_noise)


reset_quat_cov = by_release(_reset_attitude_cov, "adds_quaternion_errors", reset_quaternion_covariance)
"""Attitude variances at alignment: tilt from `EKF2_ANGERR_INIT`, yaw from `yaw_noise` (rad, one sigma)."""


@kernel
def reset_gyro_bias_cov(ekf, params):
    """Gyro bias variances as at switch-on."""
    reset_covariance_block(ekf, state.GYRO_BIAS, 3, (params.EKF2_GBIAS_INIT * bias_unit(ekf)) ** 2)


@kernel
def reset_gyro_bias_z_cov(ekf, params):
    """Variance of the gyro z bias as at switch-on, so that it converges anew."""
    reset_covariance_block(ekf, state.GYRO_BIAS + 2, 1, (params.EKF2_GBIAS_INIT * bias_unit(ekf)) ** 2)


@kernel
def reset_accel_bias_cov(ekf, params):
    """Accelerometer bias variances as at switch-on."""
    reset_covariance_block(ekf, state.ACCEL_BIAS, 3, (params.EKF2_ABIAS_INIT * bias_unit(ekf)) ** 2)


@kernel
def reset_gyro_bias(ekf, params):
    """Forget the gyro bias, as after a new gyro calibration."""
    for i in range(3):
        ekf.gyro_bias[i] = 0.0
    reset_gyro_bias_cov(ekf, params)


@kernel
def _keep_nothing(ekf):
    """v1.16 zeroes gains of what it does not learn, and keeps no variance."""


@kernel
def _keep_new_variance(ekf):
    for i in range(3):
        ekf.quaternion.kept_accel_bias_var[i] = ekf.P[state.ACCEL_BIAS + i, state.ACCEL_BIAS + i]


_keep_accel_bias_variance = by_release(_keep_nothing, "adds_quaternion_errors", _keep_new_variance)


@kernel
def reset_accel_bias(ekf, params):
    """Forget the accelerometer bias, as after a new accelerometer calibration."""
    for i in range(3):
        ekf.accel_bias[i] = 0.0
    reset_accel_bias_cov(ekf, params)
    _keep_accel_bias_variance(ekf)


@kernel
def reset_mag_earth_cov(ekf, params):
    """Earth field variances at the start of magnetometer fusion."""
    reset_covariance_block(ekf, state.MAG_EARTH, 3, params.EKF2_MAG_NOISE**2)


@kernel
def reset_mag_bias_cov(ekf, params):
    """Body field variances at the start of magnetometer fusion."""
    reset_covariance_block(ekf, state.MAG_BODY, 3, params.EKF2_MAG_NOISE**2)


@kernel
def reset_wind_cov(ekf):
    """Wind variances before anything is known of the wind."""
    reset_covariance_block(ekf, state.WIND, 2, INITIAL_WIND_UNCERTAINTY**2)


@kernel
def _initialise_error_covariance(ekf, params):
    """The yaw starts without uncertainty: zero-velocity and fake-position fusion level finer that way."""
    P = ekf.P
    for i in range(state.ERROR_STATE_SIZE):
        for j in range(state.ERROR_STATE_SIZE):
            P[i, j] = 0.0
    reset_quat_cov(ekf, params, 0.0)
    vel_var = max(params.EKF2_GPS_V_NOISE, 0.01) ** 2
    uncorrelate_set_variance_vector(ekf, state.VELOCITY, vel_var, vel_var, 1.5**2 * vel_var)
    xy_var = max(params.EKF2_GPS_P_NOISE, 0.01) ** 2
    z_var = max(params.EKF2_BARO_NOISE, 0.01) ** 2
    if ekf.cs.gps_hgt:
        z_var = max(1.5 * params.EKF2_GPS_P_NOISE, 0.01) ** 2
    if ekf.cs.rng_hgt:
        z_var = max(params.EKF2_RNG_NOISE, 0.01) ** 2
    uncorrelate_set_variance_vector(ekf, state.POSITION, xy_var, xy_var, z_var)
    reset_gyro_bias_cov(ekf, params)
    reset_accel_bias_cov(ekf, params)
    reset_mag_earth_cov(ekf, params)
    reset_mag_bias_cov(ekf, params)
    reset_wind_cov(ekf)
    if not _filters_terrain_apart(ekf):
        reset_covariance_block(ekf, state.TERRAIN, 1, params.EKF2_MIN_RNG**2)


initialise_covariance = by_release(
    _initialise_error_covariance, "adds_quaternion_errors", initialise_quaternion_covariance
)
"""Covariance after tilt alignment, or after a numerical fault."""


@kernel
def _tilt_error_variance(ekf):
    return ekf.P[state.ATTITUDE, state.ATTITUDE] + ekf.P[state.ATTITUDE + 1, state.ATTITUDE + 1]


tilt_variance = by_release(_tilt_error_variance, "adds_quaternion_errors", tilt_variance_of_quaternion)
"""Sum of the variances (rad²) of the attitude error about north and east."""


@kernel
def _yaw_error_variance(ekf):
    return ekf.P[state.ATTITUDE + 2, state.ATTITUDE + 2]


yaw_variance = by_release(_yaw_error_variance, "adds_quaternion_errors", yaw_variance_of_quaternion)
"""Variance (rad²) of the attitude error about down."""
