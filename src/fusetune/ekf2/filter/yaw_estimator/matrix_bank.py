"""The yaw estimator of v1.15 and before: attitudes as rotation matrices, which a small rotation turns to first order.

Each row r of a matrix becomes r + r × g for a rotation vector g (rad, body), and is brought back to unit length by one
step of Newton's method. Where an innovation is beyond 5 σ, only what it does to the state is shortened: the model is
weighed by all of it. Models that all weigh next to nothing are given up together.

Mirrors PX4 v1.15 `EKF/yaw_estimator/EKFGSF_yaw.cpp`, and where behaviours say so v1.14 and v1.13 `EKF/EKFGSF_yaw.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.imu_rates import gyro_bias
from fusetune.ekf2.filter.yaw_estimator.attitude_filter import (
    ALIGNMENT_HIGH,
    ALIGNMENT_LOW,
    BIAS_LEARNING_SPIN_LIMIT,
    GYRO_BIAS_GAIN,
    MIN_DT_S,
    accel_fusion_gain,
    filter_acceleration,
    knows_airspeed,
    length_of,
    limited_bias,
)
from fusetune.ekf2.filter.yaw_estimator.gaussian_sum import MIN_WEIGHT, combine_yaw
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import (
    LANES,
    N_MODELS,
    P_VE_VE,
    P_VE_YAW,
    P_VN_VE,
    P_VN_VN,
    P_VN_YAW,
    P_YAW_YAW,
    reset_gsf,
)
from fusetune.ekf2.filter.yaw_estimator.velocity_yaw_filter import (
    ACCEL_NOISE,
    GYRO_NOISE,
    MIN_VARIANCE,
    NIS_LIMIT,
    correct_covariance,
    gaussian_density,
    initialise_models,
)
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.numerics.rotations import euler_yaw, update_yaw_in_rot_mat, wrap_pi
from fusetune.ekf2.releases.by_release import by_release

MATRIX_BANK = np.dtype([("R", "f8", (3, 3, LANES))], align=True)
"""Sub-record `ekf.yaw_matrices`: of each model the rotation from body to NED; the last index is the model."""

YAW_VELOCITY = np.dtype([*fields("f8", "north", "east", "accuracy"), ("is_new", "?")], align=True)
"""Sub-record `ekf.yaw_velocity`, until v1.14: a velocity (m/s) that the bank is yet to fuse."""


@kernel
def initialise_matrix_bank(bank):
    """What is not zero at start: all attitudes are level."""
    for axis in range(3):
        bank.R[axis, axis, :] = 1.0


@kernel
def predict_matrix_bank(ekf, imu, in_air):
    """Propagate all models by one IMU sample (an IMU_SAMPLE record)."""
    gsf = ekf.gsf
    if imu.delta_vel_dt <= MIN_DT_S:
        return
    filter_acceleration(gsf, imu)
    if not gsf.tilt_aligned and not _try_align_tilt(ekf, imu):
        return
    turn_matrices(ekf, imu, accel_fusion_gain(gsf))
    if gsf.vel_fuse_started:
        _predict_models(ekf, imu, in_air)


@kernel
def _predict_models(ekf, imu, in_air):
    """Propagate velocity and covariance of all models by an IMU sample, as `predict_models` does."""
    gsf, R = ekf.gsf, ekf.yaw_matrices.R
    accel_noise = ACCEL_NOISE if in_air else 2.0 * ACCEL_NOISE
    dv_variance = (accel_noise * imu.delta_vel_dt) ** 2
    da_variance = (GYRO_NOISE * imu.delta_ang_dt) ** 2
    dv, da, P = imu.delta_vel, imu.delta_ang, gsf.P
    for model in range(N_MODELS):
        dv_n = R[0, 0, model] * dv[0] + R[0, 1, model] * dv[1] + R[0, 2, model] * dv[2]
        dv_e = R[1, 0, model] * dv[0] + R[1, 1, model] * dv[1] + R[1, 2, model] * dv[2]
        da_d = R[2, 0, model] * da[0] + R[2, 1, model] * da[1] + R[2, 2, model] * da[2]
        growth = _yaw_growth(ekf, da_d)
        cross_n = P[P_VN_YAW, model] - dv_e * P[P_YAW_YAW, model]
        cross_e = P[P_VE_YAW, model] + dv_n * P[P_YAW_YAW, model]
        P[P_VN_VE, model] += dv_n * cross_n - dv_e * P[P_VE_YAW, model]
        north = P[P_VN_VN, model] - dv_e * (P[P_VN_YAW, model] + cross_n) + dv_variance
        east = P[P_VE_VE, model] + dv_n * (P[P_VE_YAW, model] + cross_e) + dv_variance
        P[P_VN_VN, model], P[P_VE_VE, model] = max(north, MIN_VARIANCE), max(east, MIN_VARIANCE)
        P[P_VN_YAW, model], P[P_VE_YAW, model] = cross_n * growth, cross_e * growth
        P[P_YAW_YAW, model] = max(P[P_YAW_YAW, model] * growth * growth + da_variance, MIN_VARIANCE)
        gsf.x[0, model] += dv_n
        gsf.x[1, model] += dv_e


@kernel
def _growth_of_turn(ekf, da_d):
    return 1.0 + da_d * da_d


@kernel
def _no_growth(ekf, da_d):
    """v1.14 carries the yaw over as it is."""
    return 1.0


_yaw_growth = by_release(_growth_of_turn, "runs_yaw_bank_in_air", _no_growth)
"""How the yaw of a model carries over a step of prediction, `da_d` (rad) its rotation about down."""


@kernel
def _try_align_tilt(ekf, imu):
    """Take the tilt from the accelerometer if the vehicle looks at rest (0.9–1.1 g, now and filtered)."""
    now = length_of(imu.delta_vel) / imu.delta_vel_dt
    filtered = length_of(ekf.gsf.accel_lpf)
    if not (ALIGNMENT_LOW < now < ALIGNMENT_HIGH and ALIGNMENT_LOW < filtered < ALIGNMENT_HIGH):
        return False
    level_matrices(ekf, imu)
    return True


@kernel
def level_matrices(ekf, imu):
    """Level all models by the accelerometer: down opposite to the specific force, north below the body's x axis."""
    length = length_of(imu.delta_vel)
    down_x, down_y, down_z = -imu.delta_vel[0] / length, -imu.delta_vel[1] / length, -imu.delta_vel[2] / length
    # north is (1, 0, 0) less its part along down; its length is the cosine of the pitch
    north_x, north_y, north_z = 1.0 - down_x * down_x, -down_x * down_y, -down_x * down_z
    length = math.sqrt(north_x * north_x + north_y * north_y + north_z * north_z)
    north_x, north_y, north_z = north_x / length, north_y / length, north_z / length
    R = ekf.yaw_matrices.R
    R[0, 0, :], R[0, 1, :], R[0, 2, :] = north_x, north_y, north_z
    R[1, 0, :] = down_y * north_z - down_z * north_y
    R[1, 1, :] = down_z * north_x - down_x * north_z
    R[1, 2, :] = down_x * north_y - down_y * north_x
    R[2, 0, :], R[2, 1, :], R[2, 2, :] = down_x, down_y, down_z
    ekf.gsf.tilt_aligned = True


