"""Which IMU bias states may be learnt in this update.

Mirrors `updateIMUBiasInhibit` of PX4 v1.16 `EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_mask import MASK_INHIBIT_ACCEL_BIAS
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_ACCEL_BIAS, IMU_CTRL_GYRO_BIAS
from fusetune.ekf2.filter.common.imu_rates import body_rate, measured_force, measured_rate, specific_force
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, GYRO_BIAS
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
def _inhibit_gains(ekf, params):
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


@kernel
def _follow_motion_by_mean_interval(ekf, params):
    """Envelopes of rate and specific force, and the low-passed force, of increments over the mean interval."""
    imu, core = ekf.imu_delayed, ekf.quaternion
    dt, tau = core.mean_dt, params.EKF2_ABL_TAU
    rate = imu.delta_ang[0] / dt, imu.delta_ang[1] / dt, imu.delta_ang[2] / dt
    force = imu.delta_vel[0] / dt, imu.delta_vel[1] / dt, imu.delta_vel[2] / dt
    ekf.ang_rate_magnitude_filt = _decaying_maximum(ekf.ang_rate_magnitude_filt, rate, dt, tau)
    ekf.accel_magnitude_filt = _decaying_maximum(ekf.accel_magnitude_filt, force, dt, tau)
    alpha = min(max(dt / tau, 0.0), 1.0)
    for i in range(3):
        core.mean_force[i] = alpha * force[i] + (1.0 - alpha) * core.mean_force[i]
    return ekf.ang_rate_magnitude_filt > params.EKF2_ABL_GYRLIM or ekf.accel_magnitude_filt > params.EKF2_ABL_ACCLIM


@kernel
def _inhibit_and_keep_variances(ekf, params):
    """As v1.16; the variance of an axis that is not learnt is kept, and put back when it is again."""
    manoeuvring = _follow_motion_by_mean_interval(ekf, params)
    P, core, imu_ctrl = ekf.P, ekf.quaternion, int(params.EKF2_IMU_CTRL)
    inhibit_gyro = (imu_ctrl & IMU_CTRL_GYRO_BIAS) == 0
    inhibit_accel = (imu_ctrl & IMU_CTRL_ACCEL_BIAS) == 0 or manoeuvring or ekf.fs.bad_acc_vertical
    for i in range(3):
        unlearnt = inhibit_accel or ekf.imu_delayed.delta_vel_clipping[i] or not _is_accel_bias_observable(ekf, i)
        _switch_learning(P, GYRO_BIAS, i, inhibit_gyro, ekf.gyro_bias_inhibit, core.kept_gyro_bias_var)
        _switch_learning(P, ACCEL_BIAS, i, unlearnt, ekf.accel_bias_inhibit, core.kept_accel_bias_var)


@kernel
def _inhibit_by_manoeuvre(ekf, params):
    """The gyro's bias is always learnt, the accelerometer's also at rest and without aiding."""
    manoeuvring = _follow_motion_by_mean_interval(ekf, params)
    P, core = ekf.P, ekf.quaternion
    inhibit_accel = (int(params.EKF2_AID_MASK) & MASK_INHIBIT_ACCEL_BIAS) != 0 or manoeuvring or ekf.fs.bad_acc_vertical
    for i in range(3):
        unlearnt = inhibit_accel or ekf.imu_delayed.delta_vel_clipping[i] != 0
        _switch_learning(P, ACCEL_BIAS, i, unlearnt, ekf.accel_bias_inhibit, core.kept_accel_bias_var)


@kernel
def _switch_learning(P, first, axis, is_unlearnt, inhibit, kept):
    index = first + axis
    if is_unlearnt:
        if not inhibit[axis]:
            kept[axis] = P[index, index]
            inhibit[axis] = 1
    elif inhibit[axis]:
        P[index, index] = kept[axis]
        inhibit[axis] = 0


update_imu_bias_inhibit = by_release(
    _inhibit_gains,
    "adds_quaternion_errors",
    by_release(_inhibit_and_keep_variances, "learns_gyro_bias_always", _inhibit_by_manoeuvre),
)
"""Set `gyro_bias_inhibit` and `accel_bias_inhibit` per axis.

The accelerometer bias is not learnt while the vehicle manoeuvres hard (EKF2_ABL_…), the axis clips or the vertical
acceleration is bad; without any aiding, only along axes that gravity makes observable.
"""
