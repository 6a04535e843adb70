"""Three-state Kalman filter of one model: velocity north, velocity east, yaw, observed through horizontal velocity."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import N_MODELS
from fusetune.ekf2.numerics.rotations import euler_yaw, quat_to_dcm, rotate_by_earth_increment, wrap_pi

GYRO_NOISE = 0.1
ACCEL_NOISE = 2.0
MIN_VARIANCE = 1e-6
MIN_VELOCITY_ACCURACY = 0.01
NIS_LIMIT = 25.0
SINGLE_PRECISION_EPSILON = 1.1920929e-07


@kernel
def initialise_models(gsf, vel_n, vel_e, vel_accuracy):
    """Start all models at the measured velocity, their yaws spread evenly over the circle, with equal weights."""
    gsf.yaw = 0.0
    gsf.yaw_variance = (0.5 * math.pi) ** 2
    increment = 2.0 * math.pi / N_MODELS
    variance = max(vel_accuracy, MIN_VELOCITY_ACCURACY) ** 2
    for model in range(N_MODELS):
        gsf.weight[model] = 1.0 / N_MODELS
        gsf.x[model, 0] = vel_n
        gsf.x[model, 1] = vel_e
        gsf.x[model, 2] = -math.pi + (model + 0.5) * increment
        gsf.P[model, :, :] = 0.0
        gsf.P[model, 0, 0] = variance
        gsf.P[model, 1, 1] = variance
        gsf.P[model, 2, 2] = (0.5 * increment) ** 2
        gsf.innovation[model, :] = 0.0
        gsf.nis[model] = 0.0
        gsf.S_det_inverse[model] = 0.0


@kernel
def predict_model(gsf, model, imu, in_air):
    """Propagate velocity and covariance of one model by an IMU sample; for its yaw see `look_up_yaw`.

    With the velocity increment (Δn, Δe) in NED, F = [[1, 0, -Δe], [0, 1, Δn], [0, 0, s]]. The yaw would carry over with
    s = 1, but PX4's generated equations have s = 1 + δ², δ (rad) the down component of the increment of rotation: the
    product of two rotations of which one is linearised. Yaw variances grow by it while the vehicle turns.
    """
    quat_to_dcm(gsf.q[model], gsf.R)
    R = gsf.R
    dv = imu.delta_vel
    dv_n = R[0, 0] * dv[0] + R[0, 1] * dv[1] + R[0, 2] * dv[2]
    dv_e = R[1, 0] * dv[0] + R[1, 1] * dv[1] + R[1, 2] * dv[2]
    da = imu.delta_ang
    da_d = R[2, 0] * da[0] + R[2, 1] * da[1] + R[2, 2] * da[2]
    yaw_growth = 1.0 + da_d * da_d

    accel_noise = ACCEL_NOISE if in_air else 2.0 * ACCEL_NOISE
    dv_variance = (accel_noise * imu.delta_vel_dt) ** 2
    da_variance = (GYRO_NOISE * imu.delta_ang_dt) ** 2

    P = gsf.P[model]
    p00, p01, p02, p11, p12, p22 = P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]
    cross_02 = p02 - dv_e * p22
    cross_12 = p12 + dv_n * p22
    P[0, 0] = p00 - dv_e * p02 - dv_e * cross_02 + dv_variance
    P[0, 1] = p01 - dv_e * p12 + dv_n * cross_02
    P[0, 2] = cross_02 * yaw_growth
    P[1, 1] = p11 + dv_n * p12 + dv_n * cross_12 + dv_variance
    P[1, 2] = cross_12 * yaw_growth
    P[2, 2] = p22 * yaw_growth * yaw_growth + da_variance
    _mirror_and_constrain(P)

    gsf.x[model, 0] += dv_n
    gsf.x[model, 1] += dv_e


@kernel
def look_up_yaw(gsf, model):
    """Take the yaw of one model from its attitude; only a velocity fusion needs it."""
    quat_to_dcm(gsf.q[model], gsf.R)
    gsf.x[model, 2] = euler_yaw(gsf.R)


@kernel
def update_model(gsf, model, vel_n, vel_e, vel_accuracy):
    """Fuse a horizontal velocity, its innovation shortened to 5 σ; the yaw correction turns the attitude, too."""
    R = max(vel_accuracy, MIN_VELOCITY_ACCURACY) ** 2
    P = gsf.P[model]
    innovation = gsf.innovation[model]
    innovation[0] = gsf.x[model, 0] - vel_n
    innovation[1] = gsf.x[model, 1] - vel_e

    p00, p01, p02, p11, p12, p22 = P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]
    s00, s11 = p00 + R, p11 + R
    det = s00 * s11 - p01 * p01
    # PX4's generated equations keep the determinant off zero by the resolution of single precision
    det_inverse = 1.0 / (det + (SINGLE_PRECISION_EPSILON if det >= 0.0 else -SINGLE_PRECISION_EPSILON))
    i00, i01, i11 = s11 * det_inverse, -p01 * det_inverse, s00 * det_inverse
    gsf.S_det_inverse[model] = det_inverse

    k00, k01 = p00 * i00 + p01 * i01, p00 * i01 + p01 * i11
    k10, k11 = p01 * i00 + p11 * i01, p01 * i01 + p11 * i11
    k20, k21 = p02 * i00 + p12 * i01, p02 * i01 + p12 * i11
    P[0, 0] = p00 - k00 * p00 - k01 * p01
    P[0, 1] = p01 - k00 * p01 - k01 * p11
    P[0, 2] = p02 - k00 * p02 - k01 * p12
    P[1, 1] = p11 - k10 * p01 - k11 * p11
    P[1, 2] = p12 - k10 * p02 - k11 * p12
    P[2, 2] = p22 - k20 * p02 - k21 * p12
    _mirror_and_constrain(P)

    nis = innovation[0] * (i00 * innovation[0] + i01 * innovation[1]) + innovation[1] * (
        i01 * innovation[0] + i11 * innovation[1]
    )
    if nis > NIS_LIMIT:
        shrink = math.sqrt(NIS_LIMIT / nis)
        innovation[0] *= shrink
        innovation[1] *= shrink
        nis = NIS_LIMIT
    gsf.nis[model] = nis

    yaw_correction = -(k20 * innovation[0] + k21 * innovation[1])
    gsf.x[model, 0] -= k00 * innovation[0] + k01 * innovation[1]
    gsf.x[model, 1] -= k10 * innovation[0] + k11 * innovation[1]
    gsf.x[model, 2] = wrap_pi(gsf.x[model, 2] + yaw_correction)
    rotate_by_earth_increment(gsf.q[model], 0.0, 0.0, yaw_correction)


@kernel
def gaussian_density(gsf, model):
    """Likelihood of the last innovation of one model."""
    return math.sqrt(gsf.S_det_inverse[model]) * math.exp(-0.5 * gsf.nis[model]) / (2.0 * math.pi)


@kernel
def _mirror_and_constrain(P):
    for i in range(3):
        P[i, i] = max(P[i, i], MIN_VARIANCE)
        for j in range(i):
            P[i, j] = P[j, i]