@kernel
def _ten_degrees(ekf):
    return BIAS_LEARNING_SPIN_LIMIT


@kernel
def _rounded_limit(ekf):
    return 0.175


_spin_limit = by_release(_ten_degrees, "tells_yaw_estimator_height_accuracy", _rounded_limit)
"""Rate (rad/s) up to which the gyro biases are learnt."""


@kernel
def turn_matrices(ekf, imu, gain):
    """Learn the gyro biases and turn the attitudes by the sample's rotation; `gain` (1/s) is that of the tilt."""
    gsf, R = ekf.gsf, ekf.yaw_matrices.R
    dt = imu.delta_ang_dt
    rate_dt = max(dt, MIN_DT_S)
    turn_x, turn_y, turn_z = imu.delta_ang[0], imu.delta_ang[1], imu.delta_ang[2]
    force_x, force_y, force_z = gsf.accel_lpf[0], gsf.accel_lpf[1], gsf.accel_lpf[2]
    scale = gain / length_of(gsf.accel_lpf) if gain > 0.0 else 0.0
    airspeed = gsf.true_airspeed if knows_airspeed(gsf) else 0.0
    spin_limit = _spin_limit(ekf)
    for model in range(LANES):
        bias_x, bias_y, bias_z = gsf.gyro_bias[0, model], gsf.gyro_bias[1, model], gsf.gyro_bias[2, model]
        rate_x, rate_y, rate_z = turn_x / rate_dt - bias_x, turn_y / rate_dt - bias_y, turn_z / rate_dt - bias_z
        down_x, down_y, down_z = R[2, 0, model], R[2, 1, model], R[2, 2, model]
        side = force_y - airspeed * rate_z
        along = force_z + airspeed * rate_y
        tilt_x = (down_y * along - down_z * side) * scale
        tilt_y = (down_z * force_x - down_x * along) * scale
        tilt_z = (down_x * side - down_y * force_x) * scale

        learns = rate_x * rate_x + rate_y * rate_y + rate_z * rate_z < spin_limit * spin_limit
        bias_x = limited_bias(bias_x - tilt_x * GYRO_BIAS_GAIN * dt) if learns else bias_x
        bias_y = limited_bias(bias_y - tilt_y * GYRO_BIAS_GAIN * dt) if learns else bias_y
        bias_z = limited_bias(bias_z - tilt_z * GYRO_BIAS_GAIN * dt) if learns else bias_z
        gsf.gyro_bias[0, model], gsf.gyro_bias[1, model], gsf.gyro_bias[2, model] = bias_x, bias_y, bias_z
        gsf.rotation[0, model] = turn_x + (tilt_x - bias_x) * dt
        gsf.rotation[1, model] = turn_y + (tilt_y - bias_y) * dt
        gsf.rotation[2, model] = turn_z + (tilt_z - bias_z) * dt
    for row in range(3):
        for model in range(LANES):
            x, y, z = gsf.rotation[0, model], gsf.rotation[1, model], gsf.rotation[2, model]
            a, b, c = R[row, 0, model], R[row, 1, model], R[row, 2, model]
            turned_a, turned_b, turned_c = a + b * z - c * y, b + c * x - a * z, c + a * y - b * x
            squared = turned_a * turned_a + turned_b * turned_b + turned_c * turned_c
            # idle models have no attitude
            shrink = 1.5 - 0.5 * squared if squared > FLT_EPSILON else 1.0
            R[row, 0, model], R[row, 1, model], R[row, 2, model] = (
                turned_a * shrink,
                turned_b * shrink,
                turned_c * shrink,
            )


