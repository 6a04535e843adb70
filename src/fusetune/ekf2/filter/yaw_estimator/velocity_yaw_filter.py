"""Three-state Kalman filter of each model: velocity north, velocity east, yaw, observed through horizontal velocity.

Mirrors the small filters of PX4 v1.16 `EKF/yaw_estimator/EKFGSF_yaw.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.yaw_estimator.attitude_filter import attitude, set_attitude
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import (
    LANES,
    N_MODELS,
    P_VE_VE,
    P_VE_YAW,
    P_VN_VE,
    P_VN_VN,
    P_VN_YAW,
    P_YAW_YAW,
)
from fusetune.ekf2.numerics.constants import FLT_EPSILON_IN_EIGHT_DIGITS
from fusetune.ekf2.numerics.rotations import (
    euler_yaw,
    quat_product,
    quat_to_dcm,
    rotation_matrix,
    rotation_vector_to_quat,
    unit_length,
    wrap_pi,
)

GYRO_NOISE = 0.1
ACCEL_NOISE = 2.0
MIN_VARIANCE = 1e-6
MIN_VELOCITY_ACCURACY = 0.01
NIS_LIMIT = 25.0


@kernel
def initialise_models(gsf, vel_n, vel_e, vel_accuracy):
    """Start all models at the measured velocity, their yaws spread evenly over the circle, with equal weights."""
    gsf.yaw = 0.0
    gsf.yaw_variance = (0.5 * math.pi) ** 2
    increment = 2.0 * math.pi / N_MODELS
    variance = max(vel_accuracy, MIN_VELOCITY_ACCURACY) ** 2
    gsf.weight[:] = 1.0 / N_MODELS
    for model in range(LANES):
        gsf.x[0, model] = vel_n
        gsf.x[1, model] = vel_e
        gsf.x[2, model] = -math.pi + (model + 0.5) * increment
    gsf.P[:, :] = 0.0
    gsf.P[P_VN_VN, :] = variance
    gsf.P[P_VE_VE, :] = variance
    gsf.P[P_YAW_YAW, :] = (0.5 * increment) ** 2
    gsf.innovation[:, :] = 0.0
    gsf.nis[:] = 0.0
    gsf.S_det_inverse[:] = 0.0


@kernel
def predict_models(gsf, imu, in_air):
    """Propagate velocity and covariance of all models by an IMU sample; for their yaws see `look_up_yaw`.

    With the velocity increment (Δn, Δe) in NED, F = [[1, 0, -Δe], [0, 1, Δn], [0, 0, s]]. The yaw would carry over with
    s = 1, but PX4's generated equations have s = 1 + δ², δ (rad) the down component of the increment of rotation: the
    product of two rotations of which one is linearised. Yaw variances grow by it while the vehicle turns.
    """
    accel_noise = ACCEL_NOISE if in_air else 2.0 * ACCEL_NOISE
    dv_variance = (accel_noise * imu.delta_vel_dt) ** 2
    da_variance = (GYRO_NOISE * imu.delta_ang_dt) ** 2
    dv_x, dv_y, dv_z = imu.delta_vel[0], imu.delta_vel[1], imu.delta_vel[2]
    da_x, da_y, da_z = imu.delta_ang[0], imu.delta_ang[1], imu.delta_ang[2]
    P, x = gsf.P, gsf.x
    for model in range(LANES):
        w, i, j, k = attitude(gsf, model)
        north, east, down = rotation_matrix(w, i, j, k)
        dv_n = north[0] * dv_x + north[1] * dv_y + north[2] * dv_z
        dv_e = east[0] * dv_x + east[1] * dv_y + east[2] * dv_z
        da_d = down[0] * da_x + down[1] * da_y + down[2] * da_z
        yaw_growth = 1.0 + da_d * da_d

        p00, p01, p02 = P[P_VN_VN, model], P[P_VN_VE, model], P[P_VN_YAW, model]
        p11, p12, p22 = P[P_VE_VE, model], P[P_VE_YAW, model], P[P_YAW_YAW, model]
        cross_02 = p02 - dv_e * p22
        cross_12 = p12 + dv_n * p22
        P[P_VN_VN, model] = max(p00 - dv_e * p02 - dv_e * cross_02 + dv_variance, MIN_VARIANCE)
        P[P_VN_VE, model] = p01 - dv_e * p12 + dv_n * cross_02
        P[P_VN_YAW, model] = cross_02 * yaw_growth
        P[P_VE_VE, model] = max(p11 + dv_n * p12 + dv_n * cross_12 + dv_variance, MIN_VARIANCE)
        P[P_VE_YAW, model] = cross_12 * yaw_growth
        P[P_YAW_YAW, model] = max(p22 * yaw_growth * yaw_growth + da_variance, MIN_VARIANCE)
        x[0, model] += dv_n
        x[1, model] += dv_e


@kernel
def look_up_yaw(gsf, model):
    """Take the yaw of one model from its attitude; only a velocity fusion needs it."""
    q = gsf.q_aligned
    q[0], q[1], q[2], q[3] = attitude(gsf, model)
    quat_to_dcm(q, gsf.R)
    gsf.x[2, model] = euler_yaw(gsf.R)


@kernel
def correct_covariance(gsf, model, innovation_n, innovation_e, vel_accuracy):
    """Correct the covariance of one model by a horizontal velocity of given accuracy (m/s).

    Return the gains of its three states, a pair each (north, east), and the normalised innovation squared.
    """
    R = max(vel_accuracy, MIN_VELOCITY_ACCURACY) ** 2
    P = gsf.P
    p00, p01, p02 = P[P_VN_VN, model], P[P_VN_VE, model], P[P_VN_YAW, model]
    p11, p12, p22 = P[P_VE_VE, model], P[P_VE_YAW, model], P[P_YAW_YAW, model]
    s00, s11 = p00 + R, p11 + R
    det = s00 * s11 - p01 * p01
    # PX4's generated equations keep the determinant off zero by the resolution of single precision
    det_inverse = 1.0 / (det + (FLT_EPSILON_IN_EIGHT_DIGITS if det >= 0.0 else -FLT_EPSILON_IN_EIGHT_DIGITS))
    i00, i01, i11 = s11 * det_inverse, -p01 * det_inverse, s00 * det_inverse
    gsf.S_det_inverse[model] = det_inverse

    k00, k01 = p00 * i00 + p01 * i01, p00 * i01 + p01 * i11
    k10, k11 = p01 * i00 + p11 * i01, p01 * i01 + p11 * i11
    k20, k21 = p02 * i00 + p12 * i01, p02 * i01 + p12 * i11
    P[P_VN_VN, model] = max(p00 - k00 * p00 - k01 * p01, MIN_VARIANCE)
    P[P_VN_VE, model] = p01 - k00 * p01 - k01 * p11
    P[P_VN_YAW, model] = p02 - k00 * p02 - k01 * p12
    P[P_VE_VE, model] = max(p11 - k10 * p01 - k11 * p11, MIN_VARIANCE)
    P[P_VE_YAW, model] = p12 - k10 * p02 - k11 * p12
    P[P_YAW_YAW, model] = max(p22 - k20 * p02 - k21 * p12, MIN_VARIANCE)

    nis = innovation_n * (i00 * innovation_n + i01 * innovation_e) + innovation_e * (
        i01 * innovation_n + i11 * innovation_e
    )
    return (k00, k01), (k10, k11), (k20, k21), nis


@kernel
def update_model(gsf, model, vel_n, vel_e, vel_accuracy):
    """Fuse a horizontal velocity, its innovation shortened to 5 σ; the yaw correction turns the attitude, too."""
    x = gsf.x
    innovation_n = x[0, model] - vel_n
    innovation_e = x[1, model] - vel_e
    gain_n, gain_e, gain_yaw, nis = correct_covariance(gsf, model, innovation_n, innovation_e, vel_accuracy)
    if nis > NIS_LIMIT:
        shrink = math.sqrt(NIS_LIMIT / nis)
        innovation_n *= shrink
        innovation_e *= shrink
        nis = NIS_LIMIT
    gsf.nis[model] = nis
    gsf.innovation[0, model], gsf.innovation[1, model] = innovation_n, innovation_e

    yaw_correction = -(gain_yaw[0] * innovation_n + gain_yaw[1] * innovation_e)
    x[0, model] -= gain_n[0] * innovation_n + gain_n[1] * innovation_e
    x[1, model] -= gain_e[0] * innovation_n + gain_e[1] * innovation_e
    x[2, model] = wrap_pi(x[2, model] + yaw_correction)
    turn = rotation_vector_to_quat(0.0, 0.0, yaw_correction)
    w, i, j, k = quat_product(turn, attitude(gsf, model))
    set_attitude(gsf, model, unit_length(w, i, j, k))


@kernel
def gaussian_density(gsf, model):
    """Likelihood of the last innovation of one model."""
    return math.sqrt(gsf.S_det_inverse[model]) * math.exp(-0.5 * gsf.nis[model]) / (2.0 * math.pi)
