"""GNSS horizontal position: observation at the IMU, and its fusion.

Mirrors the position part of PX4 v1.16 `EKF/aid_sources/gnss/gps_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.antenna_offset import antenna_offset_body
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_HPOS, forget_checks, have_checks_passed
from fusetune.ekf2.filter.aid_sources.gnss.gnss_resets import is_gnss_reset_allowed, may_start_without_reset
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import (
    get_number_of_active_horizontal_position_aiding_sources,
    is_other_source_of_horizontal_aiding_than,
    is_other_source_than,
)
from fusetune.ekf2.filter.common.local_origin import get_local_horizontal_position, project_to_local
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import RESET_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.position_fusion import fuse_horizontal_position
from fusetune.ekf2.filter.resets.origin_resets import reset_lat_lon_to
from fusetune.ekf2.filter.resets.state_resets import reset_local_horizontal_position_to
from fusetune.ekf2.numerics.geodesy import add_to_lat_lon, lat_lon_difference
from fusetune.ekf2.numerics.rotations import rotate_to_earth
from fusetune.ekf2.releases.by_release import by_release

MIN_NOISE = 0.01


@kernel
def _update_global_position(ekf, params, sample):
    """Judge a position sample, moved from the antenna to the IMU; its observation is latitude and longitude (deg)."""
    x, y, z = antenna_offset_body(params)
    offset_n, offset_e, _ = rotate_to_earth(ekf.R_to_earth, x, y, z)
    lat, lon = add_to_lat_lon(
        math.radians(sample.lat_deg), math.radians(sample.lon_deg), sample.alt, -offset_n, -offset_e
    )
    innovation_n, innovation_e = lat_lon_difference(ekf.gpos_lat, ekf.gpos_lon, ekf.gpos_alt, lat, lon)
    _judge_position(ekf, params, sample, math.degrees(lat), math.degrees(lon), innovation_n, innovation_e)


@kernel
def _update_local_position(ekf, params, sample):
    """As v1.16's, but its observation is north and east (m) of the origin, where that is known."""
    if not ekf.origin.lat_lon_valid:
        return
    x, y, z = antenna_offset_body(params)
    offset_n, offset_e, _ = rotate_to_earth(ekf.R_to_earth, x, y, z)
    north, east = project_to_local(ekf, math.radians(sample.lat_deg), math.radians(sample.lon_deg))
    north, east = north - offset_n, east - offset_e
    at_n, at_e = get_local_horizontal_position(ekf)
    _judge_position(ekf, params, sample, north, east, at_n - north, at_e - east)


@kernel
def _update_arrived_position(ekf, params, sample):
    """As v1.15's, with the place that the sample had as it arrived."""
    x, y, z = antenna_offset_body(params)
    offset_n, offset_e, _ = rotate_to_earth(ekf.R_to_earth, x, y, z)
    north, east = ekf.gnss_arrivals.north - offset_n, ekf.gnss_arrivals.east - offset_e
    at_n, at_e = get_local_horizontal_position(ekf)
    _judge_position(ekf, params, sample, north, east, at_n - north, at_e - east)


update_gnss_position = by_release(
    by_release(_update_global_position, "keeps_position_local", _update_local_position),
    "checks_gnss_on_arrival",
    _update_arrived_position,
)


@kernel
def _judge_position(ekf, params, sample, first, second, innovation_n, innovation_e):
    """Judge the innovations (m); `first` and `second` are the observation, in the unit that is told."""
    aid = ekf.aid.gnss_pos
    noise = max(sample.hacc, params.EKF2_GPS_P_NOISE)
    # as the only thing that bounds attitude errors, the position must keep some weight
    if not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.gnss_pos):
        noise = min(noise, params.EKF2_NOAID_NOISE)
    variance = max(noise * noise, MIN_NOISE * MIN_NOISE)
    set_axis(aid, 0, first, variance, innovation_n, ekf.P[POSITION, POSITION] + variance)
    set_axis(aid, 1, second, variance, innovation_e, ekf.P[POSITION + 1, POSITION + 1] + variance)
    update_aid_source_status(ekf, aid, 2, sample.time_us, max(params.EKF2_GPS_P_GATE, 1.0))


