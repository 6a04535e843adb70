"""Velocity of external vision, in the NED, the vision's own or the body frame.

Mirrors PX4 v1.16 `EKF/aid_sources/external_vision/{ev_vel.h,ev_vel_control.cpp}`. Two of its traits show: velocities
in a local frame carry no sample time, so that their innovations are never published; a height reset takes the third
component of the measurement as vertical velocity, in the body frame, too.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_BODY_FRD, EV_FRAME_FRD, EV_FRAME_NED
from fusetune.ekf2.filter.aid_sources.external_vision.body_velocity_fusion import fuse_body_frame_velocity
from fusetune.ekf2.filter.aid_sources.external_vision.ev_attitude_error import refresh_ev_rotation
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import (
    EV_CTRL_VEL,
    MIN_NOISE,
    RESETS_AVAILABLE_AT_START,
    is_yaw_alignment_changed,
    sensor_velocity_body,
)
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import (
    is_height_reset_required,
    is_horizontal_aiding_active,
    is_only_active_source_of_horizontal_aiding,
)
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.resets.state_resets import reset_velocity_to, reset_vertical_velocity_to
from fusetune.ekf2.filter.velocity_fusion import fuse_velocity
from fusetune.ekf2.numerics.rotations import component_in_earth, variance_in_earth
from fusetune.ekf2.releases.by_release import by_release

NO_SAMPLE_TIME = 0
BODY_RESET_VARIANCE_FACTOR = 5.0
"""A reset from the body frame leaves the axes uncorrelated, which the larger variance makes up for."""

START_GATE_FACTOR = math.sqrt(10.0)
START_TEST_RATIO = 0.1


@kernel
def _prepare_measurement(ekf, params):
    """Refer the velocity to the IMU, in the frame in which it is fused; NaN while that frame is not aligned."""
    sample, ev, R = ekf.sensors.ev.sample, ekf.ev, ekf.R_to_earth
    ox, oy, oz = sensor_velocity_body(ekf, params)
    min_variance = max(params.EKF2_EVV_NOISE * params.EKF2_EVV_NOISE, MIN_NOISE * MIN_NOISE)
    offset_body = (ox, oy, oz)
    turn = sample.vel_frame == EV_FRAME_FRD and not ekf.cs.ev_yaw
    if turn:
        refresh_ev_rotation(ekf)
        min_variance = max(
            min_variance, sample.orientation_var[0], sample.orientation_var[1], sample.orientation_var[2]
        )
    for i in range(3):
        ev.vel_measurement[i] = sample.vel[i]
        ev.vel_measurement_var[i] = sample.velocity_var[i]
        if turn:
            ev.vel_measurement[i] = component_in_earth(ev.R_ev_to_ekf, i, sample.vel[0], sample.vel[1], sample.vel[2])
            ev.vel_measurement_var[i] = variance_in_earth(ev.R_ev_to_ekf, i, sample.velocity_var)
        if sample.vel_frame == EV_FRAME_BODY_FRD:
            ev.vel_measurement[i] -= offset_body[i]
        else:
            ev.vel_measurement[i] -= component_in_earth(R, i, ox, oy, oz)
        if sample.vel_frame == EV_FRAME_NED and not ekf.cs.yaw_align:
            ev.vel_measurement[i] = np.nan
        ev.vel_measurement_var[i] = max(ev.vel_measurement_var[i], min_variance)


@kernel
def _is_measurement_valid(ekf, params):
    sample, ev = ekf.sensors.ev.sample, ekf.ev
    speed_squared = 0.0
    for i in range(3):
        if not math.isfinite(ev.vel_measurement[i]) or not math.isfinite(ev.vel_measurement_var[i]):
            return False
        speed_squared += sample.vel[i] * sample.vel[i]
    return speed_squared <= params.EKF2_VEL_LIM * params.EKF2_VEL_LIM


@kernel
def _no_time(ekf):
    return NO_SAMPLE_TIME


@kernel
def _time_of_sample(ekf):
    return ekf.sensors.ev.sample.time_us


_local_sample_time = by_release(_no_time, "stamps_vision_velocity", _time_of_sample)


@kernel
def _fuse_ev_velocity(ekf, params, gate):
    aid, ev = ekf.aid.ev_vel, ekf.ev
    if ekf.sensors.ev.sample.vel_frame == EV_FRAME_BODY_FRD:
        fuse_body_frame_velocity(
            ekf,
            params,
            aid,
            ekf.sensors.ev.sample.time_us,
            ev.vel_measurement,
            ev.vel_measurement_var,
            gate,
            ev.body_velocity_jacobian,
        )
    else:
        for i in range(3):
            variance = ev.vel_measurement_var[i]
            innovation = ekf.vel[i] - ev.vel_measurement[i]
            set_axis(aid, i, ev.vel_measurement[i], variance, innovation, ekf.P[VELOCITY + i, VELOCITY + i] + variance)
        update_aid_source_status(ekf, aid, 3, _local_sample_time(ekf), gate)
        fuse_velocity(ekf, params, aid)
    return aid.fused


@kernel
def _reset_velocity_to_ev(ekf, params):
    ev, R = ekf.ev, ekf.R_to_earth
    ekf.events.reset_vel_to_vision = True
    if ekf.sensors.ev.sample.vel_frame == EV_FRAME_BODY_FRD:
        velocity, variance = ekf.scratch.PH[:3], ekf.scratch.K[:3]
        m = ev.vel_measurement
        for i in range(3):
            velocity[i] = component_in_earth(R, i, m[0], m[1], m[2])
            variance[i] = BODY_RESET_VARIANCE_FACTOR * variance_in_earth(R, i, ev.vel_measurement_var)
        reset_velocity_to(ekf, params, velocity, variance)
    else:
        reset_velocity_to(ekf, params, ev.vel_measurement, ev.vel_measurement_var)
    reset_aid_source_status_zero_innovation(ekf, ekf.aid.ev_vel, 3)


@kernel
def _continue_ev_vel(ekf, params, ev_reset, quality_sufficient, yaw_alignment_changed, gate):
    aid, ev = ekf.aid.ev_vel, ekf.ev
    if (ev_reset and is_only_active_source_of_horizontal_aiding(ekf, ekf.cs.ev_vel)) or yaw_alignment_changed:
        if not quality_sufficient:
            stop_ev_vel_fusion(ekf)
            return
        _reset_velocity_to_ev(ekf, params)
    elif quality_sufficient:
        _fuse_ev_velocity(ekf, params, gate)
    else:
        aid.innovation_rejected = True

    if is_timed_out(ekf, aid.time_last_fuse, NO_AID_TIMEOUT_MAX):
        if ev.nb_vel_reset_available > 0 and quality_sufficient:
            _reset_velocity_to_ev(ekf, params)
            if ekf.cs.in_air:
                ev.nb_vel_reset_available -= 1
        else:
            stop_ev_vel_fusion(ekf)
    elif is_height_reset_required(ekf):
        reset_vertical_velocity_to(ekf, params, ev.vel_measurement[2], ev.vel_measurement_var[2])


@kernel
def _start_ev_vel(ekf, params, yaw_alignment_changed, gate):
    aiding = is_horizontal_aiding_active(ekf)
    if not aiding or yaw_alignment_changed:
        _reset_velocity_to_ev(ekf, params)
        ekf.cs.ev_vel = True
    elif _fuse_ev_velocity(ekf, params, START_GATE_FACTOR * gate):
        ekf.cs.ev_vel = True
    if ekf.cs.ev_vel:
        ekf.ev.nb_vel_reset_available = RESETS_AVAILABLE_AT_START
        ekf.events.starting_vision_vel_fusion = True


@kernel
def _control_velocity(ekf, params, common_starting_conditions_passing, ev_reset, quality_sufficient):
    """Start, continue, reset or stop the velocity of external vision for one sample."""
    _prepare_measurement(ekf, params)
    yaw_alignment_changed = is_yaw_alignment_changed(ekf)
    continuing_conditions_passing = (
        (int(params.EKF2_EV_CTRL) & EV_CTRL_VEL) != 0 and ekf.cs.tilt_align and _is_measurement_valid(ekf, params)
    )
    gate = max(params.EKF2_EVV_GATE, 1.0)
    if ekf.cs.ev_vel:
        if continuing_conditions_passing:
            _continue_ev_vel(ekf, params, ev_reset, quality_sufficient, yaw_alignment_changed, gate)
        else:
            stop_ev_vel_fusion(ekf)
    elif common_starting_conditions_passing and continuing_conditions_passing:
        _start_ev_vel(ekf, params, yaw_alignment_changed, gate)


@kernel
def _turn_measurement(ekf, params):
    """Turn the velocity of the IMU, of whatever frame, into that of the estimate; NaN where that is not aligned."""
    sample, ev, R = ekf.sensors.ev.sample, ekf.ev, ekf.R_to_earth
    ox, oy, oz = sensor_velocity_body(ekf, params)
    vx, vy, vz = sample.vel[0], sample.vel[1], sample.vel[2]
    frame = sample.vel_frame
    of_vision = frame == EV_FRAME_FRD and not ekf.cs.ev_yaw
    least = max(params.EKF2_EVV_NOISE * params.EKF2_EVV_NOISE, MIN_NOISE * MIN_NOISE)
    uncertain = max(sample.orientation_var[0], sample.orientation_var[1], sample.orientation_var[2])
    if of_vision:
        refresh_ev_rotation(ekf)
    for i in range(3):
        measured, variance = sample.vel[i], sample.velocity_var[i]
        if frame == EV_FRAME_BODY_FRD:
            measured = component_in_earth(R, i, vx, vy, vz)
            variance = variance_in_earth(R, i, sample.velocity_var)
        elif of_vision:
            measured = component_in_earth(ev.R_ev_to_ekf, i, vx, vy, vz)
            variance = variance_in_earth(ev.R_ev_to_ekf, i, sample.velocity_var)
        elif frame == EV_FRAME_NED and not ekf.cs.yaw_align:
            measured = np.nan
        if i < 2:
            if of_vision:
                variance = max(variance, uncertain)
            if ekf.cs.gnss_pos or ekf.cs.gnss_vel:
                variance = max(variance, params.EKF2_GPS_V_NOISE * params.EKF2_GPS_V_NOISE)
        ev.vel_measurement[i] = measured - component_in_earth(R, i, ox, oy, oz)
        ev.vel_measurement_var[i] = max(variance, least)


@kernel
def _judge_along_axes(ekf, params):
    """While the vertical acceleration is bad, none is rejected, and the vertical innovation is limited to the gate."""
    aid, ev, gate = ekf.aid.ev_vel, ekf.ev, max(params.EKF2_EVV_GATE, 1.0)
    for i in range(3):
        variance = ev.vel_measurement_var[i]
        innovation = ekf.vel[i] - ev.vel_measurement[i]
        set_axis(aid, i, ev.vel_measurement[i], variance, innovation, ekf.P[VELOCITY + i, VELOCITY + i] + variance)
    update_aid_source_status(ekf, aid, 3, ekf.sensors.ev.sample.time_us, gate)
    if ekf.fs.bad_acc_vertical and aid.innovation_rejected:
        limit = gate * math.sqrt(aid.innovation_variance[2])
        aid.innovation[2] = min(max(aid.innovation[2], -limit), limit)
        aid.innovation_rejected = False


@kernel
def _is_turned_velocity_valid(ekf):
    ev, valid = ekf.ev, True
    for i in range(3):
        valid = valid and math.isfinite(ev.vel_measurement[i]) and math.isfinite(ev.vel_measurement_var[i])
    return valid


@kernel
def _reset_to_turned_velocity(ekf, params):
    ekf.events.reset_vel_to_vision = True
    reset_velocity_to(ekf, params, ekf.ev.vel_measurement, ekf.ev.vel_measurement_var)
    ekf.aid.ev_vel.time_last_fuse = ekf.time_delayed_us


@kernel
def _continue_turned_velocity(ekf, params, ev_reset, quality_sufficient, yaw_alignment_changed):
    aid, ev = ekf.aid.ev_vel, ekf.ev
    if (ev_reset and is_only_active_source_of_horizontal_aiding(ekf, ekf.cs.ev_vel)) or yaw_alignment_changed:
        if not quality_sufficient:
            stop_ev_vel_fusion(ekf)
            return
        _reset_to_turned_velocity(ekf, params)
    elif quality_sufficient:
        fuse_velocity(ekf, params, aid)
    else:
        aid.innovation_rejected = True
    if is_timed_out(ekf, aid.time_last_fuse, NO_AID_TIMEOUT_MAX):
        if ev.nb_vel_reset_available > 0 and quality_sufficient:
            _reset_to_turned_velocity(ekf, params)
            if ekf.cs.in_air:
                ev.nb_vel_reset_available -= 1
        else:
            stop_ev_vel_fusion(ekf)


@kernel
def _control_turned_velocity(ekf, params, common_starting_conditions_passing, ev_reset, quality_sufficient):
    """As v1.16's, with the velocity turned to the estimate's axes before anything else."""
    aid, aiding = ekf.aid.ev_vel, is_horizontal_aiding_active(ekf)
    _turn_measurement(ekf, params)
    _judge_along_axes(ekf, params)
    yaw_alignment_changed = is_yaw_alignment_changed(ekf)
    continuing = (int(params.EKF2_EV_CTRL) & EV_CTRL_VEL) != 0 and ekf.cs.tilt_align and _is_turned_velocity_valid(ekf)
    if ekf.cs.ev_vel:
        if continuing:
            _continue_turned_velocity(ekf, params, ev_reset, quality_sufficient, yaw_alignment_changed)
        else:
            stop_ev_vel_fusion(ekf)
        return
    agrees = max(aid.test_ratio[0], aid.test_ratio[1], aid.test_ratio[2]) < START_TEST_RATIO
    if common_starting_conditions_passing and continuing and (agrees or not aiding):
        if not aiding or yaw_alignment_changed:
            _reset_to_turned_velocity(ekf, params)
        aid.time_last_fuse = ekf.time_delayed_us
        ekf.ev.nb_vel_reset_available = RESETS_AVAILABLE_AT_START
        ekf.events.starting_vision_vel_fusion = True
        ekf.cs.ev_vel = True


control_ev_vel_fusion = by_release(_control_velocity, "turns_vision_velocity", _control_turned_velocity)


@kernel
def stop_ev_vel_fusion(ekf):
    """Leave external vision as velocity source."""
    if ekf.cs.ev_vel:
        forget_aid_source_status(ekf, ekf.aid.ev_vel, 3)
    ekf.cs.ev_vel = False
