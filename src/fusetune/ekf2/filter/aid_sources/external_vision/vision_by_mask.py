"""External vision of v1.13: position, velocity and yaw as EKF2_AID_MASK asks for them.

Position is absolute or, where the mask asks for GNSS, too, its change since the sample before. It is turned into the
frame of the estimate only if the mask says so. There are no checks of quality and no retries: what is rejected for 7 s
resets the state.

Mirrors `controlExternalVisionFusion` of PX4 v1.13 `EKF/control.cpp`, and its helpers in `EKF/ekf_helper.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_BODY_FRD
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import sensor_offset_body, sensor_velocity_body
from fusetune.ekf2.filter.common.aid_mask import MASK_GNSS, MASK_POSITION, MASK_ROTATE, MASK_VELOCITY, MASK_YAW
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.local_origin import get_local_horizontal_position
from fusetune.ekf2.filter.common.state import POSITION, VELOCITY
from fusetune.ekf2.filter.common.timing import (
    EV_MAX_INTERVAL,
    NO_AID_TIMEOUT_MAX,
    RESET_TIMEOUT_MAX,
    is_newest_sample_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.measurement_update import fuse_direct_state
from fusetune.ekf2.filter.resets.state_resets import (
    reset_local_horizontal_position_to,
    reset_quat_state_yaw,
    reset_velocity_to,
)
from fusetune.ekf2.filter.source_stops.heading_and_field import stop_heading_and_field
from fusetune.ekf2.filter.vertical_innovations import fuse_vertical_velocity_apart
from fusetune.ekf2.filter.yaw_fusion import compute_yaw_innov_var_and_h, fuse_yaw
from fusetune.ekf2.numerics.rotations import (
    component_in_earth,
    euler_yaw,
    euler_yaw_as,
    quat_multiply,
    quat_normalise,
    quat_to_dcm,
    variance_in_earth,
    wrap_pi,
)

LEAST_STEP_VARIANCE = 0.5**2
LEAST_POSITION_VARIANCE = 0.01**2
LEAST_VELOCITY_VARIANCE = 0.05**2
LEAST_YAW_VARIANCE = 1e-4

VISION_STEPS = np.dtype([("position", "f8", (2,)), *fields("?", "is_known", "is_used", "is_turned")], align=True)
"""Sub-record `ekf.vision_steps`: the estimate (m) at the sample before, whether a step from there can be observed,
whether steps are; and whether the rotation of vision was ever found."""


@kernel
def control_vision_by_mask(ekf, params):
    """Use the external vision sample due now, if there is one; stop when none has come for 7 s."""
    sample, cs, mask = ekf.sensors.ev.sample, ekf.cs, int(params.EKF2_AID_MASK)
    if not ekf.sensors.ev.data_ready:
        if not is_newest_sample_recent(ekf, ekf.sensors.ev.newest_time_us, RESET_TIMEOUT_MAX):
            cs.ev_pos = False
            cs.ev_vel = False
            cs.ev_yaw = False
        return
    jumped = sample.reset_counter != ekf.ev.prev.reset_counter
    if ekf.gnss_arrivals.inhibits_ev_yaw:
        cs.ev_yaw = False
    _find_rotation(ekf, mask)
    if is_newest_sample_recent(ekf, ekf.sensors.ev.newest_time_us, 2 * EV_MAX_INTERVAL):
        _start(ekf, params, mask)
    if cs.ev_pos:
        _control_position(ekf, params, mask, jumped)
    if cs.ev_vel:
        _control_velocity(ekf, params, mask, jumped)
    if cs.ev_yaw:
        _control_yaw(ekf, params, jumped)
    ekf.ev.prev = sample
    steps = ekf.vision_steps
    steps.position[0], steps.position[1] = get_local_horizontal_position(ekf)


@kernel
def _do_not_turn(ekf):
    R = ekf.ev.R_ev_to_ekf
    for i in range(3):
        for j in range(3):
            R[i, j] = 1.0 if i == j else 0.0
    ekf.vision_steps.is_turned = True


@kernel
def _find_rotation(ekf, mask):
    """The rotation from vision to NED by this sample, where it is asked for and the yaw is not that of vision."""
    if (mask & MASK_ROTATE) != 0 and (mask & (MASK_POSITION | MASK_VELOCITY)) != 0 and not ekf.cs.ev_yaw:
        error, quat = ekf.scratch.quat_error, ekf.sensors.ev.sample.quat
        error[0], error[1], error[2], error[3] = quat[0], -quat[1], -quat[2], -quat[3]
        quat_multiply(ekf.q, error, error)
        quat_normalise(error)
        quat_to_dcm(error, ekf.ev.R_ev_to_ekf)
        ekf.vision_steps.is_turned = True
    elif not ekf.vision_steps.is_turned:
        _do_not_turn(ekf)


@kernel
def _start(ekf, params, mask):
    cs = ekf.cs
    if cs.tilt_align and cs.yaw_align:
        if (mask & MASK_POSITION) != 0 and not cs.ev_pos:
            cs.ev_pos = True
            ekf.events.starting_vision_pos_fusion = True
            reset_position_to_vision(ekf, params, mask)
        if (mask & MASK_VELOCITY) != 0 and not cs.ev_vel:
            cs.ev_vel = True
            ekf.events.starting_vision_vel_fusion = True
            _reset_velocity(ekf, params, mask)
    if (mask & MASK_YAW) != 0 and not cs.ev_yaw and cs.tilt_align and not ekf.gnss_arrivals.inhibits_ev_yaw:
        _reset_yaw(ekf, params)
        cs.yaw_align = True
        cs.ev_yaw = True
        cs.mag_dec = False
        stop_heading_and_field(ekf, params)
        ekf.events.starting_vision_yaw_fusion = True


@kernel
def _reset_yaw(ekf, params):
    variance = max(ekf.sensors.ev.sample.orientation_var[2], LEAST_YAW_VARIANCE)
    quat_to_dcm(ekf.sensors.ev.sample.quat, ekf.scratch.R)
    reset_quat_state_yaw(ekf, params, euler_yaw(ekf.scratch.R), variance)
    _do_not_turn(ekf)


@kernel
def _turned_position(ekf, mask):
    """Horizontal position (m) of the sample in the frame of the estimate."""
    pos, R = ekf.sensors.ev.sample.pos, ekf.ev.R_ev_to_ekf
    if (mask & MASK_ROTATE) == 0:
        return pos[0], pos[1]
    return component_in_earth(R, 0, pos[0], pos[1], pos[2]), component_in_earth(R, 1, pos[0], pos[1], pos[2])


@kernel
def reset_position_to_vision(ekf, params, mask):
    """Set the horizontal position to the sample's."""
    ekf.events.reset_pos_to_vision = True
    north, east = _turned_position(ekf, mask)
    variance = ekf.sensors.ev.sample.position_var
    reset_local_horizontal_position_to(ekf, params, north, east, variance[0], variance[1])
    ekf.vision_steps.is_known = False


