"""External vision: one sample offers yaw, velocity, position and height, each with its own state machine.

Mirrors PX4 v1.16 `EKF/aid_sources/external_vision/ev_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_BODY_FRD, EV_FRAME_FRD, EV_FRAME_UNKNOWN
from fusetune.ekf2.filter.aid_sources.external_vision.ev_attitude_error import update_ev_attitude_error_filter
from fusetune.ekf2.filter.aid_sources.external_vision.ev_height_control import (
    control_ev_height_fusion,
    stop_ev_hgt_fusion,
)
from fusetune.ekf2.filter.aid_sources.external_vision.ev_pos_control import (
    control_ev_pos_fusion,
    stop_ev_pos_fusion,
)
from fusetune.ekf2.filter.aid_sources.external_vision.ev_vel_control import (
    control_ev_vel_fusion,
    stop_ev_vel_fusion,
)
from fusetune.ekf2.filter.aid_sources.external_vision.ev_yaw_control import control_ev_yaw_fusion
from fusetune.ekf2.filter.aid_sources.external_vision.vision_by_mask import control_vision_by_mask
from fusetune.ekf2.filter.aid_sources.gnss.arrived_gnss_control import stop_arrived_gnss
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import predict_height_bias
from fusetune.ekf2.filter.bias_estimator.position_bias_estimator import predict_position_bias
from fusetune.ekf2.filter.common.core_memory import POSITION_REF_EV
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_EV
from fusetune.ekf2.filter.common.timing import EV_MAX_INTERVAL, is_newest_sample_recent, is_timed_out
from fusetune.ekf2.filter.source_stops.heading_and_field import stop_heading_and_field
from fusetune.ekf2.filter.source_stops.yaw import stop_ev_yaw_fusion, stop_gnss_yaw_fusion
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _assume_missing_frames(sample):
    """Of a sample without position or velocity PX4 takes the frame to be local FRD or body FRD."""
    if sample.pos_frame == EV_FRAME_UNKNOWN:
        sample.pos_frame = EV_FRAME_FRD
    if sample.vel_frame == EV_FRAME_UNKNOWN:
        sample.vel_frame = EV_FRAME_BODY_FRD


@kernel
def _are_starting_conditions_passing(ekf, minimum_quality):
    """Whether samples come regularly, and this, the one before and the newest are good enough."""
    ev, sample = ekf.ev, ekf.sensors.ev.sample
    quality = min(sample.quality, ev.prev.quality, ev.newest_quality)
    return (
        (minimum_quality <= 0 or quality >= minimum_quality)
        and sample.time_us - ev.prev.time_us < EV_MAX_INTERVAL
        and is_newest_sample_recent(ekf, ekf.sensors.ev.newest_time_us, EV_MAX_INTERVAL)
    )


@kernel
def _predict_at_every_update(ekf):
    predict_height_bias(ekf, ekf.ev_hgt_b_est, HEIGHT_REF_EV, ekf.dt_ekf_avg)


@kernel
def _predict_later(ekf):
    """Only where a sample comes."""


_predict_height_bias = by_release(_predict_at_every_update, "follows_vision_height_by_sample", _predict_later)


@kernel
def _leave_other_yaws(ekf, params, was_fused):
    """Since v1.15 the yaw of vision in its own frame waits until GNSS has stopped."""


@kernel
def _stop_other_yaws(ekf, params, was_fused):
    """A yaw in the frame of vision has just begun to be fused: nothing that knows north can be fused beside it."""
    if ekf.cs.ev_yaw and not was_fused and ekf.sensors.ev.sample.pos_frame == EV_FRAME_FRD:
        stop_heading_and_field(ekf, params)
        stop_gnss_yaw_fusion(ekf)
        stop_arrived_gnss(ekf)


_give_north_up = by_release(_leave_other_yaws, "gives_north_up_for_vision", _stop_other_yaws)


@kernel
def _control_parts(ekf, params):
    """Use the external vision sample due now, if there is one; stop when none has come for two intervals."""
    ev, sample = ekf.ev, ekf.sensors.ev.sample
    predict_position_bias(ekf, ekf.ev_pos_b_est, POSITION_REF_EV, ekf.dt_ekf_avg)
    _predict_height_bias(ekf)
    if ekf.sensors.ev.data_ready:
        _assume_missing_frames(sample)
        minimum_quality = int(params.EKF2_EV_QMIN)
        ev_reset = sample.reset_counter != ev.prev.reset_counter
        quality_sufficient = minimum_quality <= 0 or sample.quality >= minimum_quality
        starting = _are_starting_conditions_passing(ekf, minimum_quality)
        update_ev_attitude_error_filter(ekf, ev_reset)
        yaw_was_fused = ekf.cs.ev_yaw
        control_ev_yaw_fusion(ekf, params, starting, ev_reset, quality_sufficient)
        _give_north_up(ekf, params, yaw_was_fused)
        control_ev_vel_fusion(ekf, params, starting, ev_reset, quality_sufficient)
        control_ev_pos_fusion(ekf, params, starting, ev_reset, quality_sufficient)
        control_ev_height_fusion(ekf, params, starting, ev_reset, quality_sufficient)
        if quality_sufficient:
            ev.prev = sample
    elif (ekf.cs.ev_pos or ekf.cs.ev_vel or ekf.cs.ev_yaw or ekf.cs.ev_hgt) and is_timed_out(
        ekf, ev.prev.time_us, 2 * EV_MAX_INTERVAL
    ):
        stop_ev_pos_fusion(ekf)
        stop_ev_vel_fusion(ekf)
        stop_ev_yaw_fusion(ekf)
        stop_ev_hgt_fusion(ekf)
        ev.q_error_initialized = False


control_external_vision_fusion = by_release(_control_parts, "fuses_vision_by_mask", control_vision_by_mask)
