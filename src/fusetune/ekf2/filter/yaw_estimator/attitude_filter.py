"""Complementary filter that keeps the attitude of each model: gyro integration, tilt held by the accelerometer.

Method of Mahony, Hamel, Pflimlin, Nonlinear Complementary Filters on the Special Orthogonal Group, IEEE TAC 53 (2008),
with the gain faded out away from 1 g and, with a known airspeed, the centripetal acceleration of a coordinated turn
taken off.

Mirrors the attitude part of PX4 v1.16 `EKF/yaw_estimator/EKFGSF_yaw.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import LANES, N_MODELS
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.numerics.rotations import (
    SMALL_ANGLE_SQUARED,
    dcm_to_quat,
    kept_unit_length,
    quat_aligning_with_up,
    quat_product,
    quat_to_dcm,
    rotation_vector_to_quat,
    small_rotation_to_quat,
    unit_length,
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
    now = length_of(imu.delta_vel) / imu.delta_vel_dt
    filtered = length_of(gsf.accel_lpf)
    if not (ALIGNMENT_LOW < now < ALIGNMENT_HIGH and ALIGNMENT_LOW < filtered < ALIGNMENT_HIGH):
        return False
    quat_aligning_with_up(imu.delta_vel[0], imu.delta_vel[1], imu.delta_vel[2], gsf.q_aligned)
    for i in range(4):
        gsf.q[i, :] = gsf.q_aligned[i]
    gsf.tilt_aligned = True
    return True


@kernel
def attitude(gsf, model):
    """Quaternion of one model."""
    return gsf.q[0, model], gsf.q[1, model], gsf.q[2, model], gsf.q[3, model]


@kernel
def set_attitude(gsf, model, q):
    """Give one model an attitude, a tuple of four."""
    gsf.q[0, model], gsf.q[1, model], gsf.q[2, model], gsf.q[3, model] = q


@kernel
def align_yaw_of_attitudes(gsf):
    """Turn each model's attitude to the yaw of its velocity-and-yaw filter."""
    q = gsf.q_aligned
    for model in range(N_MODELS):
        q[0], q[1], q[2], q[3] = attitude(gsf, model)
        quat_to_dcm(q, gsf.R)
        update_yaw_in_rot_mat(wrap_pi(gsf.x[2, model]), gsf.R, gsf.R_aligned)
        dcm_to_quat(gsf.R_aligned, q)
        set_attitude(gsf, model, (q[0], q[1], q[2], q[3]))


@kernel
def accel_fusion_gain(gsf):
    """Tilt correction gain (1/s): full at 1 g, nought at 0.5 g and 1.5 g, or 2 g where airspeed is known."""
    norm = length_of(gsf.accel_lpf)
    attenuation = 2.0
    if knows_airspeed(gsf) and norm > ONE_G:
        attenuation = 1.0
    fade = 1.0 - min(attenuation * abs(norm - ONE_G) / ONE_G, 1.0)
    return TILT_GAIN * fade * fade


@kernel
def predict_attitudes(gsf, imu, gain):
    """Propagate the attitudes of all models over an IMU sample; `gain` is `accel_fusion_gain`."""
    _correct_rotations(gsf, imu, gain)
    small = True
    for model in range(LANES):
        small = small and gsf.rotation_squared[model] < SMALL_ANGLE_SQUARED
    if small:
        _rotate_a_little(gsf)
        return
    for model in range(LANES):
        turn = rotation_vector_to_quat(gsf.rotation[0, model], gsf.rotation[1, model], gsf.rotation[2, model])
        w, x, y, z = quat_product(attitude(gsf, model), turn)
        set_attitude(gsf, model, unit_length(w, x, y, z))


@kernel
def _correct_rotations(gsf, imu, gain):
    """Learn the gyro biases and set `gsf.rotation`: the sample's, less the bias, and towards the measured vertical."""
    dt = imu.delta_ang_dt
    rate_dt = max(dt, MIN_DT_S)
    turn_x, turn_y, turn_z = imu.delta_ang[0], imu.delta_ang[1], imu.delta_ang[2]
    measured_x, measured_y, measured_z = turn_x / rate_dt, turn_y / rate_dt, turn_z / rate_dt
    force_x, force_y, force_z = gsf.accel_lpf[0], gsf.accel_lpf[1], gsf.accel_lpf[2]
    scale = gain / length_of(gsf.accel_lpf) if gain > 0.0 else 0.0
    airspeed = gsf.true_airspeed if knows_airspeed(gsf) else 0.0
    for model in range(LANES):
        bias_x, bias_y, bias_z = gsf.gyro_bias[0, model], gsf.gyro_bias[1, model], gsf.gyro_bias[2, model]
        rate_x, rate_y, rate_z = measured_x - bias_x, measured_y - bias_y, measured_z - bias_z
        w, x, y, z = attitude(gsf, model)
        # the earth's down axis in the body frame: last row of the rotation matrix
        down_x = 2.0 * (x * z - w * y)
        down_y = 2.0 * (y * z + w * x)
        down_z = w * w - x * x - y * y + z * z
        side = force_y - airspeed * rate_z
        along = force_z + airspeed * rate_y
        tilt_x = (down_y * along - down_z * side) * scale
        tilt_y = (down_z * force_x - down_x * along) * scale
        tilt_z = (down_x * side - down_y * force_x) * scale

        learns = rate_x * rate_x + rate_y * rate_y + rate_z * rate_z < BIAS_LEARNING_SPIN_LIMIT**2
        bias_x = limited_bias(bias_x - tilt_x * GYRO_BIAS_GAIN * dt) if learns else bias_x
        bias_y = limited_bias(bias_y - tilt_y * GYRO_BIAS_GAIN * dt) if learns else bias_y
        bias_z = limited_bias(bias_z - tilt_z * GYRO_BIAS_GAIN * dt) if learns else bias_z
        gsf.gyro_bias[0, model], gsf.gyro_bias[1, model], gsf.gyro_bias[2, model] = bias_x, bias_y, bias_z

        rotation_x = turn_x + (tilt_x - bias_x) * dt
        rotation_y = turn_y + (tilt_y - bias_y) * dt
        rotation_z = turn_z + (tilt_z - bias_z) * dt
        gsf.rotation[0, model], gsf.rotation[1, model], gsf.rotation[2, model] = rotation_x, rotation_y, rotation_z
        gsf.rotation_squared[model] = rotation_x * rotation_x + rotation_y * rotation_y + rotation_z * rotation_z


@kernel
def _rotate_a_little(gsf):
    """Apply `gsf.rotation` where that of every model is small: `rotate_by_body_increment` of all at once."""
    for model in range(LANES):
        turn = small_rotation_to_quat(
            gsf.rotation[0, model], gsf.rotation[1, model], gsf.rotation[2, model], gsf.rotation_squared[model]
        )
        w, x, y, z = quat_product(attitude(gsf, model), turn)
        set_attitude(gsf, model, kept_unit_length(w, x, y, z))


@kernel
def knows_airspeed(gsf):
    """Whether a true airspeed has been given."""
    return math.isfinite(gsf.true_airspeed) and gsf.true_airspeed > 1.2e-7


@kernel
def limited_bias(bias):
    """A gyro bias (rad/s) within its limits."""
    return min(max(bias, -GYRO_BIAS_LIMIT), GYRO_BIAS_LIMIT)


@kernel
def length_of(v):
    """Length of a vector of three."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
