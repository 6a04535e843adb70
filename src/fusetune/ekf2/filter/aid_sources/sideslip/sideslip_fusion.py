"""Synthetic sideslip of a fixed wing: it flies without slipping, so the air comes from ahead.

With b = Rᵀ (v - w) the sideslip angle is h = atan2(b_y, b_x), observed as zero. ∂b/∂θ = Rᵀ [v - w]×, ∂b/∂v = Rᵀ,
∂b/∂w = -Rᵀ. Unless the filter is dead reckoning by the wind, only the wind states move.

Mirrors PX4 v1.16 `EKF/aid_sources/sideslip/sideslip_fusion.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import ATTITUDE, VELOCITY, WIND
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance, reset_wind_cov
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance, compute_kalman_gain
from fusetune.ekf2.filter.wind import keep_only_wind_gains

FUSION_INTERVAL_US = 150_000
FORWARD_SPEED_EPSILON = 1e-3
MIN_NOISE = 0.01
FLT_EPSILON = float(np.finfo(np.float32).eps)


@kernel
def _air_velocity_body(ekf, axis):
    R = ekf.R_to_earth
    x, y, z = ekf.vel[0] - ekf.wind_vel[0], ekf.vel[1] - ekf.wind_vel[1], ekf.vel[2]
    return R[0, axis] * x + R[1, axis] * y + R[2, axis] * z


@kernel
def _forward_air_speed(ekf):
    """Kept from zero the way SymForce does it for `atan2`: x + (sign x + ½) ε."""
    forward = _air_velocity_body(ekf, 0)
    if forward > 0.0:
        return forward + 1.5 * FORWARD_SPEED_EPSILON
    if forward < 0.0:
        return forward - 0.5 * FORWARD_SPEED_EPSILON
    return 0.5 * FORWARD_SPEED_EPSILON


@kernel
def predict_sideslip(ekf):
    """Sideslip angle (rad)."""
    return math.atan2(_air_velocity_body(ekf, 1), _forward_air_speed(ekf))


@kernel
def compute_sideslip_jacobian(ekf, H):
    """Write the derivative of the sideslip angle into `H` (24,)."""
    R = ekf.R_to_earth
    x, y, z = ekf.vel[0] - ekf.wind_vel[0], ekf.vel[1] - ekf.wind_vel[1], ekf.vel[2]
    forward, sideways = _forward_air_speed(ekf), _air_velocity_body(ekf, 1)
    inverse = 1.0 / (forward * forward + sideways * sideways)
    # the derivative of atan2(a, b) is (b da - a db) / (a² + b²): one earth vector takes both body axes
    ex = (forward * R[0, 1] - sideways * R[0, 0]) * inverse
    ey = (forward * R[1, 1] - sideways * R[1, 0]) * inverse
    ez = (forward * R[2, 1] - sideways * R[2, 0]) * inverse
    clear_jacobian(H)
    H[ATTITUDE] = ey * z - ez * y
    H[ATTITUDE + 1] = ez * x - ex * z
    H[ATTITUDE + 2] = ex * y - ey * x
    H[VELOCITY] = ex
    H[VELOCITY + 1] = ey
    H[VELOCITY + 2] = ez
    H[WIND] = -ex
    H[WIND + 1] = -ey


@kernel
def control_beta_fusion(ekf, params):
    """Fuse a sideslip of zero at regular intervals while a fixed wing, or a vehicle with airspeed, flies."""
    ekf.cs.fuse_beta = (
        int(params.EKF2_FUSE_BETA) != 0
        and (ekf.cs.fixed_wing or ekf.cs.fuse_aspd)
        and ekf.cs.in_air
        and not ekf.cs.fake_pos
    )
    aid = ekf.aid.sideslip
    if ekf.cs.fuse_beta and is_timed_out(ekf, aid.time_last_fuse, FUSION_INTERVAL_US):
        _update_sideslip(ekf, params)
        ekf.reject.sideslip = aid.innovation_rejected
        if _fuse_sideslip(ekf, params):
            ekf.cs.wind = True
        elif not ekf.wind.external_init and not ekf.cs.wind:
            reset_wind_cov(ekf)


@kernel
def _update_sideslip(ekf, params):
    H = ekf.scratch.H
    variance = max(params.EKF2_BETA_NOISE * params.EKF2_BETA_NOISE, MIN_NOISE * MIN_NOISE)
    compute_sideslip_jacobian(ekf, H)
    innovation_variance = compute_innovation_variance(ekf, H, variance)
    set_axis(ekf.aid.sideslip, 0, 0.0, variance, predict_sideslip(ekf), innovation_variance)
    update_aid_source_status(ekf, ekf.aid.sideslip, 1, ekf.time_delayed_us, max(params.EKF2_BETA_GATE, 1.0))


@kernel
def _fuse_sideslip(ekf, params):
    aid, H, K = ekf.aid.sideslip, ekf.scratch.H, ekf.scratch.K
    if aid.innovation_rejected:
        return False
    update_wind_only = not ekf.cs.wind_dead_reckoning
    variance = aid.innovation_variance[0]
    if variance < aid.observation_variance[0] or variance < FLT_EPSILON:
        ekf.fs.bad_sideslip = True
        if update_wind_only:
            reset_wind_cov(ekf)
        else:
            initialise_covariance(ekf, params)
            ekf.wind_vel[0], ekf.wind_vel[1] = 0.0, 0.0
        return False
    ekf.fs.bad_sideslip = False
    compute_kalman_gain(ekf, H, variance, K)
    if update_wind_only:
        keep_only_wind_gains(K)
    measurement_update(ekf, params, K, H, aid.observation_variance[0], aid.innovation[0])
    aid.fused = True
    aid.time_last_fuse = ekf.time_delayed_us
    return True
