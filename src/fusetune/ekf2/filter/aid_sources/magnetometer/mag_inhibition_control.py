"""When v1.13 fuses the heading or the field, resets the yaw to them, and holds the heading where it may use neither.

Heading and field are told only where they are fused.

Mirrors PX4 v1.13 `EKF/mag_control.cpp`, and of `EKF/mag_fusion.cpp` and `EKF/ekf_helper.cpp` what it calls.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.magnetometer.field_checks import is_strength_disturbed
from fusetune.ekf2.filter.aid_sources.magnetometer.heading_or_field import fuse_field, judge_heading, mag_variance
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import judge_mag
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import measured_heading
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_modes import select_mode, update_declination_mode
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_resets import check_hagl_yaw_reset_req
from fusetune.ekf2.filter.aid_sources.magnetometer.yaw_by_course import realign_yaw_by_course, reset_yaw_to_field
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_INDOOR, MAG_TYPE_NONE
from fusetune.ekf2.filter.common.state import ATTITUDE, TERRAIN
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.covariance import reset_gyro_bias_z_cov, reset_mag_bias_cov
from fusetune.ekf2.filter.source_stops.heading_and_field import clear_heading_and_field
from fusetune.ekf2.filter.world_field import synthesise_z
from fusetune.ekf2.filter.yaw_fusion import fuse_yaw, judge_angle
from fusetune.ekf2.numerics.rotations import euler_yaw, wrap_pi

MAG_LPF_ALPHA = 0.1
INHIBITED_FOR_US = 5_000_000
STABILISING_US = 5_000_000
HELD_YAW_VARIANCE = 0.01
HELD_YAW_VARIANCE_MOVING = 0.25
ANGLE_VARIANCE_MIN = 1e-4
QUATERNION_VARIANCE_MAX = 1e-4


@kernel
def control_mag_with_inhibition(ekf, params):
    """Process the magnetometer sample that reached the fusion time horizon, if any."""
    is_new = ekf.sensors.mag.data_ready
    if is_new:
        _take_sample(ekf, params)
    if not ekf.cs.in_air:
        ekf.cs.mag_aligned_in_flight = False
        ekf.mag_modes.bad_yaw_events = 0

    other_yaw = ekf.cs.ev_yaw or ekf.cs.gnss_yaw
    if int(params.EKF2_MAG_TYPE) >= MAG_TYPE_NONE or ekf.cs.mag_fault or not ekf.cs.tilt_align:
        clear_heading_and_field(ekf, params)
        if not other_yaw:
            ekf.mag_modes.inhibited = True
            _fuse_held_yaw(ekf, params)
            ekf.mag_modes.inhibited = False
        return
    _note_reset_requests(ekf, other_yaw)
    if is_new and not other_yaw:
        if is_fusion_due(ekf.sensors.mag):
            _control_with_sample(ekf, params)
        else:
            _judge_withheld(ekf, params, ekf.sensors.mag.sample.mag)


@kernel
def filter_mag_sample(ekf):
    """Low-pass the field, also before the filter has started."""
    sample, mag = ekf.sensors.mag.sample.mag, ekf.mag
    weight = 1.0 if mag.counter == 0 else MAG_LPF_ALPHA
    for axis in range(3):
        mag.lpf[axis] += weight * (sample[axis] - mag.lpf[axis])
    mag.counter += 1


@kernel
def _take_sample(ekf, params):
    """Filter and check a sample; a new calibration begins with no body field."""
    if ekf.sensors.mag.sample.reset:
        ekf.mag_B[:] = 0.0
        reset_mag_bias_cov(ekf, params)
        for axis in range(3):
            ekf.mag_modes.saved_body_variance[axis] = mag_variance(params)
    filter_mag_sample(ekf)
    synthesise_z(ekf, params, ekf.sensors.mag.sample.mag)
    ekf.cs.mag_field_disturbed = is_strength_disturbed(ekf, params, ekf.sensors.mag.sample.mag)


@kernel
def _note_reset_requests(ekf, other_yaw):
    """The yaw is to be reset where it is not aligned, another source has stopped, or it could not be used for long."""
    modes = ekf.mag_modes
    stopped = modes.other_yaw_before and not other_yaw
    modes.other_yaw_before = other_yaw
    if stopped or not ekf.cs.yaw_align or modes.inhibited_for_long:
        modes.yaw_reset_requested = True


@kernel
def _judge_withheld(ekf, params, sample):
    """What the filter would have found of a sample that an experiment keeps from it."""
    if ekf.cs.mag_3d:
        ekf.aid.mag.timestamp_sample = ekf.sensors.mag.sample.time_us
        judge_mag(ekf, params, sample, mag_variance(params))
    elif ekf.cs.mag_hdg:
        ekf.aid.mag_heading.timestamp_sample = ekf.sensors.mag.sample.time_us
        judge_heading(ekf, params, sample)


@kernel
def _control_with_sample(ekf, params):
    """Choose the mode, reset the yaw where that is due, and fuse."""
    sample, modes = ekf.sensors.mag.sample.mag, ekf.mag_modes
    select_mode(ekf, params)
    if check_hagl_yaw_reset_req(ekf):
        modes.yaw_reset_requested = True
    if modes.yaw_reset_requested and not modes.inhibited:
        _reset_yaw(ekf, params)
    if not ekf.cs.yaw_align:
        return
    update_declination_mode(ekf, params)
    _update_inhibition(ekf, params)
    if ekf.cs.mag_3d:
        ekf.aid.mag.timestamp_sample = ekf.sensors.mag.sample.time_us
        stable = horizon_us(ekf) - ekf.mag.flt_mag_align_start_time > STABILISING_US
        fuse_field(ekf, params, sample, stable)
    else:
        ekf.aid.mag_heading.timestamp_sample = ekf.sensors.mag.sample.time_us
        x, y, z = sample[0] - ekf.mag_B[0], sample[1] - ekf.mag_B[1], sample[2] - ekf.mag_B[2]
        heading = measured_heading(ekf, params, x, y, z)
        _fuse_or_hold_yaw(ekf, params, ekf.aid.mag_heading, heading, params.EKF2_HEAD_NOISE * params.EKF2_HEAD_NOISE)


@kernel
def _reset_yaw(ekf, params):
    """Reset the yaw to the field, or a fixed wing's with GNSS to its course; that ends an inhibition."""
    modes = ekf.mag_modes
    if ekf.cs.in_air and is_north_east_aiding_active(ekf) and ekf.cs.fixed_wing:
        is_reset = realign_yaw_by_course(ekf, params)
    else:
        is_reset = not ekf.cs.mag_field_disturbed and reset_yaw_to_field(ekf, params)
    if not is_reset:
        return
    modes.yaw_reset_requested = False
    ekf.cs.yaw_align = True
    if ekf.cs.in_air:
        ekf.cs.mag_aligned_in_flight = True
    if modes.inhibited_for_long:
        modes.inhibited_for_long = False
        reset_gyro_bias_z_cov(ekf, params)


