"""Resets of the earth and body field states, and the end of magnetometer fusion.

Mirrors the resets of PX4 v1.16 `EKF/aid_sources/magnetometer/mag_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import reset_mag_heading
from fusetune.ekf2.filter.common.conditions import get_terrain_vpos, is_north_east_aiding_active
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.covariance import reset_mag_bias_cov, reset_mag_earth_cov
from fusetune.ekf2.filter.field_covariance import reset_field_covariance
from fusetune.ekf2.filter.source_stops.heading_and_field import (
    clear_heading_and_field,
    clear_mag_faults,
    stop_heading_and_field,
)
from fusetune.ekf2.filter.world_field import is_wmm_field_known
from fusetune.ekf2.filter.yaw_estimator.converged_yaw import is_yaw_emergency_estimate_available
from fusetune.ekf2.numerics.rotations import component_in_body, euler_yaw, rotate_to_earth
from fusetune.ekf2.releases.by_release import by_release

EARTH_FIELD_MIN_CHANGE = 0.01
MAG_ANOMALIES_MAX_HAGL = 1.5


@kernel
def reset_mag_body_to_zero(ekf, params):
    """Forget the body field."""
    ekf.mag_B[:] = 0.0
    reset_mag_bias_cov(ekf, params)


@kernel
def move_earth_field_to(ekf, params, north, east, down):
    """Set the earth field (Gauss) unless it is within 0.01 Gauss already; return whether it moved."""
    distance = math.sqrt((ekf.mag_I[0] - north) ** 2 + (ekf.mag_I[1] - east) ** 2 + (ekf.mag_I[2] - down) ** 2)
    if distance <= EARTH_FIELD_MIN_CHANGE:
        return False
    ekf.mag_I[0] = north
    ekf.mag_I[1] = east
    ekf.mag_I[2] = down
    reset_mag_earth_cov(ekf, params)
    return True


@kernel
def reset_mag_states_to_wmm(ekf, params, mag, reset_heading):
    """Earth field from the world magnetic model; the body field explains the rest of `mag`, unless yaw is reset too."""
    field = ekf.mag.wmm_earth_field
    moved = move_earth_field_to(ekf, params, field[0], field[1], field[2])
    if not reset_heading and ekf.cs.yaw_align:
        if moved:
            R = ekf.R_to_earth
            for axis in range(3):
                ekf.mag_B[axis] = mag[axis] - component_in_body(R, axis, field[0], field[1], field[2])
            reset_mag_bias_cov(ekf, params)
    else:
        reset_mag_body_to_zero(ekf, params)
    if reset_heading:
        reset_mag_heading(ekf, params, mag)


@kernel
def reset_mag_states_to_measurement(ekf, params, mag, reset_heading):
    """Earth field from the measurement turned into NED, body field zero."""
    reset_mag_body_to_zero(ekf, params)
    if reset_heading:
        reset_mag_heading(ekf, params, mag)
    north, east, down = rotate_to_earth(ekf.R_to_earth, mag[0], mag[1], mag[2])
    move_earth_field_to(ekf, params, north, east, down)


@kernel
def _reset_mag_states(ekf, params, mag, reset_heading):
    """Reset field states (and yaw, if asked) from the filtered measurement `mag` (body frame, Gauss)."""
    if is_wmm_field_known(ekf):
        reset_mag_states_to_wmm(ekf, params, mag, reset_heading)
    else:
        reset_mag_states_to_measurement(ekf, params, mag, reset_heading)
    if ekf.cs.in_air and _aligns_field(ekf, reset_heading):
        ekf.cs.mag_aligned_in_flight = True
        ekf.mag.flt_mag_align_start_time = horizon_us(ekf)


@kernel
def put_body_field(ekf, mag, turn):
    """The body field explains what `mag` is more than the model's field, at a yaw that is greater by `turn` (rad)."""
    field, c, s = ekf.mag.wmm_earth_field, math.cos(turn), math.sin(turn)
    north, east = c * field[0] + s * field[1], c * field[1] - s * field[0]
    for axis in range(3):
        ekf.mag_B[axis] = mag[axis] - component_in_body(ekf.R_to_earth, axis, north, east, field[2])


