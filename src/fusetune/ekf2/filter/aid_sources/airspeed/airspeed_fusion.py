"""Prediction and fusion of true airspeed.

h = |v - w|; ∂h/∂v = (v - w)/h and ∂h/∂w its negative. Unless the filter is dead reckoning by the wind, only the wind
states move. Mirrors PX4 v1.16 `EKF/aid_sources/airspeed/airspeed_fusion.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_resets import airspeed_variance, reset_wind_using_airspeed
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import VELOCITY, WIND
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance, compute_kalman_gain
from fusetune.ekf2.filter.wind import keep_only_wind_gains

FLT_EPSILON = float(np.finfo(np.float32).eps)


@kernel
def predict_airspeed(ekf):
    """Speed (m/s) of the vehicle through the air."""
    x, y, z = ekf.vel[0] - ekf.wind_vel[0], ekf.vel[1] - ekf.wind_vel[1], ekf.vel[2]
    return math.sqrt(x * x + y * y + z * z + FLT_EPSILON)


@kernel
def compute_airspeed_jacobian(ekf, H):
    """Write the derivative of the airspeed into `H` (24,)."""
    inverse = 1.0 / predict_airspeed(ekf)
    clear_jacobian(H)
    for i in range(2):
        H[VELOCITY + i] = (ekf.vel[i] - ekf.wind_vel[i]) * inverse
        H[WIND + i] = -H[VELOCITY + i]
    H[VELOCITY + 2] = ekf.vel[2] * inverse


@kernel
def update_airspeed(ekf, params):
    """Judge the airspeed that is due now."""
    sample, H = ekf.airspeed_sample, ekf.airspeed.H
    variance = airspeed_variance(params, sample.eas2tas)
    compute_airspeed_jacobian(ekf, H)
    innovation = predict_airspeed(ekf) - sample.true_airspeed
    innovation_variance = compute_innovation_variance(ekf, H, variance)
    set_axis(ekf.aid.airspeed, 0, sample.true_airspeed, variance, innovation, innovation_variance)
    update_aid_source_status(ekf, ekf.aid.airspeed, 1, sample.time_us, max(params.EKF2_TAS_GATE, 1.0))


@kernel
def fuse_airspeed(ekf, params):
    """Fuse the judged airspeed unless it was rejected."""
    aid, H, K = ekf.aid.airspeed, ekf.airspeed.H, ekf.scratch.K
    if aid.innovation_rejected:
        return
    update_wind_only = not ekf.cs.wind_dead_reckoning
    variance = aid.innovation_variance[0]
    if variance < aid.observation_variance[0] or variance < FLT_EPSILON:
        _recover_from_bad_covariance(ekf, params, update_wind_only)
        return
    ekf.fs.bad_airspeed = False
    compute_kalman_gain(ekf, H, variance, K)
    if update_wind_only:
        keep_only_wind_gains(K)
    measurement_update(ekf, params, K, H, aid.observation_variance[0], aid.innovation[0])
    aid.fused = True
    aid.time_last_fuse = ekf.time_delayed_us
    if not update_wind_only:
        ekf.time_last_hor_vel_fuse = ekf.time_delayed_us


@kernel
def _recover_from_bad_covariance(ekf, params, update_wind_only):
    if update_wind_only:
        reset_wind_using_airspeed(ekf, params)
    else:
        initialise_covariance(ekf, params)
        ekf.wind_vel[0], ekf.wind_vel[1] = 0.0, 0.0
    ekf.fs.bad_airspeed = True