@kernel
def _control_position(ekf, params, mask, jumped):
    steps, aid, sample = ekf.vision_steps, ekf.aid.ev_pos, ekf.sensors.ev.sample
    if jumped and ekf.cs_prev.ev_pos and not steps.is_used:
        reset_position_to_vision(ekf, params, mask)
    px, py, pz = sensor_offset_body(params)
    for i in range(3):
        sample.pos[i] -= component_in_earth(ekf.R_to_earth, i, px, py, pz)
    steps.is_used = (mask & MASK_GNSS) != 0
    estimate = get_local_horizontal_position(ekf)
    innovation, variance = aid.innovation, aid.observation_variance
    if not steps.is_used:
        _observe_position(ekf, mask, estimate)
        if is_timed_out(ekf, ekf.time_last_hor_pos_fuse, RESET_TIMEOUT_MAX):
            _recover_position(ekf, params, mask)
    elif steps.is_known:
        _observe_step(ekf, estimate)
    else:
        # PX4 fuses what it observed last, as if it were exact
        steps.is_known = True
        variance[0], variance[1] = 0.0, 0.0
    _fuse_position(ekf, params, innovation[0], innovation[1], variance[0], variance[1])


@kernel
def _observe_position(ekf, mask, estimate):
    aid, reported = ekf.aid.ev_pos, ekf.sensors.ev.sample.position_var
    measured = _turned_position(ekf, mask)
    for i in range(2):
        variance = reported[i]
        if (mask & MASK_ROTATE) != 0:
            variance = variance_in_earth(ekf.ev.R_ev_to_ekf, i, reported)
        aid.observation_variance[i] = max(variance, LEAST_POSITION_VARIANCE)
        aid.innovation[i] = estimate[i] - measured[i]