@kernel
def fuse_matrix_bank_velocity(ekf, vel_n, vel_e, vel_accuracy, in_air):
    """Fuse a horizontal velocity (m/s) of given accuracy; the bank starts in the air or once the vehicle moves."""
    gsf = ekf.gsf
    if not gsf.vel_fuse_started:
        initialise_models(gsf, vel_n, vel_e, vel_accuracy)
        align_matrices(ekf)
        gsf.vel_fuse_started = in_air or vel_n * vel_n + vel_e * vel_e > vel_accuracy * vel_accuracy
        return
    for model in range(N_MODELS):
        take_yaw(ekf, model)
        update_matrix_model(ekf, model, vel_n, vel_e, vel_accuracy)
    if not reweigh_models(gsf):
        # what the models say together is no more asked for until they have started anew
        reset_gsf(gsf)
        return
    combine_yaw(gsf)


@kernel
def reweigh_models(gsf):
    """Weigh each model by the likelihood of its innovation; return False if all have become next to impossible."""
    total, possible = 0.0, False
    for model in range(N_MODELS):
        weight = gaussian_density(gsf, model) * gsf.weight[model]
        possible = possible or weight >= MIN_WEIGHT
        gsf.weight[model] = max(weight, MIN_WEIGHT)
        total += gsf.weight[model]
    if possible:
        for model in range(N_MODELS):
            gsf.weight[model] /= total
    return possible


@kernel
def align_matrices(ekf):
    """Turn each model's attitude to the yaw of its velocity-and-yaw filter."""
    gsf = ekf.gsf
    for model in range(N_MODELS):
        _copy_attitude(ekf, model)
        update_yaw_in_rot_mat(wrap_pi(gsf.x[2, model]), gsf.R, gsf.R_aligned)
        for row in range(3):
            for column in range(3):
                ekf.yaw_matrices.R[row, column, model] = gsf.R_aligned[row, column]