@kernel
def _reset_mag_states_by_yaw_estimator(ekf, params, mag, reset_heading):
    """As v1.16's, always with both covariances; where the yaw estimator has converged, the body field follows from it.

    Mirrors `resetMagStates` of PX4 v1.15 `EKF/mag_control.cpp`.
    """
    reset_field_covariance(ekf, params)
    ekf.mag_B[:] = 0.0
    if is_wmm_field_known(ekf):
        if is_yaw_emergency_estimate_available(ekf):
            put_body_field(ekf, mag, ekf.gsf.yaw - euler_yaw(ekf.R_to_earth))
        elif not reset_heading and ekf.cs.yaw_align:
            put_body_field(ekf, mag, 0.0)
        for axis in range(3):
            ekf.mag_I[axis] = ekf.mag.wmm_earth_field[axis]
        if reset_heading:
            reset_mag_heading(ekf, params, mag)
        ekf.field_history.declination_fused = True
    else:
        if reset_heading:
            reset_mag_heading(ekf, params, mag)
        ekf.mag_I[0], ekf.mag_I[1], ekf.mag_I[2] = rotate_to_earth(ekf.R_to_earth, mag[0], mag[1], mag[2])
    if ekf.cs.in_air:
        ekf.cs.mag_aligned_in_flight = True
        ekf.mag.flt_mag_align_start_time = horizon_us(ekf)


reset_mag_states = by_release(_reset_mag_states, "puts_body_field_by_yaw_estimator", _reset_mag_states_by_yaw_estimator)
"""Reset field states (and yaw, if asked) from the filtered measurement (body frame, Gauss)."""


@kernel
def _by_any_reset(ekf, reset_heading):
    return True


@kernel
def _by_heading_reset(ekf, reset_heading):
    return reset_heading


@kernel
def _by_climb_alone(ekf, reset_heading):
    return False


_aligns_field = by_release(
    by_release(_by_any_reset, "aligns_field_with_heading", _by_heading_reset), "aligns_field_on_climb", _by_climb_alone
)
"""Whether a reset in flight aligns the field."""


@kernel
def check_hagl_yaw_reset_req(ekf):
    """Whether the vehicle has just climbed clear (1.5 m) of what disturbs the field near the ground."""
    if not _may_ask_for_yaw_reset(ekf):
        return False
    if not (ekf.cs.in_air and ekf.cs.yaw_align) or ekf.cs.mag_aligned_in_flight:
        return False
    return get_terrain_vpos(ekf) + ekf.gpos_alt > MAG_ANOMALIES_MAX_HAGL


@kernel
def _always(ekf):
    return True


@kernel
def _is_heading_fused(ekf):
    return ekf.cs.mag_hdg or ekf.cs.mag_3d


_may_ask_for_yaw_reset = by_release(_always, "aligns_field_with_heading", _is_heading_fused)


@kernel
def _forget_field_and_yaw(ekf, params):
    """What is known of the field is forgotten; yaw stays aligned only if horizontal aiding keeps it observable."""
    reset_field_covariance(ekf, params)
    if ekf.cs.yaw_align and (ekf.cs.mag_3d or ekf.cs.mag_hdg) and not is_north_east_aiding_active(ekf):
        ekf.cs.yaw_align = False
    ekf.cs.mag_aligned_in_flight = False


@kernel
def _forget_nothing(ekf, params):
    """Covariance and alignment remain as they are."""


_forget_field = by_release(_forget_field_and_yaw, "counts_field_resets", _forget_nothing)


@kernel
def _stop_mag_fusion(ekf, params):
    """Stop using the magnetometer."""
    if not ekf.cs.mag:
        return
    _forget_field(ekf, params)
    if ekf.cs.mag_hdg:
        ekf.fs.bad_hdg = False
    ekf.cs.mag = False
    ekf.cs.mag_dec = False
    ekf.cs.mag_3d = False
    ekf.cs.mag_hdg = False
    clear_mag_faults(ekf)
    ekf.fs.bad_mag_decl = False


stop_mag_fusion = by_release(
    by_release(_stop_mag_fusion, "fuses_heading_or_field", stop_heading_and_field),
    "clears_field_whenever_stopped",
    clear_heading_and_field,
)
"""Stop using the magnetometer."""
