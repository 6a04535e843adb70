"""Covariance: initial values and block resets.

Mirrors PX4 v1.16 `EKF/covariance.cpp`, whose prediction and limits stand in `prediction.py` and
`measurement_update.py`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.releases.by_release import does

INITIAL_WIND_UNCERTAINTY = 1.0

_filters_terrain_apart = does("filters_terrain_apart")


@kernel
def uncorrelate_block(ekf, index, dof):
    """Zero every covariance of the states [index, index + dof), among themselves and with the others."""
    P = ekf.P
    for i in range(index, index + dof):
        variance = P[i, i]
        for j in range(state.ERROR_STATE_SIZE):
            P[i, j] = 0.0
            P[j, i] = 0.0
        P[i, i] = variance


@kernel
def reset_covariance_block(ekf, index, dof, variance):
    """Uncorrelate the states [index, index + dof) and give them all the same variance."""
    uncorrelate_block(ekf, index, dof)
    for i in range(index, index + dof):
        ekf.P[i, i] = variance


@kernel
def uncorrelate_set_variance_vector(ekf, index, v0, v1, v2):
    """Uncorrelate three states from `index` on and set their variances."""
    uncorrelate_block(ekf, index, 3)
    ekf.P[index, index] = v0
    ekf.P[index + 1, index + 1] = v1
    ekf.P[index + 2, index + 2] = v2


@kernel
def reset_quat_cov(ekf, params, yaw_noise):
    """Attitude variances at alignment: tilt from `EKF2_ANGERR_INIT`, yaw from `yaw_noise` (rad, one sigma)."""
    tilt_sigma = max(params.EKF2_ANGERR_INIT, 0.01)
    tilt_variance = tilt_sigma * tilt_sigma
    uncorrelate_set_variance_vector(ekf, state.ATTITUDE, tilt_variance, tilt_variance, yaw_noise * yaw_noise)


@kernel
def reset_gyro_bias_cov(ekf, params):
    """Gyro bias variances as at switch-on."""
    reset_covariance_block(ekf, state.GYRO_BIAS, 3, params.EKF2_GBIAS_INIT**2)


@kernel
def reset_gyro_bias_z_cov(ekf, params):
    """Variance of the gyro z bias as at switch-on, so that it converges anew."""
    reset_covariance_block(ekf, state.GYRO_BIAS + 2, 1, params.EKF2_GBIAS_INIT**2)


@kernel
def reset_accel_bias_cov(ekf, params):
    """Accelerometer bias variances as at switch-on."""
    reset_covariance_block(ekf, state.ACCEL_BIAS, 3, params.EKF2_ABIAS_INIT**2)


@kernel
def reset_gyro_bias(ekf, params):
    """Forget the gyro bias, as after a new gyro calibration."""
    for i in range(3):
        ekf.gyro_bias[i] = 0.0
    reset_gyro_bias_cov(ekf, params)


@kernel
def reset_accel_bias(ekf, params):
    """Forget the accelerometer bias, as after a new accelerometer calibration."""
    for i in range(3):
        ekf.accel_bias[i] = 0.0
    reset_accel_bias_cov(ekf, params)


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
def initialise_covariance(ekf, params):
    """Covariance after tilt alignment, or after a numerical fault.

    The yaw starts without uncertainty: zero-velocity and fake-position fusion level finer that way.
    """
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


@kernel
def tilt_variance(ekf):
    """Sum of the variances (rad²) of the attitude error about north and east."""
    return ekf.P[state.ATTITUDE, state.ATTITUDE] + ekf.P[state.ATTITUDE + 1, state.ATTITUDE + 1]


@kernel
def yaw_variance(ekf):
    """Variance (rad²) of the attitude error about down."""
    return ekf.P[state.ATTITUDE + 2, state.ATTITUDE + 2]
