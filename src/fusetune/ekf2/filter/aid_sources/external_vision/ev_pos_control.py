"""Horizontal position of external vision, alone or beside GNSS with its bias estimated.

Without GNSS position the estimate follows vision: it is reset to it at start and whenever vision or the yaw jumps.
With GNSS position only the bias of vision jumps.

Mirrors PX4 v1.16 `EKF/aid_sources/external_vision/ev_pos_control.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_FRD, EV_FRAME_NED
from fusetune.ekf2.filter.aid_sources.external_vision.ev_attitude_error import (
    refresh_ev_rotation,
    variance_with_attitude,
)
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import (
    EV_CTRL_HPOS,
    MIN_NOISE,
    RESETS_AVAILABLE_AT_START,
    is_yaw_alignment_changed,
    sensor_offset_body,
)
from fusetune.ekf2.filter.bias_estimator.position_bias_estimator import (
    fuse_position_bias,
    reset_position_bias,
    set_position_bias,
    set_position_bias_noise,
)
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import is_other_source_of_horizontal_aiding_than
from fusetune.ekf2.filter.common.core_memory import POSITION_REF_EV
from fusetune.ekf2.filter.common.local_origin import get_local_horizontal_position
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.position_fusion import fuse_horizontal_position
from fusetune.ekf2.filter.resets.state_resets import reset_local_horizontal_position_to
from fusetune.ekf2.numerics.rotations import component_in_earth, variance_in_earth

BIAS_NOISE_SPECTRAL_DENSITY = 0.13


@kernel
def _position_in_ekf_frame(ekf, params, axis):
    """One axis of the measured position (m) of the IMU and its variance, in the frame of the estimate.

    NaN while the sample's frame cannot be related to it.
    """
    sample = ekf.sensors.ev.sample
    px, py, pz = sensor_offset_body(params)
    position, variance = np.nan, 0.0
    if (sample.pos_frame == EV_FRAME_NED and ekf.cs.yaw_align) or (sample.pos_frame == EV_FRAME_FRD and ekf.cs.ev_yaw):
        position = sample.pos[axis]
        variance = sample.position_var[axis]
    elif sample.pos_frame == EV_FRAME_FRD:
        R = ekf.ev.R_ev_to_ekf
        position = component_in_earth(R, axis, sample.pos[0], sample.pos[1], sample.pos[2])
        variance = variance_with_attitude(ekf, axis, variance_in_earth(R, axis, sample.position_var), 3)
    if ekf.cs.gnss_pos:
        variance = max(variance, params.EKF2_GPS_P_NOISE * params.EKF2_GPS_P_NOISE)
    variance = max(variance, params.EKF2_EVP_NOISE * params.EKF2_EVP_NOISE, MIN_NOISE * MIN_NOISE)
    return position - component_in_earth(ekf.R_to_earth, axis, px, py, pz), variance


@kernel
def _select_bias_fusion(ekf):
    """Estimate the bias of vision where GNSS position is the reference; return whether the frame is usable."""
    frame, estimator = ekf.sensors.ev.sample.pos_frame, ekf.ev_pos_b_est
    if frame == EV_FRAME_NED and ekf.cs.yaw_align:
        estimator.fusion_active = ekf.cs.gnss_pos
        return True
    if frame == EV_FRAME_FRD and not ekf.cs.ev_yaw:
        estimator.fusion_active = ekf.cs.gnss_pos
        return True
    estimator.fusion_active = False
    reset_position_bias(estimator)
    return frame == EV_FRAME_FRD


@kernel
def _update_ev_pos(ekf, params, north, east, var_north, var_east):
    """Judge the position with its bias taken off."""
    aid, bias = ekf.aid.ev_pos, ekf.ev_pos_b_est
    estimate = get_local_horizontal_position(ekf)
    measurement = (north - bias.north.bias, east - bias.east.bias)
    variance = (var_north + bias.north.bias_var, var_east + bias.east.bias_var)
    for i in range(2):
        set_axis(
            aid,
            i,
            measurement[i],
            variance[i],
            estimate[i] - measurement[i],
            ekf.P[POSITION + i, POSITION + i] + variance[i],
        )
    update_aid_source_status(ekf, aid, 2, ekf.sensors.ev.sample.time_us, max(params.EKF2_EVP_GATE, 1.0))


@kernel
def _set_bias_to_difference(ekf, north, east):
    """Let the measurement agree with the estimate."""
    estimate_north, estimate_east = get_local_horizontal_position(ekf)
    set_position_bias(ekf.ev_pos_b_est, north - estimate_north, east - estimate_east)


@kernel
def _fuse_ev_pos_bias(ekf, north, east, var_north, var_east):
    estimate_north, estimate_east = get_local_horizontal_position(ekf)
    set_position_bias_noise(ekf.ev_pos_b_est, BIAS_NOISE_SPECTRAL_DENSITY, math.sqrt(var_north), math.sqrt(var_east))
    fuse_position_bias(
        ekf,
        ekf.ev_pos_b_est,
        POSITION_REF_EV,
        north - estimate_north,
        east - estimate_east,
        var_north + ekf.P[POSITION, POSITION],
        var_east + ekf.P[POSITION + 1, POSITION + 1],
    )


@kernel
def _reset_position_to_ev(ekf, params, north, east, var_north, var_east):
    ekf.events.reset_pos_to_vision = True
    reset_local_horizontal_position_to(ekf, params, north, east, var_north, var_east)
    reset_position_bias(ekf.ev_pos_b_est)


@kernel
def control_ev_pos_fusion(ekf, params, common_starting_conditions_passing, ev_reset, quality_sufficient):
    """Start, continue, reset or stop the horizontal position of external vision for one sample."""
    sample, estimator = ekf.sensors.ev.sample, ekf.ev_pos_b_est
    yaw_alignment_changed = is_yaw_alignment_changed(ekf)
    bias_fusion_was_active = estimator.fusion_active
    frame_usable = _select_bias_fusion(ekf)
    refresh_ev_rotation(ekf)
    north, var_north = _position_in_ekf_frame(ekf, params, 0)
    east, var_east = _position_in_ekf_frame(ekf, params, 1)
    measurement_valid = (
        math.isfinite(north) and math.isfinite(east) and math.isfinite(var_north) and math.isfinite(var_east)
    )
    if not bias_fusion_was_active and estimator.fusion_active:
        if quality_sufficient:
            _set_bias_to_difference(ekf, north, east)
        elif is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.ev_pos):
            stop_ev_pos_fusion(ekf)

    _update_ev_pos(ekf, params, north, east, var_north, var_east)
    if measurement_valid and quality_sufficient:
        _fuse_ev_pos_bias(ekf, north, east, var_north, var_east)

    continuing_conditions_passing = (
        (int(params.EKF2_EV_CTRL) & EV_CTRL_HPOS) != 0
        and ekf.cs.tilt_align
        and math.isfinite(sample.pos[0])
        and math.isfinite(sample.pos[1])
        and frame_usable
        and measurement_valid
    )
    if ekf.cs.ev_pos:
        if continuing_conditions_passing:
            bias_estimator_change = bias_fusion_was_active != estimator.fusion_active
            reset = ev_reset or yaw_alignment_changed or bias_estimator_change
            _update_ev_pos_fusion(ekf, params, north, east, var_north, var_east, quality_sufficient, reset)
        else:
            stop_ev_pos_fusion(ekf)
    elif common_starting_conditions_passing and continuing_conditions_passing:
        _start_ev_pos_fusion(ekf, params, north, east, var_north, var_east)


@kernel
def _start_ev_pos_fusion(ekf, params, north, east, var_north, var_east):
    if ekf.cs.gnss_pos:
        _set_bias_to_difference(ekf, north, east)
        ekf.ev_pos_b_est.fusion_active = True
    else:
        _reset_position_to_ev(ekf, params, north, east, var_north, var_east)
    ekf.aid.ev_pos.time_last_fuse = ekf.time_delayed_us
    ekf.ev.nb_pos_reset_available = RESETS_AVAILABLE_AT_START
    ekf.events.starting_vision_pos_fusion = True
    ekf.cs.ev_pos = True


@kernel
def _update_ev_pos_fusion(ekf, params, north, east, var_north, var_east, quality_sufficient, reset):
    aid = ekf.aid.ev_pos
    if reset:
        if not quality_sufficient:
            stop_ev_pos_fusion(ekf)
            return
        if ekf.cs.gnss_pos:
            _set_bias_to_difference(ekf, north, east)
        else:
            _reset_position_to_ev(ekf, params, north, east, var_north, var_east)
        aid.time_last_fuse = ekf.time_delayed_us
    elif quality_sufficient:
        fuse_horizontal_position(ekf, params, aid)
    else:
        aid.innovation_rejected = True

    if is_timed_out(ekf, aid.time_last_fuse, NO_AID_TIMEOUT_MAX):
        if ekf.ev.nb_pos_reset_available > 0 and quality_sufficient:
            _recover_ev_pos(ekf, params, north, east, var_north, var_east)
        else:
            stop_ev_pos_fusion(ekf)


@kernel
def _recover_ev_pos(ekf, params, north, east, var_north, var_east):
    """Fusion has failed for too long though the data seem good: reset the bias or the position."""
    bias = ekf.ev_pos_b_est
    position_fusion_failing = is_timed_out(ekf, ekf.time_last_hor_pos_fuse, NO_AID_TIMEOUT_MAX)
    if not ekf.cs.gnss_pos:
        _reset_position_to_ev(ekf, params, north, east, var_north, var_east)
    else:
        if position_fusion_failing:
            ekf.events.reset_pos_to_vision = True
            reset_local_horizontal_position_to(
                ekf,
                params,
                north - bias.north.bias,
                east - bias.east.bias,
                var_north + bias.north.bias_var,
                var_east + bias.east.bias_var,
            )
        _set_bias_to_difference(ekf, north, east)
    ekf.aid.ev_pos.time_last_fuse = ekf.time_delayed_us
    if ekf.cs.in_air:
        ekf.ev.nb_pos_reset_available -= 1


@kernel
def stop_ev_pos_fusion(ekf):
    """Leave external vision as horizontal position source."""
    if ekf.cs.ev_pos:
        forget_aid_source_status(ekf, ekf.aid.ev_pos, 2)
    ekf.cs.ev_pos = False
