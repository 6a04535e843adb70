"""Yaw of external vision: when it is fused, and when the yaw is reset to it.

In the NED frame vision yaw may share with other yaw sources. In its own frame (FRD) it replaces them: the yaw is
reset to vision and true north is given up (`yaw_align` off).

Mirrors PX4 v1.16 `EKF/aid_sources/external_vision/ev_yaw_control.cpp`. `EKF2_EVA_NOISE` is the lower bound of the
observation variance as it stands, not squared.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_FRD, EV_FRAME_NED
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import EV_CTRL_YAW, MIN_NOISE, RESETS_AVAILABLE_AT_START
from fusetune.ekf2.filter.common.aid_source_status import (
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.source_stops.yaw import stop_ev_yaw_fusion
from fusetune.ekf2.filter.yaw_fusion import compute_yaw_innov_var_and_h, fuse_yaw
from fusetune.ekf2.numerics.rotations import euler_yaw, quat_to_dcm, wrap_pi
from fusetune.ekf2.releases.by_release import by_release

RESTART_INTERVAL_US = 1_000_000


@kernel
def _clear_fault(ekf):
    ekf.cs.ev_yaw_fault = False


@kernel
def _has_no_fault(ekf):
    """Until v1.14 there is none."""


@kernel
def _is_at_fault(ekf):
    return ekf.cs.ev_yaw_fault


@kernel
def _is_replaced_by_gnss(ekf):
    return ekf.gnss_arrivals.inhibits_ev_yaw


_forgive_yaw = by_release(_clear_fault, "gives_north_up_for_vision", _has_no_fault)
_is_yaw_barred = by_release(_is_at_fault, "gives_north_up_for_vision", _is_replaced_by_gnss)


@kernel
def control_ev_yaw_fusion(ekf, params, common_starting_conditions_passing, ev_reset, quality_sufficient):
    """Start, continue, reset or stop the yaw of external vision for one sample."""
    sample, aid = ekf.sensors.ev.sample, ekf.aid.ev_yaw
    _update_ev_yaw(ekf, params)
    if ev_reset:
        _forgive_yaw(ekf)
    continuing_conditions_passing = (
        (int(params.EKF2_EV_CTRL) & EV_CTRL_YAW) != 0
        and ekf.cs.tilt_align
        and not _is_yaw_barred(ekf)
        and math.isfinite(aid.observation[0])
        and math.isfinite(aid.observation_variance[0])
    )
    gnss_active = ekf.cs.gnss_pos or ekf.cs.gnss_vel
    if gnss_active and ekf.cs.yaw_align and sample.pos_frame != EV_FRAME_NED:
        continuing_conditions_passing = False
    starting_conditions_passing = (
        common_starting_conditions_passing
        and continuing_conditions_passing
        and is_timed_out(ekf, aid.time_last_fuse, RESTART_INTERVAL_US)
    )
    if ekf.cs.ev_yaw:
        if continuing_conditions_passing:
            _continue_ev_yaw(ekf, params, ev_reset, quality_sufficient)
        else:
            stop_ev_yaw_fusion(ekf)
    elif starting_conditions_passing:
        _start_ev_yaw(ekf, params)


@kernel
def _observe_ev_yaw(ekf, params):
    """Store the observed yaw, and how far the estimate is from it."""
    aid, R = ekf.aid.ev_yaw, ekf.scratch.R
    quat_to_dcm(ekf.sensors.ev.sample.quat, R)
    observation = euler_yaw(R)
    variance = max(ekf.sensors.ev.sample.orientation_var[2], params.EKF2_EVA_NOISE, MIN_NOISE * MIN_NOISE)
    set_axis(aid, 0, observation, variance, wrap_pi(euler_yaw(ekf.R_to_earth) - observation), 0.0)
    aid.timestamp_sample = ekf.sensors.ev.sample.time_us
    aid.test_ratio[0] = math.inf
    aid.innovation_rejected = True
    aid.fused = False


@kernel
def _fuse_judged_yaw(ekf, params):
    return fuse_yaw(ekf, params, ekf.aid.ev_yaw, ekf.scratch.H)


@kernel
def _judge_and_fuse_yaw(ekf, params):
    aid = ekf.aid.ev_yaw
    aid.innovation_variance[0] = compute_yaw_innov_var_and_h(ekf, aid.observation_variance[0], ekf.scratch.H)
    update_aid_source_status(ekf, aid, 1, aid.timestamp_sample, max(params.EKF2_HDG_GATE, 1.0))
    return fuse_yaw(ekf, params, aid, ekf.scratch.H)


_fuse_ev_yaw = by_release(_fuse_judged_yaw, "starts_vision_yaw_unjudged", _judge_and_fuse_yaw)


@kernel
def _join_unjudged(ekf, params):
    """The yaw is aligned already, and will be fused from the next sample on."""
    ekf.aid.ev_yaw.time_last_fuse = ekf.time_delayed_us
    return True


_join_yaw = by_release(_fuse_judged_yaw, "starts_vision_yaw_unjudged", _join_unjudged)


@kernel
def _judge_ev_yaw(ekf, params):
    R = ekf.scratch.R
    quat_to_dcm(ekf.sensors.ev.sample.quat, R)
    observation = euler_yaw(R)
    variance = max(ekf.sensors.ev.sample.orientation_var[2], params.EKF2_EVA_NOISE, MIN_NOISE * MIN_NOISE)
    innovation = wrap_pi(euler_yaw(ekf.R_to_earth) - observation)
    innovation_variance = compute_yaw_innov_var_and_h(ekf, variance, ekf.scratch.H)
    set_axis(ekf.aid.ev_yaw, 0, observation, variance, innovation, innovation_variance)
    update_aid_source_status(ekf, ekf.aid.ev_yaw, 1, ekf.sensors.ev.sample.time_us, max(params.EKF2_HDG_GATE, 1.0))


_update_ev_yaw = by_release(_judge_ev_yaw, "starts_vision_yaw_unjudged", _observe_ev_yaw)


@kernel
def _reset_yaw_to_ev(ekf, params):
    aid = ekf.aid.ev_yaw
    reset_quat_state_yaw(ekf, params, aid.observation[0], aid.observation_variance[0])
    aid.time_last_fuse = ekf.time_delayed_us


@kernel
def _continue_ev_yaw(ekf, params, ev_reset, quality_sufficient):
    aid = ekf.aid.ev_yaw
    if ev_reset:
        if not quality_sufficient:
            stop_ev_yaw_fusion(ekf)
            return
        _reset_yaw_to_ev(ekf, params)
    elif quality_sufficient:
        _fuse_ev_yaw(ekf, params)
    else:
        aid.innovation_rejected = True

    if is_timed_out(ekf, aid.time_last_fuse, NO_AID_TIMEOUT_MAX):
        if ekf.ev.nb_yaw_reset_available > 0 and quality_sufficient:
            _reset_yaw_to_ev(ekf, params)
            if ekf.cs.in_air:
                ekf.ev.nb_yaw_reset_available -= 1
        else:
            stop_ev_yaw_fusion(ekf)


@kernel
def _start_ev_yaw(ekf, params):
    frame = ekf.sensors.ev.sample.pos_frame
    if frame == EV_FRAME_NED:
        if ekf.cs.yaw_align:
            ekf.cs.ev_yaw = _join_yaw(ekf, params)
        else:
            _reset_yaw_to_ev(ekf, params)
            ekf.cs.yaw_align = True
            ekf.cs.ev_yaw = True
    elif frame == EV_FRAME_FRD:
        _reset_yaw_to_ev(ekf, params)
        ekf.cs.yaw_align = False
        ekf.cs.ev_yaw = True
    if ekf.cs.ev_yaw:
        ekf.events.starting_vision_yaw_fusion = True
        ekf.ev.nb_yaw_reset_available = RESETS_AVAILABLE_AT_START
