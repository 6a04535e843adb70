"""Operator commands until v1.15: a new origin, and in v1.15 a position; nobody gives the wind.

Mirrors `setEkfGlobalOrigin` of PX4 v1.13 to v1.15 `EKF/ekf_helper.cpp`, `resetGlobalPosToExternalObservation` of v1.15
`EKF/ekf.cpp`, and their `EKF2.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_horizontal_aiding_active
from fusetune.ekf2.filter.common.local_origin import (
    get_global_horizontal_position,
    is_altitude_plausible,
    is_lat_lon_plausible,
    origin_altitude,
    project_to_local,
    set_origin_altitude,
    set_origin_lat_lon,
)
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to, reset_local_horizontal_position_to
from fusetune.ekf2.filter.world_field import take_field_of_place
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release

LEAST_RESET_M = 0.01
MAX_EXTERNAL_DELAY_S = 15.0
DEFAULT_EXTERNAL_ACCURACY_M = 50.0


@kernel
def move_origin_under_vehicle(ekf, params, lat, lon, altitude):
    """Put the origin elsewhere (rad, m); the vehicle stays where it is on the globe."""
    if not is_lat_lon_plausible(lat, lon) or not is_altitude_plausible(altitude):
        return
    is_placed = ekf.origin.lat_lon_valid and is_horizontal_aiding_active(ekf)
    place_lat, place_lon = get_global_horizontal_position(ekf)
    altitude_before = origin_altitude(ekf)
    set_origin_lat_lon(ekf, lat, lon)
    set_origin_altitude(ekf, altitude)
    _know_field(ekf, lat, lon)
    if is_placed:
        north, east = project_to_local(ekf, place_lat, place_lon)
        if math.hypot(north - ekf.local.north, east - ekf.local.east) > LEAST_RESET_M:
            reset_local_horizontal_position_to(ekf, params, north, east, math.nan, math.nan)
    if abs(altitude - altitude_before) > LEAST_RESET_M:
        bias = ekf.gps_hgt_b_est.bias
        reset_altitude_to(ekf, params, ekf.gpos_alt + altitude_before - altitude, math.nan)
        ekf.gps_hgt_b_est.bias = bias


@kernel
def _move_origin_of_aided(ekf, params, lat, lon, altitude):
    """v1.13 does so on the ground alone, and only if it is aided moves the vehicle along."""
    if ekf.cs.in_air:
        return
    is_placed = ekf.origin.lat_lon_valid and is_horizontal_aiding_active(ekf)
    place_lat, place_lon = get_global_horizontal_position(ekf)
    height = ekf.gpos_alt + origin_altitude(ekf)
    set_origin_lat_lon(ekf, lat, lon)
    set_origin_altitude(ekf, altitude)
    if is_placed:
        north, east = project_to_local(ekf, place_lat, place_lon)
        reset_local_horizontal_position_to(ekf, params, north, east, math.nan, math.nan)
        reset_altitude_to(ekf, params, height - altitude, math.nan)


move_local_origin = by_release(move_origin_under_vehicle, "moves_origin_on_ground_alone", _move_origin_of_aided)


@kernel
def _leave_field(ekf, lat, lon):
    """v1.14 looks it up by the fixes of GNSS alone."""


@kernel
def _take_field(ekf, lat, lon):
    take_field_of_place(ekf, math.degrees(lat), math.degrees(lon))


_know_field = by_release(_leave_field, "resets_to_given_position", _take_field)


@kernel
def _take_no_position(ekf, params, message):
    """Before v1.15 nobody gives one."""


@kernel
def _reset_to_position(ekf, params, message):
    """Reset to a position that is given while dead reckoning, carried on to the horizon by the present velocity."""
    p = message.param
    if not (ekf.cs.wind_dead_reckoning or ekf.cs.inertial_dead_reckoning) or not ekf.origin.lat_lon_valid:
        return
    if not (math.isfinite(p[1]) and math.isfinite(p[4]) and math.isfinite(p[5])):
        return
    delay_us = int(min(max(p[1], 0.0), MAX_EXTERNAL_DELAY_S) * 1e6)
    accuracy = p[2] if math.isfinite(p[2]) and p[2] > FLT_EPSILON else DEFAULT_EXTERNAL_ACCURACY_M
    dt = (ekf.time_delayed_us - min(message.timestamp - delay_us, ekf.time_latest_us)) * 1e-6
    north, east = project_to_local(ekf, math.radians(p[4]), math.radians(p[5]))
    variance = accuracy * accuracy
    ekf.events.reset_pos_to_ext_obs = True
    reset_local_horizontal_position_to(ekf, params, north + ekf.vel[0] * dt, east + ekf.vel[1] * dt, variance, variance)


take_given_position = by_release(_take_no_position, "resets_to_given_position", _reset_to_position)
