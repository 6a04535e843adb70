"""Complementary filter that keeps the attitude of one model: gyro integration, tilt held by the accelerometer.

Method of Mahony, Hamel, Pflimlin, Nonlinear Complementary Filters on the Special Orthogonal Group, IEEE TAC 53 (2008),
with the gain faded out away from 1 g and, with a known airspeed, the centripetal acceleration of a coordinated turn
taken off.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import N_MODELS
from fusetune.ekf2.numerics.geodesy import ONE_G
from fusetune.ekf2.numerics.rotations import (
    dcm_to_quat,
    quat_aligning_with_up,
    quat_to_dcm,
    rotate_by_body_increment,
    update_yaw_in_rot_mat,
    wrap_pi,
)

TILT_GAIN = 0.2
"""From tilt error to gyro correction (1/s)."""

GYRO_BIAS_GAIN = 0.04
GYRO_BIAS_LIMIT = 0.05
BIAS_LEARNING_SPIN_LIMIT = math.radians(10.0)
ACCEL_LPF_GAIN = 10.0 * TILT_GAIN
ALIGNMENT_LOW, ALIGNMENT_HIGH = 0.9 * ONE_G, 1.1 * ONE_G
MIN_DT_S = 0.001


@kernel
def filter_acceleration(gsf, imu):
    """Low-pass the specific force (m/s², body) with a time constant of 1/10 of the tilt correction's."""
    coefficient = min(ACCEL_LPF_GAIN * imu.delta_vel_dt, 1.0)
    for axis in range(3):
        acceleration = imu.delta_vel[axis] / imu.delta_vel_dt
        gsf.accel_lpf[axis] = gsf.accel_lpf[axis] * (1.0 - coefficient) + acceleration * coefficient


@kernel
def try_align_tilt(gsf, imu):
    """Take the tilt from the accelerometer if the vehicle looks at rest (0.9–1.1 g, now and filtered)."""
    now = _norm(imu.delta_vel) / imu.delta_vel_dt
    filtered = _norm(gsf.accel_lpf)
    if not (ALIGNMENT_LOW < now < ALIGNMENT_HIGH and ALIGNMENT_LOW < filtered < ALIGNMENT_HIGH):
        return False
    for model in range(N_MODELS):
        quat_aligning_with_up(imu.delta_vel[0], imu.delta_vel[1], imu.delta_vel[2], gsf.q[model])
    gsf.tilt_aligned = True
    return True


@kernel
def align_yaw_of_attitudes(gsf):
    """Turn each model's attitude to the yaw of its velocity-and-yaw filter."""
    for model in range(N_MODELS):
        quat_to_dcm(gsf.q[model], gsf.R)
        update_yaw_in_rot_mat(wrap_pi(gsf.x[model, 2]), gsf.R, gsf.R_aligned)
        dcm_to_quat(gsf.R_aligned, gsf.q[model])


@kernel
def accel_fusion_gain(gsf):
    """Tilt correction gain (1/s): full at 1 g, nought at 0.5 g and 1.5 g, or 2 g where airspeed is known."""
    norm = _norm(gsf.accel_lpf)
    attenuation = 2.0
    if _knows_airspeed(gsf) and norm > ONE_G:
        attenuation = 1.0
    fade = 1.0 - min(attenuation * abs(norm - ONE_G) / ONE_G, 1.0)
    return TILT_GAIN * fade * fade


@kernel
def predict_attitude(gsf, model, imu, gain):
    """Propagate one model's attitude over an IMU sample; `gain` is `accel_fusion_gain`."""
    dt = imu.delta_ang_dt
    bias = gsf.gyro_bias[model]
    rate_dt = max(dt, MIN_DT_S)
    rate_x = imu.delta_ang[0] / rate_dt - bias[0]
    rate_y = imu.delta_ang[1] / rate_dt - bias[1]
    rate_z = imu.delta_ang[2] / rate_dt - bias[2]

    tilt_x, tilt_y, tilt_z = 0.0, 0.0, 0.0
    if gain > 0.0:
        tilt_x, tilt_y, tilt_z = _tilt_correction(gsf, model, rate_y, rate_z, gain)

    if math.sqrt(rate_x * rate_x + rate_y * rate_y + rate_z * rate_z) < BIAS_LEARNING_SPIN_LIMIT:
        bias[0] = _limited_bias(bias[0] - tilt_x * GYRO_BIAS_GAIN * dt)
        bias[1] = _limited_bias(bias[1] - tilt_y * GYRO_BIAS_GAIN * dt)
        bias[2] = _limited_bias(bias[2] - tilt_z * GYRO_BIAS_GAIN * dt)

    rotate_by_body_increment(
        gsf.q[model],
        imu.delta_ang[0] + (tilt_x - bias[0]) * dt,
        imu.delta_ang[1] + (tilt_y - bias[1]) * dt,
        imu.delta_ang[2] + (tilt_z - bias[2]) * dt,
    )


@kernel
def _tilt_correction(gsf, model, rate_y, rate_z, gain):
    """Rotation rate (rad/s, body) that turns the estimated down direction towards the measured one."""
    q = gsf.q[model]
    # the earth's down axis in the body frame: last row of the rotation matrix
    down_x = 2.0 * (q[1] * q[3] - q[0] * q[2])
    down_y = 2.0 * (q[2] * q[3] + q[0] * q[1])
    down_z = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3]
    acc_x, acc_y, acc_z = gsf.accel_lpf[0], gsf.accel_lpf[1], gsf.accel_lpf[2]
    scale = gain / _norm(gsf.accel_lpf)
    if _knows_airspeed(gsf):
        acc_y -= gsf.true_airspeed * rate_z
        acc_z += gsf.true_airspeed * rate_y
    return (
        (down_y * acc_z - down_z * acc_y) * scale,
        (down_z * acc_x - down_x * acc_z) * scale,
        (down_x * acc_y - down_y * acc_x) * scale,
    )


@kernel
def _knows_airspeed(gsf):
    return math.isfinite(gsf.true_airspeed) and gsf.true_airspeed > 1.2e-7


@kernel
def _limited_bias(bias):
    return min(max(bias, -GYRO_BIAS_LIMIT), GYRO_BIAS_LIMIT)


@kernel
def _norm(v):
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
