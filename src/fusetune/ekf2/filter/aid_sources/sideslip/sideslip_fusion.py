"""Synthetic sideslip of a fixed wing: it flies without slipping, so the air comes from ahead.

With b = Rᵀ (v - w) the sideslip angle is h = atan2(b_y, b_x), observed as zero. ∂b/∂θ = Rᵀ [v - w]×, ∂b/∂v = Rᵀ,
∂b/∂w = -Rᵀ. Unless the filter is dead reckoning by the wind, only the wind states move.

Mirrors PX4 v1.16 `EKF/aid_sources/sideslip/sideslip_fusion.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import ATTITUDE, VELOCITY, WIND
from fusetune.ekf2.filter.common.timing import horizon_us, is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance, reset_wind_cov
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import complete_attitude_jacobian
from fusetune.ekf2.filter.wind import air_velocity, air_velocity_body, fuse_into_wind, reset_wind_to_zero
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release

FUSION_INTERVAL_US = 150_000
FORWARD_SPEED_EPSILON = 1e-3
LEAST_AIR_SPEED = 7.0
MIN_NOISE = 0.01


@kernel
def _air_velocity_in_plane(ekf):
    """Forward and sideways velocity (m/s) through the air.

    Forward is kept from zero the way SymForce does it for `atan2`: x + (sign x + ½) ε.
    """
    forward, sideways, _ = air_velocity_body(ekf)
    if forward > 0.0:
        return forward + 1.5 * FORWARD_SPEED_EPSILON, sideways
    if forward < 0.0:
        return forward - 0.5 * FORWARD_SPEED_EPSILON, sideways
    return 0.5 * FORWARD_SPEED_EPSILON, sideways


@kernel
def _predict_angle(ekf):
    """Sideslip angle (rad)."""
    forward, sideways = _air_velocity_in_plane(ekf)
    return math.atan2(sideways, forward)


@kernel
def _velocity_ratio(ekf):
    """Forward velocity (m/s), kept from zero by its own sign, and the ratio of sideways to forward."""
    forward, sideways, _ = air_velocity_body(ekf)
    forward += FLT_EPSILON if forward >= 0.0 else -FLT_EPSILON
    return forward, sideways / forward


@kernel
def _predict_ratio(ekf):
    """Sideways over forward air velocity: the sideslip angle (rad) where that is small."""
    _, ratio = _velocity_ratio(ekf)
    return ratio


predict_sideslip = by_release(_predict_angle, "takes_sideslip_for_ratio", _predict_ratio)


@kernel
def _angle_by_velocity(ekf):
    """Derivative of the angle by the velocity (NED)."""
    R = ekf.R_to_earth
    forward, sideways = _air_velocity_in_plane(ekf)
    inverse = 1.0 / (forward * forward + sideways * sideways)
    # the derivative of atan2(a, b) is (b da - a db) / (a² + b²): one earth vector takes both body axes
    ex = (forward * R[0, 1] - sideways * R[0, 0]) * inverse
    ey = (forward * R[1, 1] - sideways * R[1, 0]) * inverse
    ez = (forward * R[2, 1] - sideways * R[2, 0]) * inverse
    return ex, ey, ez


@kernel
def _ratio_by_velocity(ekf):
    """Derivative of the ratio by the velocity (NED)."""
    R = ekf.R_to_earth
    forward, ratio = _velocity_ratio(ekf)
    inverse = 1.0 / forward
    return (
        (R[0, 1] - ratio * R[0, 0]) * inverse,
        (R[1, 1] - ratio * R[1, 0]) * inverse,
        (R[2, 1] - ratio * R[2, 0]) * inverse,
    )


_sideslip_by_velocity = by_release(_angle_by_velocity, "takes_sideslip_for_ratio", _ratio_by_velocity)


@kernel
def compute_sideslip_jacobian(ekf, H):
    """Write the derivative of the sideslip angle into `H` (24,)."""
    x, y, z = air_velocity(ekf)
    ex, ey, ez = _sideslip_by_velocity(ekf)
    clear_jacobian(H)
    H[ATTITUDE] = ey * z - ez * y
    H[ATTITUDE + 1] = ez * x - ex * z
    H[ATTITUDE + 2] = ex * y - ey * x
    H[VELOCITY] = ex
    H[VELOCITY + 1] = ey
    H[VELOCITY + 2] = ez
    H[WIND] = -ex
    H[WIND + 1] = -ey
    complete_attitude_jacobian(ekf, H, 0.0)


@kernel
def _flies_like_a_wing(ekf):
    return ekf.cs.fixed_wing or ekf.cs.fuse_aspd


@kernel
def _is_fixed_wing(ekf):
    return ekf.cs.fixed_wing


_may_have_sideslip = by_release(_flies_like_a_wing, "asks_airspeed_for_wings", _is_fixed_wing)


@kernel
def _fuse_or_start_wind(ekf, params):
    if _fuse_sideslip(ekf, params):
        ekf.cs.wind = True
    elif not ekf.wind.external_init and not ekf.cs.wind:
        reset_wind_cov(ekf)


@kernel
def _at_any_speed(ekf):
    return True


@kernel
def _above_least_speed(ekf):
    north, east, _ = air_velocity(ekf)
    return math.hypot(north, east) > LEAST_AIR_SPEED


_is_fast_enough = by_release(_at_any_speed, "slips_at_speed", _above_least_speed)


@kernel
def _start_wind_and_fuse(ekf, params):
    """The innovation is the one of before the wind's start."""
    if not ekf.cs.wind:
        ekf.cs.wind = True
        ekf.aid.sideslip.time_last_fuse = ekf.time_delayed_us
        reset_wind_to_zero(ekf)
    if _is_fast_enough(ekf):
        _fuse_sideslip(ekf, params)


