"""What GNSS of v1.14 does at each update: checks are long done, and say whether it is trusted.

Mirrors PX4 v1.14 `EKF/gps_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import is_gnss_distrusted, is_gnss_trusted
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_HPOS, GPS_CTRL_VEL
from fusetune.ekf2.filter.aid_sources.gnss.gnss_position import (
    reset_horizontal_position_to_gnss,
    stop_gnss_pos_fusion,
    update_gnss_position,
)
from fusetune.ekf2.filter.aid_sources.gnss.gnss_velocity import (
    needs_velocity_reset,
    reset_velocity_to_gnss,
    stop_gnss_vel_fusion,
    update_gnss_velocity,
    velocity_of_antenna_offset,
)
from fusetune.ekf2.filter.aid_sources.gnss.gnss_yaw_control import control_gnss_yaw_fusion
from fusetune.ekf2.filter.aid_sources.gnss.gps_control import has_yaw_failed, should_reset_gnss_fusion
from fusetune.ekf2.filter.aid_sources.gnss.yaw_emergency import reset_yaw_to_ekf_gsf
from fusetune.ekf2.filter.common.conditions import is_other_source_of_horizontal_aiding_than
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_3D, MAG_TYPE_NONE
from fusetune.ekf2.filter.common.timing import GNSS_MAX_INTERVAL, is_newest_sample_recent
from fusetune.ekf2.filter.position_fusion import fuse_horizontal_position
from fusetune.ekf2.filter.source_stops.yaw import stop_ev_yaw_fusion, stop_gnss_yaw_fusion
from fusetune.ekf2.filter.velocity_fusion import fuse_velocity
from fusetune.ekf2.filter.yaw_estimator.matrix_bank import run_matrix_bank_in_air, tell_matrix_bank_velocity

LONGEST_SILENCE_US = 10_000_000
LONGEST_SILENCE_WITH_OTHERS_US = 1_000_000


@kernel
def control_arrived_gnss_fusion(ekf, params):
    """Run GNSS for one update, with the sample in `ekf.sensors.gnss.sample` if `ekf.sensors.gnss.data_ready`."""
    gnss = ekf.sensors.gnss
    if not gnss.exists or int(params.EKF2_GPS_CTRL) & (GPS_CTRL_HPOS | GPS_CTRL_VEL) == 0:
        stop_arrived_gnss(ekf)
        return
    ekf.gnss.intermittent = not is_newest_sample_recent(ekf, gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL)
    if is_fusion_due(gnss):
        tell_yaw_estimator(ekf, params, gnss.sample)
    run_matrix_bank_in_air(ekf, ekf.imu_delayed, ekf.cs.in_air)

    if gnss.data_ready:
        if is_fusion_due(gnss):
            control_gnss_yaw_fusion(ekf, params, gnss.sample)
        update_gnss_velocity(ekf, params, gnss.sample)
        update_gnss_position(ekf, params, gnss.sample)
        if is_fusion_due(gnss):
            _control_with_sample(ekf, params)
    elif ekf.cs.gnss_pos and (
        not is_newest_sample_recent(ekf, gnss.newest_time_us, LONGEST_SILENCE_US)
        or (
            not is_newest_sample_recent(ekf, gnss.newest_time_us, LONGEST_SILENCE_WITH_OTHERS_US)
            and is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.gnss_pos)
        )
    ):
        stop_arrived_gnss(ekf)


@kernel
def tell_yaw_estimator(ekf, params, sample):
    """Give the yaw estimator a velocity whose accuracy is known and within EKF2_REQ_SACC."""
    offset_n, offset_e, _ = velocity_of_antenna_offset(ekf, params)
    north, east = sample.vel[0] - offset_n, sample.vel[1] - offset_e
    if 0.0 < sample.sacc < params.EKF2_REQ_SACC and math.isfinite(north + east + sample.vel[2]):
        tell_matrix_bank_velocity(ekf, north, east, max(sample.sacc, params.EKF2_GPS_V_NOISE))


@kernel
def _control_with_sample(ekf, params):
    """Start, continue or stop; without another source GNSS goes on even while it is distrusted."""
    cs, trusted, distrusted = ekf.cs, is_gnss_trusted(ekf), is_gnss_distrusted(ekf)
    if cs.tilt_align and ekf.origin.valid and trusted and not distrusted and not cs.yaw_align:
        _let_mag_align(ekf, params)
    mandatory = cs.tilt_align and cs.yaw_align and ekf.origin.valid
    if cs.gnss_pos:
        if mandatory and (not distrusted or not is_other_source_of_horizontal_aiding_than(ekf, cs.gnss_pos)):
            _fuse_or_reset(ekf, params)
        else:
            stop_arrived_gnss(ekf)
    elif mandatory and trusted and not distrusted:
        if cs.ev_yaw:
            stop_ev_yaw_fusion(ekf)
            ekf.gnss_arrivals.inhibits_ev_yaw = True
        ekf.events.starting_gps_fusion = True
        if needs_velocity_reset(ekf):
            reset_velocity_to_gnss(ekf, params)
        reset_horizontal_position_to_gnss(ekf, params)
        cs.gnss_vel, cs.gnss_pos = True, True
    elif trusted and not cs.yaw_align and int(params.EKF2_MAG_TYPE) == MAG_TYPE_NONE:
        if reset_yaw_to_ekf_gsf(ekf, params):
            reset_velocity_to_gnss(ekf, params)
            reset_horizontal_position_to_gnss(ekf, params)


@kernel
def _let_mag_align(ekf, params):
    """Where vision alone keeps the yaw from being aligned to north, let the magnetometer do so."""
    mag_usable = (
        int(params.EKF2_MAG_TYPE) <= MAG_TYPE_3D
        and ekf.mag.counter != 0
        and not ekf.cs.mag_field_disturbed
        and not ekf.cs.mag_fault
    )
    if ekf.cs.ev_yaw and mag_usable:
        stop_ev_yaw_fusion(ekf)


@kernel
def _fuse_or_reset(ekf, params):
    control = int(params.EKF2_GPS_CTRL)
    if control & GPS_CTRL_VEL != 0:
        fuse_velocity(ekf, params, ekf.aid.gnss_vel)
    if control & GPS_CTRL_HPOS != 0:
        fuse_horizontal_position(ekf, params, ekf.aid.gnss_pos)
    due = should_reset_gnss_fusion(ekf, params)
    if has_yaw_failed(ekf) and reset_yaw_to_ekf_gsf(ekf, params):
        due = True
    if due:
        reset_velocity_to_gnss(ekf, params)
        reset_horizontal_position_to_gnss(ekf, params)


@kernel
def stop_arrived_gnss(ekf):
    """Stop velocity, position and heading; vision may give the yaw again."""
    stop_gnss_vel_fusion(ekf)
    stop_gnss_pos_fusion(ekf)
    stop_gnss_yaw_fusion(ekf)
    ekf.gnss_arrivals.inhibits_ev_yaw = False
