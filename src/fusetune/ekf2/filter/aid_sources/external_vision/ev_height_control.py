"""Height of external vision, as the height reference or beside another with its bias estimated.

Mirrors PX4 v1.16 `EKF/aid_sources/external_vision/ev_height_control.cpp`. Heights are down positions (m).
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_BODY_FRD, EV_FRAME_FRD
from fusetune.ekf2.filter.aid_sources.external_vision.ev_attitude_error import (
    refresh_ev_rotation,
    variance_with_attitude,
)
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import (
    EV_CTRL_VEL,
    EV_CTRL_VPOS,
    MIN_NOISE,
    sensor_offset_body,
    sensor_velocity_body,
)
from fusetune.ekf2.filter.bias_estimator.bias_estimator import reset_bias, set_bias
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import (
    predict_height_bias,
    start_height_source,
    stop_height_source,
    update_height_bias,
)
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status
from fusetune.ekf2.filter.common.conditions import is_height_reset_required
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_EV
from fusetune.ekf2.filter.common.timing import HGT_FUSION_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.state_resets import (
    reset_altitude_to,
    reset_vertical_velocity_to,
    reset_vertical_velocity_to_zero,
)
from fusetune.ekf2.numerics.rotations import component_in_earth, variance_in_earth
from fusetune.ekf2.releases.by_release import by_release, does

_resets_always = does("resets_height_to_each_source")


@kernel
def _unless_all_in_vision_frame(ekf):
    return not (ekf.cs.ev_yaw and ekf.cs.ev_pos)


@kernel
def _where_frame_is_frd(ekf):
    frd = ekf.sensors.ev.sample.pos_frame == EV_FRAME_FRD
    return frd and not (ekf.cs.ev_yaw and ekf.cs.ev_pos)


@kernel
def _where_rotation_is_known(ekf):
    quat = ekf.sensors.ev.sample.quat
    known = math.isfinite(quat[0]) and math.isfinite(quat[1]) and math.isfinite(quat[2]) and math.isfinite(quat[3])
    return known and _unless_all_in_vision_frame(ekf)


_is_height_turned = by_release(
    by_release(_unless_all_in_vision_frame, "levers_vision_attitude", _where_frame_is_frd),
    "takes_vision_rotation_unfiltered",
    _where_rotation_is_known,
)


@kernel
def _predicted_before(ekf):
    """The bias was predicted at every update."""


@kernel
def _predict_by_sample(ekf):
    """PX4 predicts the bias over one update for every sample."""
    predict_height_bias(ekf, ekf.ev_hgt_b_est, HEIGHT_REF_EV, ekf.dt_ekf_avg)


_predict_bias_of_sample = by_release(_predicted_before, "follows_vision_height_by_sample", _predict_by_sample)


@kernel
def _measured_height(ekf, params):
    """Down position (m) of the IMU by external vision, and its variance."""
    sample = ekf.sensors.ev.sample
    position, variance = sample.pos[2], sample.position_var[2]
    if _is_height_turned(ekf):
        # not working entirely in the vision frame
        refresh_ev_rotation(ekf)
        R = ekf.ev.R_ev_to_ekf
        position = component_in_earth(R, 2, sample.pos[0], sample.pos[1], sample.pos[2])
        variance = variance_with_attitude(ekf, 2, variance_in_earth(R, 2, sample.position_var), 2)
    variance = max(variance, params.EKF2_EVP_NOISE * params.EKF2_EVP_NOISE, MIN_NOISE * MIN_NOISE)
    if ekf.cs.gps_hgt:
        variance = max(variance, params.EKF2_GPS_P_NOISE * params.EKF2_GPS_P_NOISE)
    px, py, pz = sensor_offset_body(params)
    return position - component_in_earth(ekf.R_to_earth, 2, px, py, pz), variance


@kernel
def _set_bias_to_difference(ekf, measurement):
    """Let the measurement agree with the estimate."""
    set_bias(ekf.ev_hgt_b_est, measurement + ekf.gpos_alt)


@kernel
def control_ev_height_fusion(ekf, params, common_starting_conditions_passing, ev_reset, quality_sufficient):
    """Start, continue, reset or stop the height of external vision for one sample."""
    bias, aid = ekf.ev_hgt_b_est, ekf.aid.ev_hgt
    _predict_bias_of_sample(ekf)
    measurement, variance = _measured_height(ekf, params)
    measurement_valid = math.isfinite(measurement) and math.isfinite(variance)
    update_vertical_position_aid_status(
        ekf,
        aid,
        ekf.sensors.ev.sample.time_us,
        measurement - bias.bias,
        variance + bias.bias_var,
        max(params.EKF2_EVP_GATE, 1.0),
    )
    if measurement_valid and quality_sufficient:
        update_height_bias(ekf, bias, HEIGHT_REF_EV, measurement + ekf.gpos_alt, variance)
    continuing_conditions_passing = (int(params.EKF2_EV_CTRL) & EV_CTRL_VPOS) != 0 and measurement_valid
    if ekf.cs.ev_hgt:
        if continuing_conditions_passing:
            _continue_ev_hgt(ekf, params, measurement, variance, ev_reset, quality_sufficient)
        else:
            stop_ev_hgt_fusion(ekf)
    elif common_starting_conditions_passing and continuing_conditions_passing:
        _start_ev_hgt(ekf, params, measurement, variance)


@kernel
def _reset_height_to_ev(ekf, params, measurement, variance):
    ekf.events.reset_hgt_to_ev = True
    reset_altitude_to(ekf, params, -measurement, variance)


@kernel
def _reset_vertical_velocity(ekf, params):
    """To that of external vision where it is to be used, else to rest."""
    sample, R = ekf.sensors.ev.sample, ekf.R_to_earth
    vel = sample.vel
    finite = math.isfinite(vel[0]) and math.isfinite(vel[1]) and math.isfinite(vel[2])
    if not finite or (int(params.EKF2_EV_CTRL) & EV_CTRL_VEL) == 0:
        reset_vertical_velocity_to_zero(ekf, params)
        return
    ox, oy, oz = sensor_velocity_body(ekf, params)
    min_variance = params.EKF2_EVV_NOISE * params.EKF2_EVV_NOISE
    if sample.vel_frame == EV_FRAME_BODY_FRD:
        velocity = component_in_earth(R, 2, vel[0] - ox, vel[1] - oy, vel[2] - oz)
        variance = variance_in_earth(R, 2, sample.velocity_var)
    else:
        velocity = vel[2] - component_in_earth(R, 2, ox, oy, oz)
        variance = sample.velocity_var[2]
    reset_vertical_velocity_to(ekf, params, velocity, max(variance, min_variance))


@kernel
def _reset_height_alone(ekf, params, measurement, variance):
    """PX4 takes the bias, which the reference has none of, with the sign that altitudes have."""
    _reset_height_to_ev(ekf, params, measurement + ekf.ev_hgt_b_est.bias, variance)


@kernel
def _reset_height_and_velocity(ekf, params, measurement, variance):
    _reset_height_to_ev(ekf, params, measurement - ekf.ev_hgt_b_est.bias, variance)
    _reset_vertical_velocity(ekf, params)


_reset_all_failing = by_release(_reset_height_alone, "resets_height_to_each_source", _reset_height_and_velocity)


@kernel
def _continue_ev_hgt(ekf, params, measurement, variance, ev_reset, quality_sufficient):
    bias, aid = ekf.ev_hgt_b_est, ekf.aid.ev_hgt
    if ev_reset:
        if not quality_sufficient:
            stop_ev_hgt_fusion(ekf)
            return
        if ekf.height_sensor_ref == HEIGHT_REF_EV:
            _reset_height_to_ev(ekf, params, measurement, variance)
            reset_bias(bias)
        else:
            _set_bias_to_difference(ekf, measurement)
        aid.time_last_fuse = ekf.time_delayed_us
    elif quality_sufficient:
        fuse_vertical_position(ekf, params, aid)
    else:
        aid.innovation_rejected = True

    if (
        is_height_reset_required(ekf)
        and quality_sufficient
        and (ekf.height_sensor_ref == HEIGHT_REF_EV or _resets_always(ekf))
    ):
        # all height sources are failing
        _reset_all_failing(ekf, params, measurement, variance)
        _set_bias_to_difference(ekf, measurement)
        aid.time_last_fuse = ekf.time_delayed_us
    elif is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX):
        stop_ev_hgt_fusion(ekf)


@kernel
def _start_ev_hgt(ekf, params, measurement, variance):
    if int(params.EKF2_HGT_REF) == HEIGHT_REF_EV:
        _reset_height_to_ev(ekf, params, measurement, variance)
        ekf.height_sensor_ref = HEIGHT_REF_EV
        reset_bias(ekf.ev_hgt_b_est)
    else:
        _set_bias_to_difference(ekf, measurement)
    start_height_source(ekf, ekf.ev_hgt_b_est, ekf.aid.ev_hgt)
    ekf.cs.ev_hgt = True


@kernel
def stop_ev_hgt_fusion(ekf):
    """Leave external vision as height source, and as height reference."""
    if ekf.cs.ev_hgt:
        stop_height_source(ekf, ekf.ev_hgt_b_est, HEIGHT_REF_EV)
        forget_aid_source_status(ekf, ekf.aid.ev_hgt, 1)
        ekf.cs.ev_hgt = False