@kernel
def _control_gnss_pos_fusion(ekf, params, force_reset):
    """Start, continue or stop fusing GNSS position with the sample just judged; the first good one sets the origin."""
    enabled = int(params.EKF2_GPS_CTRL) & GPS_CTRL_HPOS != 0
    continuing = enabled and ekf.cs.tilt_align and ekf.cs.yaw_align
    if ekf.cs.gnss_pos and not continuing:
        stop_gnss_pos_fusion(ekf)
    elif ekf.cs.gnss_pos and force_reset:
        reset_horizontal_position_to_gnss(ekf, params)
    elif ekf.cs.gnss_pos:
        fuse_horizontal_position(ekf, params, ekf.aid.gnss_pos)
    elif continuing and have_checks_passed(ekf):
        ekf.events.starting_gps_fusion = True
        reset_horizontal_position_to_gnss(ekf, params)
        ekf.cs.gnss_pos = True
    elif enabled and have_checks_passed(ekf) and not ekf.origin.lat_lon_valid:
        reset_horizontal_position_to_gnss(ekf, params)


@kernel
def _control_gnss_pos_fusion_apart(ekf, params, force_reset):
    """As v1.16's, but position starts without a reset where it agrees, and minds when it was fused itself."""
    aid, trust = ekf.aid.gnss_pos, ekf.gnss_trust
    enabled = int(params.EKF2_GPS_CTRL) & GPS_CTRL_HPOS != 0
    continuing = enabled and ekf.cs.tilt_align and ekf.cs.yaw_align and not trust.height_fault
    places_origin = enabled and trust.passed and not ekf.origin.lat_lon_valid
    if ekf.cs.gnss_pos:
        if not continuing:
            stop_gnss_pos_fusion(ekf)
            return
        fuse_horizontal_position(ekf, params, aid)
        if force_reset or is_timed_out(ekf, aid.time_last_fuse, RESET_TIMEOUT_MAX):
            if is_gnss_reset_allowed(ekf, params, _is_position_aided_otherwise(ekf), ekf.cs.gnss_pos):
                reset_horizontal_position_to_gnss(ekf, params)
            else:
                stop_gnss_pos_fusion(ekf)
                trust.fault = True
    elif continuing and trust.passed:
        fused = False
        if ekf.origin.lat_lon_valid and may_start_without_reset(ekf, aid, force_reset):
            fused = fuse_horizontal_position(ekf, params, aid)
        reset = places_origin or (
            not fused and is_gnss_reset_allowed(ekf, params, _is_position_aided_otherwise(ekf), ekf.cs.gnss_pos)
        )
        if reset:
            reset_horizontal_position_to_gnss(ekf, params)
        if fused or reset:
            ekf.events.starting_gps_fusion = True
            ekf.cs.gnss_pos = True
            trust.fault = False
    elif places_origin:
        reset_horizontal_position_to_gnss(ekf, params)


@kernel
def _is_position_aided_otherwise(ekf):
    return is_other_source_than(get_number_of_active_horizontal_position_aiding_sources(ekf), ekf.cs.gnss_pos)


control_gnss_pos_fusion = by_release(
    _control_gnss_pos_fusion, "controls_gnss_sources_apart", _control_gnss_pos_fusion_apart
)


@kernel
def _reset_global_position(ekf, params):
    """Set the position to the last GNSS position; both axes get the sum of the two variances."""
    ekf.events.reset_pos_to_gps = True
    aid = ekf.aid.gnss_pos
    reset_lat_lon_to(
        ekf,
        params,
        math.radians(aid.observation[0]),
        math.radians(aid.observation[1]),
        aid.observation_variance[0] + aid.observation_variance[1],
    )
    reset_aid_source_status_zero_innovation(ekf, aid, 2)


@kernel
def _reset_local_position(ekf, params):
    """As v1.16's, but each axis gets its own variance."""
    ekf.events.reset_pos_to_gps = True
    aid = ekf.aid.gnss_pos
    reset_local_horizontal_position_to(
        ekf, params, aid.observation[0], aid.observation[1], aid.observation_variance[0], aid.observation_variance[1]
    )
    reset_aid_source_status_zero_innovation(ekf, aid, 2)


reset_horizontal_position_to_gnss = by_release(_reset_global_position, "keeps_position_local", _reset_local_position)


@kernel
def stop_gnss_pos_fusion(ekf):
    """Stop fusing position; with velocity stopped, too, the quality checks start anew."""
    if ekf.cs.gnss_pos:
        ekf.cs.gnss_pos = False
        forget_aid_source_status(ekf, ekf.aid.gnss_pos, 2)
        if not ekf.cs.gnss_vel:
            forget_checks(ekf)