@kernel
def _observe_step(ekf, estimate):
    aid, R, steps = ekf.aid.ev_pos, ekf.ev.R_ev_to_ekf, ekf.vision_steps
    now, before = ekf.sensors.ev.sample.pos, ekf.ev.prev.pos
    x, y, z = now[0] - before[0], now[1] - before[1], now[2] - before[2]
    for i in range(2):
        variance = variance_in_earth(R, i, ekf.sensors.ev.sample.position_var)
        aid.observation_variance[i] = max(variance, LEAST_STEP_VARIANCE)
        aid.innovation[i] = estimate[i] - steps.position[i] - component_in_earth(R, i, x, y, z)


@kernel
def _recover_position(ekf, params, mask):
    """No position was fused for 7 s: take this one and, where nothing else holds it, its velocity."""
    flow_lost = is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, NO_AID_TIMEOUT_MAX)
    if flow_lost and is_timed_out(ekf, ekf.time_last_hor_vel_fuse, NO_AID_TIMEOUT_MAX) and ekf.cs.ev_vel:
        _reset_velocity(ekf, params, mask)
    reset_position_to_vision(ekf, params, mask)


@kernel
def _fuse_position(ekf, params, north, east, var_north, var_east):
    """Judge both axes together, and fuse them."""
    aid, innovation, variance = ekf.aid.ev_pos, (north, east), (var_north, var_east)
    estimate = get_local_horizontal_position(ekf)
    for i in range(2):
        innovation_variance = ekf.P[POSITION + i, POSITION + i] + variance[i]
        set_axis(aid, i, estimate[i] - innovation[i], variance[i], innovation[i], innovation_variance)
    update_aid_source_status(ekf, aid, 2, ekf.sensors.ev.sample.time_us, max(params.EKF2_EVP_GATE, 1.0))
    ekf.reject.hor_pos = aid.innovation_rejected
    if aid.innovation_rejected:
        return
    fused = True
    for i in range(2):
        one = fuse_direct_state(ekf, params, innovation[i], aid.innovation_variance[i], variance[i], POSITION + i)
        fused = one and fused
    aid.fused = fused
    if fused:
        aid.time_last_fuse = ekf.time_delayed_us


@kernel
def _turn_velocity(ekf, params, mask):
    """Velocity (m/s) of the IMU and its variances along north, east and down, into `ekf.ev`."""
    sample, ev, R = ekf.sensors.ev.sample, ekf.ev, ekf.R_to_earth
    ox, oy, oz = sensor_velocity_body(ekf, params)
    x, y, z = sample.vel[0], sample.vel[1], sample.vel[2]
    for i in range(3):
        measured, variance = sample.vel[i], sample.velocity_var[i]
        if sample.vel_frame == EV_FRAME_BODY_FRD:
            measured, variance = component_in_earth(R, i, x, y, z), variance_in_earth(R, i, sample.velocity_var)
        elif (mask & MASK_ROTATE) != 0:
            measured = component_in_earth(ev.R_ev_to_ekf, i, x, y, z)
            variance = variance_in_earth(ev.R_ev_to_ekf, i, sample.velocity_var)
        ev.vel_measurement[i] = measured - component_in_earth(R, i, ox, oy, oz)
        ev.vel_measurement_var[i] = variance


