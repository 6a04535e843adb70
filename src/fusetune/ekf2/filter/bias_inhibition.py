"""Which IMU bias states may be learnt in this update.

Mirrors `updateIMUBiasInhibit` of PX4 v1.16 `EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_ACCEL_BIAS, IMU_CTRL_GYRO_BIAS
from fusetune.ekf2.filter.common.imu_rates import body_rate, measured_force, measured_rate, specific_force
from fusetune.ekf2.releases.by_release import by_release

COSINE_OF_15_DEGREES = 0.966


@kernel
def _decaying_maximum(previous, vector, dt, time_constant):
    """Envelope of a vector's length: rises at once, decays with the time constant (s)."""
    x, y, z = vector
    decay = 1.0 - min(max(dt / time_constant, 0.0), 1.0)
    return max(math.sqrt(x * x + y * y + z * z), decay * previous)


@kernel
def _motion(ekf):
    return body_rate(ekf), specific_force(ekf)


@kernel
def _measured_motion(ekf):
    return measured_rate(ekf), measured_force(ekf)


_judged_motion = by_release(_motion, "judges_measured_motion", _measured_motion)
"""Rate (rad/s) and specific force (m/s²) that tell whether the vehicle manoeuvres."""


@kernel
def update_imu_bias_inhibit(ekf, params):
    """Set `gyro_bias_inhibit` and `accel_bias_inhibit` per axis.

    The accelerometer bias is not learnt while the vehicle manoeuvres hard (EKF2_ABL_…), the axis clips or the
    vertical acceleration is bad; without any aiding, only along axes that gravity makes observable.
    """
    imu = ekf.imu_delayed
    tau = params.EKF2_ABL_TAU
    rate, force = _judged_motion(ekf)
    ekf.ang_rate_magnitude_filt = _decaying_maximum(ekf.ang_rate_magnitude_filt, rate, imu.delta_ang_dt, tau)
    ekf.accel_magnitude_filt = _decaying_maximum(ekf.accel_magnitude_filt, force, imu.delta_vel_dt, tau)
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
def _by_fake_position(ekf):
    return ekf.cs.fake_pos


@kernel
def _by_fake_position_or_gravity(ekf):
    return ekf.cs.fake_pos or ekf.cs.gravity_vector


_is_only_tilt_held = by_release(_by_fake_position, "yields_to_gravity", _by_fake_position_or_gravity)


@kernel
def _is_accel_bias_observable(ekf, axis):
    if ekf.cs.vehicle_at_rest:
        return True
    if ekf.cs.fake_hgt:
        return False
    if _is_only_tilt_held(ekf):
        return abs(ekf.R_to_earth[2, axis]) > COSINE_OF_15_DEGREES
    return True
