"""GNSS horizontal position: observation at the IMU, and its fusion."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.antenna_offset import antenna_offset_body, rotate_to_earth
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_HPOS
from fusetune.ekf2.filter.common.aid_source_status import (
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import is_other_source_of_horizontal_aiding_than
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.position_fusion import fuse_horizontal_position
from fusetune.ekf2.filter.resets.origin_resets import reset_lat_lon_to
from fusetune.ekf2.numerics.geodesy import add_to_lat_lon, lat_lon_difference

MIN_NOISE = 0.01


@kernel
def update_gnss_position(ekf, params, sample):
    """Judge a position sample, moved from the antenna to the IMU; its observation is latitude and longitude (deg)."""
    aid = ekf.aid.gnss_pos
    x, y, z = antenna_offset_body(params)
    offset_n, offset_e, _ = rotate_to_earth(ekf.R_to_earth, x, y, z)
    lat, lon = add_to_lat_lon(
        math.radians(sample.lat_deg), math.radians(sample.lon_deg), sample.alt, -offset_n, -offset_e
    )
    innovation_n, innovation_e = lat_lon_difference(ekf.gpos_lat, ekf.gpos_lon, ekf.gpos_alt, lat, lon)

    noise = max(sample.hacc, params.EKF2_GPS_P_NOISE)
    # as the only thing that bounds attitude errors, the position must keep some weight
    if not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.gnss_pos):
        noise = min(noise, params.EKF2_NOAID_NOISE)
    variance = max(noise * noise, MIN_NOISE * MIN_NOISE)
    set_axis(aid, 0, math.degrees(lat), variance, innovation_n, ekf.P[POSITION, POSITION] + variance)
    set_axis(aid, 1, math.degrees(lon), variance, innovation_e, ekf.P[POSITION + 1, POSITION + 1] + variance)
    update_aid_source_status(ekf, aid, 2, sample.time_us, max(params.EKF2_GPS_P_GATE, 1.0))


@kernel
def control_gnss_pos_fusion(ekf, params, force_reset):
    """Start, continue or stop fusing GNSS position with the sample just judged; the first good one sets the origin."""
    aid = ekf.aid.gnss_pos
    enabled = int(params.EKF2_GPS_CTRL) & GPS_CTRL_HPOS != 0
    continuing = enabled and ekf.cs.tilt_align and ekf.cs.yaw_align
    if ekf.cs.gnss_pos:
        if not continuing:
            stop_gnss_pos_fusion(ekf)
            return
        if force_reset:
            reset_horizontal_position_to_gnss(ekf, params)
        else:
            fuse_horizontal_position(ekf, params, aid)
    elif continuing and ekf.gnss.checks_passed:
        ekf.events.starting_gps_fusion = True
        reset_horizontal_position_to_gnss(ekf, params)
        ekf.cs.gnss_pos = True
    elif enabled and ekf.gnss.checks_passed and not ekf.origin.lat_lon_valid:
        reset_horizontal_position_to_gnss(ekf, params)


@kernel
def reset_horizontal_position_to_gnss(ekf, params):
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
def stop_gnss_pos_fusion(ekf):
    """Stop fusing position; with velocity stopped, too, the quality checks start anew."""
    if ekf.cs.gnss_pos:
        ekf.cs.gnss_pos = False
        if not ekf.cs.gnss_vel:
            ekf.gnss.last_fail_us = 0
            ekf.gnss.last_pass_us = 0
