"""Covariance at the start, and after numerical faults.

Mirrors `initialiseCovariance` and `resetQuatCov` of PX4 v1.14 `EKF/covariance.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.covariance_blocks import reset_covariance_block, uncorrelate_set_variance_vector
from fusetune.ekf2.filter.quaternion_core.field_covariance import save_field_covariance
from fusetune.ekf2.filter.quaternion_core.quaternion_covariance import add_yaw_variance, set_quaternion_covariance
from fusetune.ekf2.releases.by_release import does

INITIAL_WIND_VARIANCE = 1.0
LAST_MAG_TYPE_OF_HEADING = 2
LEAST_HEADING_NOISE = 0.01

_adds_heading_uncertainty_once = does("starts_with_samples")


@kernel
def reset_quaternion_covariance(ekf, params, yaw_noise):
    """As uncertain as at the start; the yaw more so where the magnetometer is to tell it."""
    set_quaternion_covariance(ekf, params.EKF2_ANGERR_INIT * params.EKF2_ANGERR_INIT)
    if not _adds_heading_uncertainty_once(ekf):
        add_heading_uncertainty(ekf, params)


@kernel
def add_heading_uncertainty(ekf, params):
    """Add what a magnetic heading is uncertain by."""
    if int(params.EKF2_MAG_TYPE) <= LAST_MAG_TYPE_OF_HEADING:
        noise = max(params.EKF2_HEAD_NOISE, LEAST_HEADING_NOISE)
        add_yaw_variance(ekf, noise * noise)


@kernel
def initialise_quaternion_covariance(ekf, params):
    """Covariance after levelling."""
    P, core, dt = ekf.P, ekf.quaternion, ekf.quaternion.mean_dt
    for i in range(state.ERROR_STATE_SIZE):
        for j in range(state.ERROR_STATE_SIZE):
            P[i, j] = 0.0
    reset_quaternion_covariance(ekf, params, 0.0)
    velocity = max(params.EKF2_GPS_V_NOISE, 0.01) ** 2
    uncorrelate_set_variance_vector(ekf, state.VELOCITY, velocity, velocity, 1.5**2 * velocity)
    horizontal = max(params.EKF2_GPS_P_NOISE, 0.01) ** 2
    vertical = max(params.EKF2_BARO_NOISE, 0.01) ** 2
    if ekf.cs.gps_hgt:
        vertical = max(1.5 * params.EKF2_GPS_P_NOISE, 0.01) ** 2
    if ekf.cs.rng_hgt:
        vertical = max(params.EKF2_RNG_NOISE, 0.01) ** 2
    uncorrelate_set_variance_vector(ekf, state.POSITION, horizontal, horizontal, vertical)
    gyro, accel = (params.EKF2_GBIAS_INIT * dt) ** 2, (params.EKF2_ABIAS_INIT * dt) ** 2
    reset_covariance_block(ekf, state.GYRO_BIAS, 3, gyro)
    reset_covariance_block(ekf, state.ACCEL_BIAS, 3, accel)
    for i in range(3):
        core.kept_gyro_bias_var[i] = gyro
        core.kept_accel_bias_var[i] = accel
    reset_covariance_block(ekf, state.MAG_EARTH, 6, params.EKF2_MAG_NOISE * params.EKF2_MAG_NOISE)
    ekf.field_history.declination_fused = False
    save_field_covariance(ekf)
    reset_covariance_block(ekf, state.WIND, 2, INITIAL_WIND_VARIANCE)
