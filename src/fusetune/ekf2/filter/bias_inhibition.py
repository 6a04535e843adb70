"""Which IMU bias states may be learnt in this update."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_ACCEL_BIAS, IMU_CTRL_GYRO_BIAS

COSINE_OF_15_DEGREES = 0.966


@kernel
def _decaying_maximum(previous, x, y, z, dt, time_constant):
    """Envelope of a vector's length: rises at once, decays with the time constant (s)."""
    decay = 1.0 - min(max(dt / time_constant, 0.0), 1.0)
    return max(math.sqrt(x * x + y * y + z * z), decay * previous)


@kernel
def update_imu_bias_inhibit(ekf, params):
    """Set `gyro_bias_inhibit` and `accel_bias_inhibit` per axis.

    The accelerometer bias is not learnt while the vehicle manoeuvres hard (EKF2_ABL_…), the axis clips or the
    vertical acceleration is bad; without any aiding, only along axes that gravity makes observable.
    """
    imu = ekf.imu_delayed
    ekf.ang_rate_magnitude_filt = _decaying_maximum(
        ekf.ang_rate_magnitude_filt,
        imu.delta_ang[0] / imu.delta_ang_dt - ekf.gyro_bias[0],
        imu.delta_ang[1] / imu.delta_ang_dt - ekf.gyro_bias[1],
        imu.delta_ang[2] / imu.delta_ang_dt - ekf.gyro_bias[2],
        imu.delta_ang_dt,
        params.EKF2_ABL_TAU,
    )
    ekf.accel_magnitude_filt = _decaying_maximum(
        ekf.accel_magnitude_filt,
        imu.delta_vel[0] / imu.delta_vel_dt - ekf.accel_bias[0],
        imu.delta_vel[1] / imu.delta_vel_dt - ekf.accel_bias[1],
        imu.delta_vel[2] / imu.delta_vel_dt - ekf.accel_bias[2],
        imu.delta_vel_dt,
        params.EKF2_ABL_TAU,
    )
    manoeuvring = (
        ekf.ang_rate_magnitude_filt > params.EKF2_ABL_GYRLIM or ekf.accel_magnitude_filt > params.EKF2_ABL_ACCLIM
    )
    imu_ctrl = int(params.EKF2_IMU_CTRL)
    inhibit_gyro = (imu_ctrl & IMU_CTRL_GYRO_BIAS) == 0
    inhibit_accel = (imu_ctrl & IMU_CTRL_ACCEL_BIAS) == 0 or manoeuvring or ekf.fs.bad_acc_vertical
    for i in range(3):
        ekf.gyro_bias_inhibit[i] = inhibit_gyro
        ekf.accel_bias_inhibit[i] = inhibit_accel or imu.delta_vel_clipping[i] or not _is_accel_bias_observable(ekf, i)


@kernel
def _is_accel_bias_observable(ekf, axis):
    if ekf.cs.vehicle_at_rest:
        return True
    if ekf.cs.fake_hgt:
        return False
    if ekf.cs.fake_pos:
        return abs(ekf.R_to_earth[2, axis]) > COSINE_OF_15_DEGREES
    return True