@kernel
def _update_inhibition(ekf, params):
    """Indoors the magnetometer is used only where position needs a yaw; a disturbed field nowhere."""
    modes, cs = ekf.mag_modes, ekf.cs
    is_needed = is_north_east_aiding_active(ekf) or cs.ev_pos or cs.ev_vel
    modes.inhibited = cs.mag_field_disturbed or (int(params.EKF2_MAG_TYPE) == MAG_TYPE_INDOOR and not is_needed)
    if not modes.inhibited:
        modes.time_last_used = horizon_us(ekf)
    elif horizon_us(ekf) - modes.time_last_used > INHIBITED_FOR_US:
        modes.inhibited_for_long = True


@kernel
def _fuse_held_yaw(ekf, params):
    """Fuse the yaw that the vehicle had when it came to rest, or the present one."""
    ekf.mag_modes.held_yaw.time_last_fuse = 0
    _fuse_or_hold_yaw(ekf, params, ekf.mag_modes.held_yaw, euler_yaw(ekf.R_to_earth), HELD_YAW_VARIANCE)


@kernel
def _fuse_or_hold_yaw(ekf, params, aid, heading, variance):
    """Fuse a heading (rad) of variance (rad²), if the magnetometer may be used.

    Else, at rest, the yaw at which it came to rest; in motion an innovation of zero once the attitude is uncertain.
    """
    modes, yaw = ekf.mag_modes, euler_yaw(ekf.R_to_earth)
    if not modes.inhibited:
        modes.static_yaw = yaw
    elif ekf.cs.vehicle_at_rest:
        if not math.isfinite(modes.static_yaw):
            modes.static_yaw = yaw
        heading = modes.static_yaw
    else:
        modes.static_yaw = yaw
        P = ekf.P
        uncertainty = P[TERRAIN, TERRAIN]
        for i in range(ATTITUDE, ATTITUDE + 3):
            uncertainty += P[i, i]
        if uncertainty > QUATERNION_VARIANCE_MAX:
            heading, variance = yaw, HELD_YAW_VARIANCE_MOVING
    last = aid.innovation[0]
    judge_angle(ekf, params, aid, heading, wrap_pi(yaw - heading), max(variance, ANGLE_VARIANCE_MIN))
    if not fuse_yaw(ekf, params, aid, ekf.scratch.H) and aid.innovation_rejected:
        # PX4 tells the innovation of the last heading that it fused
        aid.innovation[0] = last
