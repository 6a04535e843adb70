"""Wind of a multirotor from the drag that it feels along body X and Y.

With b = Rᵀ (v - w) the specific force is h_i = -½ ρ b_i |b| / C_i - m b_i: bluff body drag with the ballistic
coefficients C (`EKF2_BCOEF_X`, `_Y`, kg/m²) and momentum drag of the propellers (`EKF2_MCOEF`, 1/s, times √(ρ/ρ₀) as
momentum theory has it for the mass flow of a hover). ∂b/∂θ = Rᵀ [v - w]×, ∂b/∂v = Rᵀ, ∂b/∂w = -Rᵀ.

Mirrors PX4 v1.16 `EKF/aid_sources/drag/drag_fusion.cpp`. Both axes are predicted from the state before the first is
fused; the measurement follows the accelerometer bias. The status counts as fused at every sample.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import MAX_SAMPLE_AGE_US
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.imu_rates import accel_bias
from fusetune.ekf2.filter.common.state import ATTITUDE, VELOCITY, WIND
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance, scale_kalman_gain
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import complete_attitude_jacobian
from fusetune.ekf2.filter.wind import (
    air_velocity,
    air_velocity_body,
    is_drag_enabled,
    keep_only_wind_gains,
    start_wind,
)
from fusetune.ekf2.numerics.constants import AIR_DENSITY_SEA_LEVEL, FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release

MIN_AIR_DENSITY = 0.1
MIN_OBSERVATION_VARIANCE = 0.5
DRAG_GATE = 5.0
LEAST_SLOPE = 0.1


@kernel
def momentum_drag_coefficient(ekf, params):
    """Momentum drag (1/s) at the present air density."""
    rho = max(ekf.air_density, MIN_AIR_DENSITY)
    return max(params.EKF2_MCOEF * math.sqrt(rho / AIR_DENSITY_SEA_LEVEL), 0.0)


@kernel
def inverse_ballistic_coefficients(params, bx, by):
    """1/C (m²/kg) of both axes for air coming along (bx, by); an axis with C ≤ 1 has none.

    Where both are given, drag is an ellipse over the direction of the air, the same for both axes.
    """
    inverse_x = 1.0 / params.EKF2_BCOEF_X if params.EKF2_BCOEF_X > 1.0 else 0.0
    inverse_y = 1.0 / params.EKF2_BCOEF_Y if params.EKF2_BCOEF_Y > 1.0 else 0.0
    if inverse_x > 0.0 and inverse_y > 0.0:
        speed = math.sqrt(bx * bx + by * by)
        inverse_x = math.sqrt((inverse_x * bx / speed) ** 2 + (inverse_y * by / speed) ** 2)
        inverse_y = inverse_x
    return inverse_x, inverse_y


@kernel
def predict_drag(ekf, axis, rho, inverse_bcoef, mcoef):
    """Specific force (m/s²) along body axis 0 or 1."""
    b = air_velocity_body(ekf)
    speed = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    return -0.5 * inverse_bcoef * rho * b[axis] * speed - mcoef * b[axis]


@kernel
def compute_drag_jacobian(ekf, axis, rho, inverse_bcoef, mcoef, H):
    """Write the derivative of `predict_drag`, at a given coefficient, into `H` (24,)."""
    R = ekf.R_to_earth
    x, y, z = air_velocity(ekf)
    b = air_velocity_body(ekf)
    speed = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2] + FLT_EPSILON)
    bluff = -0.5 * rho * inverse_bcoef
    # by the air velocity: along the axis itself, and along the air through the speed; the latter turns with the air,
    # so the attitude error acts through the first alone
    own = bluff * speed - mcoef
    through_speed = bluff * b[axis] / speed
    ax, ay, az = own * R[0, axis], own * R[1, axis], own * R[2, axis]
    clear_jacobian(H)
    H[ATTITUDE] = ay * z - az * y
    H[ATTITUDE + 1] = az * x - ax * z
    H[ATTITUDE + 2] = ax * y - ay * x
    H[VELOCITY] = ax + through_speed * x
    H[VELOCITY + 1] = ay + through_speed * y
    H[VELOCITY + 2] = az + through_speed * z
    H[WIND] = -H[VELOCITY]
    H[WIND + 1] = -H[VELOCITY + 1]
    # the air along the axis grows with the square of the quaternion's norm, and so does the speed
    complete_attitude_jacobian(ekf, H, 2.0 * b[axis] * (own + bluff * speed))


@kernel
def _at_any_time(ekf):
    return True


@kernel
def _while_flying(ekf):
    return ekf.cs.in_air and not ekf.cs.fake_pos


_is_drag_judged = by_release(_at_any_time, "feels_drag_in_air", _while_flying)


@kernel
def _move_every_state(ekf):
    """Since v1.15 what is observed of the air corrects the motion, too."""


@kernel
def _move_wind_alone(ekf):
    keep_only_wind_gains(ekf.scratch.K)


_choose_gains = by_release(_move_every_state, "feels_drag_in_air", _move_wind_alone)


@kernel
def _fuse_by_model(ekf, params):
    aid, drag = ekf.aid.drag, ekf.drag
    using_mcoef = params.EKF2_MCOEF > 0.001
    using_bcoef = (params.EKF2_BCOEF_X > 1.0, params.EKF2_BCOEF_Y > 1.0)
    if not using_bcoef[0] and not using_bcoef[1] and not using_mcoef:
        return
    R_acc = max(params.EKF2_DRAG_NOISE, MIN_OBSERVATION_VARIANCE)
    rho = max(ekf.air_density, MIN_AIR_DENSITY)
    mcoef = momentum_drag_coefficient(ekf, params)
    b = air_velocity_body(ekf)
    inverse_bcoef = inverse_ballistic_coefficients(params, b[0], b[1])
    predicted = (
        predict_drag(ekf, 0, rho, inverse_bcoef[0], mcoef),
        predict_drag(ekf, 1, rho, inverse_bcoef[1], mcoef),
    )
    for axis in range(2):
        compute_drag_jacobian(ekf, axis, rho, inverse_bcoef[axis], mcoef, drag.H[axis])
    both_fused = True
    for axis in range(2):
        measured = ekf.sensors.drag.sample.accel_xy[axis] - accel_bias(ekf)[axis]
        innovation = predicted[axis] - measured
        innovation_variance = compute_innovation_variance(ekf, drag.H[axis], R_acc)
        set_axis(aid, axis, measured, R_acc, innovation, innovation_variance)
        if not using_bcoef[axis] and not using_mcoef:
            both_fused = False
            continue
        if innovation_variance < R_acc:
            return
        test_ratio = innovation * innovation / (DRAG_GATE * DRAG_GATE * innovation_variance)
        if ekf.cs.in_air and ekf.cs.wind and not ekf.cs.fake_pos and test_ratio < 1.0:
            scale_kalman_gain(ekf, innovation_variance)
            _choose_gains(ekf)
            both_fused = measurement_update(ekf, params, R_acc, innovation) and both_fused
        else:
            both_fused = False
    update_aid_source_status(ekf, aid, 2, ekf.sensors.drag.sample.time_us, DRAG_GATE)
    if _counts_as_fused(ekf, both_fused):
        aid.fused = True
        aid.time_last_fuse = ekf.time_delayed_us


@kernel
def _drag_slope(ekf, rho, inverse_bcoef, mcoef, force):
    """How the drag grows with the air speed (1/s), at the speed at which the model has the measured force (m/s²)."""
    if inverse_bcoef > 0.0:
        air = (math.sqrt(mcoef * mcoef + 2.0 * rho * inverse_bcoef * abs(force)) - mcoef) / (rho * inverse_bcoef)
        return max(rho * inverse_bcoef * air + mcoef, LEAST_SLOPE)
    return max(mcoef, LEAST_SLOPE)


@kernel
def _fuse_by_slope(ekf, params):
    """Each axis by itself, linear in the air along it, into the wind alone."""
    aid, H, rho = ekf.aid.drag, ekf.drag.H[0], max(ekf.air_density, MIN_AIR_DENSITY)
    noise = max(params.EKF2_DRAG_NOISE, MIN_OBSERVATION_VARIANCE)
    mcoef = 0.0
    if params.EKF2_MCOEF > 0.001:
        mcoef = params.EKF2_MCOEF * math.sqrt(rho / AIR_DENSITY_SEA_LEVEL)
    air = air_velocity_body(ekf)
    coefficients = (params.EKF2_BCOEF_X, params.EKF2_BCOEF_Y)
    judged = False
    for axis in range(2):
        inverse_bcoef = 1.0 / coefficients[axis] if coefficients[axis] > 1.0 else 0.0
        if inverse_bcoef == 0.0 and mcoef == 0.0:
            continue
        force = ekf.sensors.drag.sample.accel_xy[axis] - accel_bias(ekf)[axis]
        slope = _drag_slope(ekf, rho, inverse_bcoef, mcoef, force)
        compute_drag_jacobian(ekf, axis, rho, 0.0, slope, H)
        innovation_variance = compute_innovation_variance(ekf, H, noise)
        innovation = -0.5 * inverse_bcoef * rho * air[axis] * abs(air[axis]) - air[axis] * mcoef - force
        set_axis(aid, axis, force, noise, innovation, innovation_variance)
        if innovation_variance < noise:
            return
        judged = True
        if innovation * innovation <= DRAG_GATE * DRAG_GATE * innovation_variance:
            scale_kalman_gain(ekf, innovation_variance)
            keep_only_wind_gains(ekf.scratch.K)
            measurement_update(ekf, params, noise, innovation)
    if judged:
        update_aid_source_status(ekf, aid, 2, ekf.sensors.drag.sample.time_us, DRAG_GATE)
        aid.fused = not aid.innovation_rejected
        aid.time_last_fuse = ekf.time_delayed_us


_fuse_drag = by_release(_fuse_by_model, "linearises_drag_by_force", _fuse_by_slope)


@kernel
def _always(ekf, both_fused):
    return True


@kernel
def _where_both_were(ekf, both_fused):
    return both_fused


_counts_as_fused = by_release(_always, "fuses_both_drag_axes", _where_both_were)


@kernel
def _is_any_heading(ekf):
    return True


@kernel
def _was_field_usable(ekf):
    """Not while the magnetometer could not be used for so long that the yaw is to be reset."""
    return not ekf.mag_modes.inhibited_for_long


_is_heading_good = by_release(_is_any_heading, "linearises_drag_by_force", _was_field_usable)


@kernel
def _is_due(ekf):
    return ekf.sensors.drag.data_ready


@kernel
def _is_due_or_waits(ekf):
    """What comes due on the ground is taken once in the air, unless it is too old."""
    waits = ekf.drag_waits and horizon_us(ekf) < ekf.sensors.drag.sample.time_us + MAX_SAMPLE_AGE_US
    at_hand = ekf.sensors.drag.data_ready or waits
    ekf.drag_waits = at_hand and not _while_flying(ekf)
    return at_hand


_is_sample_at_hand = by_release(_is_due, "feels_drag_in_air", _is_due_or_waits)


@kernel
def control_drag_fusion(ekf, params):
    """Estimate the wind from drag while `EKF2_DRAG_CTRL` asks for it."""
    if not is_drag_enabled(ekf, params) or not ekf.sensors.drag.exists or not _is_heading_good(ekf):
        return
    if not ekf.cs.wind and not ekf.cs.fake_pos and ekf.cs.in_air:
        ekf.cs.wind = True
        start_wind(ekf)
    if _is_sample_at_hand(ekf) and _is_drag_judged(ekf):
        _fuse_drag(ekf, params)