_use_sideslip = by_release(_fuse_or_start_wind, "starts_wind_at_zero", _start_wind_and_fuse)


@kernel
def _bounded_noise(ekf, params):
    return max(params.EKF2_BETA_NOISE * params.EKF2_BETA_NOISE, MIN_NOISE * MIN_NOISE)


@kernel
def _noise_as_given(ekf, params):
    return params.EKF2_BETA_NOISE * params.EKF2_BETA_NOISE


_sideslip_noise = by_release(_bounded_noise, "takes_sideslip_for_ratio", _noise_as_given)


@kernel
def _update_sideslip(ekf, params):
    H = ekf.scratch.H
    variance = _sideslip_noise(ekf, params)
    compute_sideslip_jacobian(ekf, H)
    innovation_variance = compute_innovation_variance(ekf, H, variance)
    set_axis(ekf.aid.sideslip, 0, 0.0, variance, predict_sideslip(ekf), innovation_variance)
    update_aid_source_status(ekf, ekf.aid.sideslip, 1, horizon_us(ekf), max(params.EKF2_BETA_GATE, 1.0))


@kernel
def _fuse_sideslip(ekf, params):
    aid = ekf.aid.sideslip
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
    fuse_into_wind(ekf, params, aid, ekf.scratch.H, update_wind_only)
    return True


@kernel
def _control_by_flag(ekf, params):
    """As v1.16's; the vehicle's status sets the flag, and what is judged is fused: above 7 m/s."""
    if int(params.EKF2_FUSE_BETA) != 1:
        ekf.cs.fuse_beta = False
    if not ekf.cs.fuse_beta or not ekf.cs.in_air or ekf.cs.fake_pos:
        return
    if not is_timed_out(ekf, ekf.aid.sideslip.time_last_fuse, FUSION_INTERVAL_US):
        return
    if not ekf.cs.wind:
        ekf.cs.wind = True
        ekf.aid.sideslip.time_last_fuse = ekf.time_delayed_us
        reset_wind_to_zero(ekf)
    x, y, z = air_velocity(ekf)
    if math.sqrt(x * x + y * y + z * z) > LEAST_AIR_SPEED:
        _update_sideslip(ekf, params)
        ekf.reject.sideslip = ekf.aid.sideslip.innovation_rejected
        _fuse_sideslip(ekf, params)


@kernel
def _control_at_intervals(ekf, params):
    """Fuse a sideslip of zero at regular intervals while a fixed wing, or a vehicle with airspeed, flies."""
    ekf.cs.fuse_beta = (
        int(params.EKF2_FUSE_BETA) != 0 and _may_have_sideslip(ekf) and ekf.cs.in_air and not ekf.cs.fake_pos
    )
    if ekf.cs.fuse_beta and is_timed_out(ekf, ekf.aid.sideslip.time_last_fuse, FUSION_INTERVAL_US):
        _update_sideslip(ekf, params)
        ekf.reject.sideslip = ekf.aid.sideslip.innovation_rejected
        _use_sideslip(ekf, params)


control_beta_fusion = by_release(_control_at_intervals, "judges_air_data_when_fused", _control_by_flag)