@kernel
def take_yaw(ekf, model):
    """Take the yaw of one model from its attitude."""
    _copy_attitude(ekf, model)
    ekf.gsf.x[2, model] = euler_yaw(ekf.gsf.R)


@kernel
def _copy_attitude(ekf, model):
    for row in range(3):
        for column in range(3):
            ekf.gsf.R[row, column] = ekf.yaw_matrices.R[row, column, model]


@kernel
def update_matrix_model(ekf, model, vel_n, vel_e, vel_accuracy):
    """Fuse a horizontal velocity, what it corrects shortened to 5 σ; the yaw correction turns the attitude, too."""
    gsf, R = ekf.gsf, ekf.yaw_matrices.R
    innovation_n, innovation_e = gsf.x[0, model] - vel_n, gsf.x[1, model] - vel_e
    gain_n, gain_e, gain_yaw, nis = correct_covariance(gsf, model, innovation_n, innovation_e, vel_accuracy)
    gsf.nis[model] = nis
    gsf.innovation[0, model], gsf.innovation[1, model] = innovation_n, innovation_e
    shrink = math.sqrt(NIS_LIMIT / nis) if nis > NIS_LIMIT else 1.0
    gsf.x[0, model] -= (gain_n[0] * innovation_n + gain_n[1] * innovation_e) * shrink
    gsf.x[1, model] -= (gain_e[0] * innovation_n + gain_e[1] * innovation_e) * shrink
    turn = -(gain_yaw[0] * innovation_n + gain_yaw[1] * innovation_e) * shrink
    gsf.x[2, model] += turn
    c, s = math.cos(turn), math.sin(turn)
    for column in range(3):
        north, east = R[0, column, model], R[1, column, model]
        R[0, column, model] = north * c - east * s
        R[1, column, model] = north * s + east * c
    return True


@kernel
def tell_matrix_bank_velocity(ekf, vel_n, vel_e, vel_accuracy):
    """Give the bank of v1.14 a horizontal velocity (m/s), which it fuses once it runs."""
    told = ekf.yaw_velocity
    told.north, told.east, told.accuracy, told.is_new = vel_n, vel_e, vel_accuracy, True


@kernel
def run_matrix_bank_in_air(ekf, imu, in_air):
    """Propagate all models by one IMU sample and fuse the velocity that has been told: in the air alone.

    The composite yaw follows at every sample. A bank that is given up waits for the next velocity with its yaws spread.
    """
    gsf, told = ekf.gsf, ekf.yaw_velocity
    filter_acceleration(gsf, imu)
    if not gsf.tilt_aligned:
        if ALIGNMENT_LOW < length_of(imu.delta_vel) / imu.delta_vel_dt < ALIGNMENT_HIGH:
            level_matrices(ekf, imu)
        return
    turn_matrices(ekf, imu, accel_fusion_gain(gsf))
    if gsf.vel_fuse_started:
        _predict_models(ekf, imu, True)
        for model in range(N_MODELS):
            take_yaw(ekf, model)
    if in_air and told.is_new:
        _start_or_fuse(ekf, told.north, told.east, told.accuracy)
    elif not in_air:
        gsf.vel_fuse_started = False
    combine_yaw(gsf)
    told.is_new = False


@kernel
def _start_or_fuse(ekf, vel_n, vel_e, vel_accuracy):
    gsf = ekf.gsf
    if not gsf.vel_fuse_started:
        initialise_models(gsf, vel_n, vel_e, vel_accuracy)
        align_matrices(ekf)
        bias = gyro_bias(ekf)
        for axis in range(3):
            gsf.gyro_bias[axis, :] = bias[axis]
        gsf.vel_fuse_started = True
        return
    fused = True
    for model in range(N_MODELS):
        fused = update_matrix_model(ekf, model, vel_n, vel_e, vel_accuracy) and fused
    if fused and not reweigh_models(gsf):
        initialise_models(gsf, vel_n, vel_e, vel_accuracy)
        gsf.vel_fuse_started = False
