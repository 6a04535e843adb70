"""What GNSS of v1.13 does at each update, where EKF2_AID_MASK asks for it.

Horizontal velocity, vertical velocity and position are gated each by itself, and judged only where they are fused.

Mirrors PX4 v1.13 `EKF/gps_control.cpp` and `EKF/gps_fusion.cpp`, and the resets of `EKF/ekf_helper.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.external_vision.vision_by_mask import reset_position_to_vision
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import is_gnss_distrusted, is_gnss_trusted
from fusetune.ekf2.filter.aid_sources.gnss.gnss_yaw_by_mask import control_gnss_yaw_by_mask
from fusetune.ekf2.filter.aid_sources.gnss.yaw_emergency import reset_yaw_to_ekf_gsf
from fusetune.ekf2.filter.common.aid_mask import MASK_GNSS, MASK_ROTATE
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import is_other_source_of_horizontal_aiding_than
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_NONE
from fusetune.ekf2.filter.common.local_origin import get_local_horizontal_position
from fusetune.ekf2.filter.common.state import POSITION, VELOCITY
from fusetune.ekf2.filter.common.timing import RESET_TIMEOUT_MAX, horizon_us, is_recent, is_timed_out
from fusetune.ekf2.filter.measurement_update import fuse_direct_state
from fusetune.ekf2.filter.one_height_source import start_baro_height
from fusetune.ekf2.filter.resets.state_resets import (
    reset_horizontal_velocity_to,
    reset_local_horizontal_position_to,
    reset_vertical_velocity_to,
)
from fusetune.ekf2.filter.source_stops.yaw import stop_gnss_yaw_fusion
from fusetune.ekf2.filter.vertical_innovations import fuse_vertical_velocity_apart
from fusetune.ekf2.filter.yaw_estimator.converged_yaw import is_yaw_failure

LEAST_NOISE = 0.01
VERTICAL_NOISE_RATIO = 1.5
LONGEST_SILENCE_US = 10_000_000
LONGEST_SILENCE_WITH_OTHERS_US = 1_000_000
LOST_US = 1_000_000
MOST_YAW_RESETS = 3
YAW_RESET_INTERVAL_US = 5_000_000
RECENT_TAKE_OFF_US = 30_000_000
FAILURE_AFTER_TAKE_OFF_US = 1_000_000


@kernel
def control_gnss_by_mask(ekf, params):
    """Start, continue, reset or stop, with the sample in `ekf.gnss_taken` if one is due."""
    if int(params.EKF2_AID_MASK) & MASK_GNSS == 0:
        stop_gnss_by_mask(ekf, params)
        return
    gnss, cs = ekf.sensors.gnss, ekf.cs
    if gnss.data_ready:
        if is_fusion_due(gnss):
            control_gnss_yaw_by_mask(ekf, params, gnss.sample)
            _control_with_sample(ekf, params)
        elif cs.gnss_pos:
            _fuse_each(ekf, params, False)
        return
    silence_us = horizon_us(ekf) - ekf.gnss_taken.time_us
    if cs.gnss_pos and (
        silence_us > LONGEST_SILENCE_US
        or (silence_us > LONGEST_SILENCE_WITH_OTHERS_US and is_other_source_of_horizontal_aiding_than(ekf, cs.gnss_pos))
    ):
        stop_gnss_by_mask(ekf, params)


@kernel
def _control_with_sample(ekf, params):
    cs, trusted, distrusted = ekf.cs, is_gnss_trusted(ekf), is_gnss_distrusted(ekf)
    mandatory = cs.tilt_align and cs.yaw_align and ekf.origin.valid
    if cs.gnss_pos:
        if not mandatory:
            stop_gnss_by_mask(ekf, params)
        elif distrusted and is_other_source_of_horizontal_aiding_than(ekf, cs.gnss_pos):
            stop_gnss_by_mask(ekf, params)
            if cs.ev_pos and int(params.EKF2_AID_MASK) & MASK_ROTATE == 0:
                reset_position_to_vision(ekf, params, int(params.EKF2_AID_MASK))
        else:
            _fuse_each(ekf, params, True)
            if _is_reset_due(ekf):
                _put_yaw_right(ekf, params)
                _reset_to_gnss(ekf, params)
    elif mandatory and trusted and not distrusted:
        _start_or_await_north(ekf, params)
    elif trusted and not cs.yaw_align and int(params.EKF2_MAG_TYPE) == MAG_TYPE_NONE:
        if _reset_yaw(ekf, params):
            ekf.events.yaw_aligned_to_imu_gps = True
            _reset_to_gnss(ekf, params)


@kernel
def _start_or_await_north(ekf, params):
    """Start, unless the yaw is not of north: then the magnetometer is to align it, and vision no more."""
    cs, modes = ekf.cs, ekf.mag_modes
    if cs.ev_yaw or modes.inhibited_for_long or modes.yaw_reset_requested:
        modes.yaw_reset_requested = True
        cs.ev_yaw = False
        ekf.gnss_arrivals.inhibits_ev_yaw = True
        return
    _reset_position(ekf, params)
    if not cs.opt_flow and not cs.ev_vel:
        _reset_velocity(ekf, params)
    ekf.events.starting_gps_fusion = True
    cs.gnss_vel, cs.gnss_pos = True, True


@kernel
def _fuse_each(ekf, params, may_fuse):
    """Judge velocity and position by their innovations of before any is fused, and fuse what passes."""
    taken, gate = ekf.gnss_taken, max(params.EKF2_GPS_V_GATE, 1.0)
    variance = taken.sacc * taken.sacc
    at_n, at_e = get_local_horizontal_position(ekf)
    position = (at_n - taken.north, at_e - taken.east)
    down = ekf.vel[2] - taken.vel[2]
    aid = ekf.aid.gnss_vel
    passing, fused = True, may_fuse
    for i in range(2):
        innovation = ekf.vel[i] - taken.vel[i]
        innovation_variance = ekf.P[VELOCITY + i, VELOCITY + i] + variance
        set_axis(aid, i, taken.vel[i], variance, innovation, innovation_variance)
        passing = passing and innovation * innovation <= gate * gate * innovation_variance
    if may_fuse:
        ekf.reject.hor_vel = not passing
    for i in range(2):
        if may_fuse and passing:
            one = fuse_direct_state(ekf, params, aid.innovation[i], aid.innovation_variance[i], variance, VELOCITY + i)
            fused = one and fused
    variance *= VERTICAL_NOISE_RATIO**2
    rejected_down, fused_down = fuse_vertical_velocity_apart(
        ekf, params, aid, gate, taken.vel[2], variance, down, may_fuse
    )
    update_aid_source_status(ekf, aid, 3, taken.time_us, gate)
    ekf.vertical.gnss_rejected, ekf.vertical.gnss_fused = rejected_down, fused_down
    aid.innovation_rejected, aid.fused = not passing, passing and fused
    if aid.fused:
        aid.time_last_fuse = ekf.time_delayed_us
    _fuse_position(ekf, params, position[0], position[1], may_fuse)


@kernel
def _position_variance(ekf, params):
    """As the only thing that bounds attitude errors, the position must keep some weight."""
    least = max(params.EKF2_GPS_P_NOISE, LEAST_NOISE)
    noise = max(ekf.gnss_taken.hacc, least)
    if not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.gnss_pos):
        noise = min(noise, max(params.EKF2_NOAID_NOISE, least))
    return noise * noise


@kernel
def _fuse_position(ekf, params, innovation_n, innovation_e, may_fuse):
    aid, taken, variance = ekf.aid.gnss_pos, ekf.gnss_taken, _position_variance(ekf, params)
    set_axis(aid, 0, taken.north, variance, innovation_n, ekf.P[POSITION, POSITION] + variance)
    set_axis(aid, 1, taken.east, variance, innovation_e, ekf.P[POSITION + 1, POSITION + 1] + variance)
    update_aid_source_status(ekf, aid, 2, taken.time_us, max(params.EKF2_GPS_P_GATE, 1.0))
    if not may_fuse:
        return
    ekf.reject.hor_pos = aid.innovation_rejected
    if aid.innovation_rejected:
        return
    fused = True
    for i in range(2):
        one = fuse_direct_state(ekf, params, aid.innovation[i], aid.innovation_variance[i], variance, POSITION + i)
        fused = one and fused
    aid.fused = fused
    if fused:
        aid.time_last_fuse = ekf.time_delayed_us


@kernel
def _is_reset_due(ekf):
    """Whether nothing has bounded the horizontal drift for 7 s, no position for 14 s, or soon after take-off no
    velocity for 1 s."""
    cs, vel_us, pos_us = ekf.cs, ekf.time_last_hor_vel_fuse, ekf.time_last_hor_pos_fuse
    both = is_timed_out(ekf, pos_us, RESET_TIMEOUT_MAX) and is_timed_out(ekf, vel_us, RESET_TIMEOUT_MAX)
    unaided = both and is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, RESET_TIMEOUT_MAX)
    if unaided or is_timed_out(ekf, pos_us, 2 * RESET_TIMEOUT_MAX):
        return True
    if not cs.in_air or not vel_us > ekf.time_last_on_ground:
        return False
    soon = is_recent(ekf, ekf.time_last_on_ground, RECENT_TAKE_OFF_US)
    failed_soon = soon and is_timed_out(ekf, vel_us, FAILURE_AFTER_TAKE_OFF_US)
    return failed_soon or (both and pos_us > ekf.time_last_on_ground)


@kernel
def _put_yaw_right(ekf, params):
    """Reset a yaw that is off to the yaw estimator's, a few times at most; else that of a fixed wing by its course."""
    taken, cs = ekf.gnss_taken, ekf.cs
    was_lost = taken.time_before_us + LOST_US < ekf.time_latest_us
    often = taken.yaw_resets >= MOST_YAW_RESETS or not is_timed_out(ekf, taken.yaw_reset_us, YAW_RESET_INTERVAL_US)
    if is_yaw_failure(ekf) and cs.in_air and not was_lost and not often:
        _reset_yaw(ekf, params)
    elif cs.fixed_wing and cs.in_air:
        ekf.mag_modes.yaw_reset_requested = True


