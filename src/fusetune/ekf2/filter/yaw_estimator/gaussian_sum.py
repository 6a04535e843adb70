"""The bank as a whole: prediction, velocity fusion, weights of the models and the composite yaw.

Mirrors PX4 v1.16 `EKF/yaw_estimator/EKFGSF_yaw.cpp`, of which the other two files hold the parts.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.yaw_estimator.attitude_filter import (
    MIN_DT_S,
    accel_fusion_gain,
    align_yaw_of_attitudes,
    filter_acceleration,
    predict_attitudes,
    try_align_tilt,
)
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import N_MODELS, P_YAW_YAW, reset_gsf
from fusetune.ekf2.filter.yaw_estimator.velocity_yaw_filter import (
    gaussian_density,
    initialise_models,
    look_up_yaw,
    predict_models,
    update_model,
)
from fusetune.ekf2.numerics.rotations import wrap_pi

MIN_WEIGHT = 1e-5


@kernel
def predict_gsf(gsf, imu, in_air):
    """Propagate all models by one IMU sample (an IMU_SAMPLE record)."""
    if imu.delta_vel_dt <= MIN_DT_S:
        return
    filter_acceleration(gsf, imu)
    if not gsf.tilt_aligned and not try_align_tilt(gsf, imu):
        return
    predict_attitudes(gsf, imu, accel_fusion_gain(gsf))
    if gsf.vel_fuse_started:
        predict_models(gsf, imu, in_air)


@kernel
def fuse_gsf_velocity(gsf, vel_n, vel_e, vel_accuracy, in_air):
    """Fuse a horizontal velocity (m/s) of given accuracy; the bank starts in the air or once the vehicle moves."""
    if not gsf.vel_fuse_started:
        initialise_models(gsf, vel_n, vel_e, vel_accuracy)
        align_yaw_of_attitudes(gsf)
        gsf.vel_fuse_started = in_air or vel_n * vel_n + vel_e * vel_e > vel_accuracy * vel_accuracy
        return
    for model in range(N_MODELS):
        look_up_yaw(gsf, model)
        update_model(gsf, model, vel_n, vel_e, vel_accuracy)
    _update_weights(gsf)
    combine_yaw(gsf)
    if not gsf.yaw_variance > 0.0 or not math.isfinite(gsf.yaw_variance):
        reset_gsf(gsf)


@kernel
def _update_weights(gsf):
    total = 0.0
    for model in range(N_MODELS):
        gsf.weight[model] = max(gaussian_density(gsf, model) * gsf.weight[model], MIN_WEIGHT)
        total += gsf.weight[model]
    for model in range(N_MODELS):
        gsf.weight[model] /= total


@kernel
def combine_yaw(gsf):
    """Weighted mean direction of the yaws, and the variance of their mixture."""
    north, east = 0.0, 0.0
    for model in range(N_MODELS):
        north += gsf.weight[model] * math.cos(gsf.x[2, model])
        east += gsf.weight[model] * math.sin(gsf.x[2, model])
    gsf.yaw = math.atan2(east, north)
    gsf.yaw_variance = 0.0
    for model in range(N_MODELS):
        delta = wrap_pi(gsf.x[2, model] - gsf.yaw)
        gsf.yaw_variance += gsf.weight[model] * (gsf.P[P_YAW_YAW, model] + delta * delta)