@kernel
def _reset_velocity(ekf, params, mask):
    ekf.events.reset_vel_to_vision = True
    _turn_velocity(ekf, params, mask)
    reset_velocity_to(ekf, params, ekf.ev.vel_measurement, ekf.ev.vel_measurement_var)


@kernel
def _control_velocity(ekf, params, mask, jumped):
    """Reset where vision jumped or nothing was fused for 7 s; horizontal and vertical are gated apart.

    What is observed is held against the velocity of before a reset that nothing but the time-out asks for.
    """
    if jumped and ekf.cs_prev.ev_vel:
        _reset_velocity(ekf, params, mask)
    _turn_velocity(ekf, params, mask)
    measured, reported, vel = ekf.ev.vel_measurement, ekf.ev.vel_measurement_var, ekf.vel
    innovation = (vel[0] - measured[0], vel[1] - measured[1], vel[2] - measured[2])
    if is_timed_out(ekf, ekf.time_last_hor_vel_fuse, RESET_TIMEOUT_MAX):
        flow_lost = is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, NO_AID_TIMEOUT_MAX)
        if flow_lost and is_timed_out(ekf, ekf.time_last_hor_pos_fuse, NO_AID_TIMEOUT_MAX):
            _reset_velocity(ekf, params, mask)
    variance = (
        max(reported[0], LEAST_VELOCITY_VARIANCE),
        max(reported[1], LEAST_VELOCITY_VARIANCE),
        max(reported[2], LEAST_VELOCITY_VARIANCE),
    )
    _fuse_velocity(ekf, params, innovation, variance)


@kernel
def _fuse_velocity(ekf, params, innovation, variance):
    aid, gate = ekf.aid.ev_vel, max(params.EKF2_EVV_GATE, 1.0)
    passing, fused = True, True
    for i in range(2):
        innovation_variance = ekf.P[VELOCITY + i, VELOCITY + i] + variance[i]
        set_axis(aid, i, ekf.ev.vel_measurement[i], variance[i], innovation[i], innovation_variance)
        passing = passing and innovation[i] * innovation[i] <= gate * gate * innovation_variance
    ekf.reject.hor_vel = not passing
    for i in range(2):
        if passing:
            one = fuse_direct_state(ekf, params, innovation[i], aid.innovation_variance[i], variance[i], VELOCITY + i)
            fused = one and fused
    rejected_down, fused_down = fuse_vertical_velocity_apart(
        ekf, params, aid, gate, ekf.ev.vel_measurement[2], variance[2], innovation[2], True
    )
    update_aid_source_status(ekf, aid, 3, ekf.sensors.ev.sample.time_us, gate)
    ekf.vertical.ev_rejected, ekf.vertical.ev_fused = rejected_down, fused_down
    aid.innovation_rejected, aid.fused = not passing, passing and fused
    if aid.fused:
        aid.time_last_fuse = ekf.time_delayed_us


@kernel
def _control_yaw(ekf, params, jumped):
    """Fuse the yaw, which of vision and estimate is by the sequence that suits the estimate's tilt."""
    if jumped and ekf.cs_prev.ev_yaw:
        _reset_yaw(ekf, params)
    aid, sample = ekf.aid.ev_yaw, ekf.sensors.ev.sample
    quat_to_dcm(sample.quat, ekf.scratch.R)
    measured = euler_yaw_as(ekf.scratch.R, ekf.R_to_earth)
    variance = max(sample.orientation_var[2], LEAST_YAW_VARIANCE)
    innovation_variance = compute_yaw_innov_var_and_h(ekf, variance, ekf.scratch.H)
    set_axis(aid, 0, measured, variance, wrap_pi(euler_yaw(ekf.R_to_earth) - measured), innovation_variance)
    update_aid_source_status(ekf, aid, 1, sample.time_us, max(params.EKF2_HDG_GATE, 1.0))
    fuse_yaw(ekf, params, aid, ekf.scratch.H)