@kernel
def _reset_yaw(ekf, params):
    if not reset_yaw_to_ekf_gsf(ekf, params):
        return False
    ekf.gnss_taken.yaw_reset_us = ekf.time_delayed_us
    ekf.gnss_taken.yaw_resets += 1
    return True


@kernel
def _reset_to_gnss(ekf, params):
    _reset_velocity(ekf, params)
    _reset_position(ekf, params)


@kernel
def _reset_velocity(ekf, params):
    ekf.events.reset_vel_to_gps = True
    taken = ekf.gnss_taken
    variance = taken.sacc * taken.sacc
    reset_horizontal_velocity_to(ekf, params, taken.vel[0], taken.vel[1], variance, variance)
    reset_vertical_velocity_to(ekf, params, taken.vel[2], variance)


@kernel
def _reset_position(ekf, params):
    ekf.events.reset_pos_to_gps = True
    taken = ekf.gnss_taken
    variance = taken.hacc * taken.hacc
    reset_local_horizontal_position_to(ekf, params, taken.north, taken.east, variance, variance)


@kernel
def stop_gnss_by_mask(ekf, params):
    """Stop all of GNSS; where it gave the height, the barometer does."""
    cs = ekf.cs
    if cs.gnss_pos:
        cs.gnss_vel, cs.gnss_pos = False, False
        if cs.gps_hgt:
            start_baro_height(ekf, params)
    stop_gnss_yaw_fusion(ekf)
    ekf.gnss_arrivals.inhibits_ev_yaw = False
