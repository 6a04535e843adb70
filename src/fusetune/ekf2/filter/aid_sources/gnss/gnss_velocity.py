"""GNSS velocity: observation at the IMU, and its fusion.

Mirrors the velocity part of PX4 v1.16 `EKF/aid_sources/gnss/gps_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.antenna_offset import antenna_offset_body
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_VEL, forget_checks, have_checks_passed
from fusetune.ekf2.filter.aid_sources.gnss.gnss_resets import is_gnss_reset_allowed, may_start_without_reset
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import (
    get_number_of_active_horizontal_velocity_aiding_sources,
    is_height_reset_required,
    is_horizontal_aiding_active,
    is_other_source_than,
)
from fusetune.ekf2.filter.common.imu_rates import lever_rate
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.common.timing import RESET_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.resets.state_resets import reset_velocity_to, reset_vertical_velocity_to
from fusetune.ekf2.filter.velocity_fusion import fuse_velocity, limit_vertical_innovation
from fusetune.ekf2.numerics.lever_arm import velocity_of_offset
from fusetune.ekf2.numerics.rotations import rotate_to_earth
from fusetune.ekf2.releases.by_release import by_release

MIN_NOISE = 0.01
VERTICAL_NOISE_RATIO = 1.5


@kernel
def update_gnss_velocity(ekf, params, sample):
    """Judge a velocity sample, moved from the antenna to the IMU."""
    aid = ekf.aid.gnss_vel
    vel_n, vel_e, vel_d = velocity_of_antenna_offset(ekf, params)
    variance = max(sample.sacc, params.EKF2_GPS_V_NOISE, MIN_NOISE) ** 2
    _set_velocity_axis(ekf, aid, 0, sample.vel[0] - vel_n, variance)
    _set_velocity_axis(ekf, aid, 1, sample.vel[1] - vel_e, variance)
    _set_velocity_axis(ekf, aid, 2, sample.vel[2] - vel_d, variance * VERTICAL_NOISE_RATIO**2)
    gate = max(params.EKF2_GPS_V_GATE, 1.0)
    update_aid_source_status(ekf, aid, 3, sample.time_us, gate)

    # while the vertical acceleration is bad, an accurate velocity is what can still hold the height: limit, not reject
    relied_on = ekf.fs.bad_acc_vertical and not ekf.sensors.gnss.withheld
    if relied_on and _may_be_limited(ekf, params, aid, sample):
        limit_vertical_innovation(aid, gate)


@kernel
def _is_vertical_rejected_alone(ekf, params, aid, sample):
    only_vertical_rejected = aid.test_ratio[2] > 1.0 and aid.test_ratio[0] < 1.0 and aid.test_ratio[1] < 1.0
    return only_vertical_rejected and sample.sacc < params.EKF2_REQ_SACC


@kernel
def _is_rejected(ekf, params, aid, sample):
    return aid.innovation_rejected


_may_be_limited = by_release(_is_vertical_rejected_alone, "limits_climb_of_all_rejected", _is_rejected)


@kernel
def velocity_of_antenna_offset(ekf, params):
    """Velocity (m/s, NED) of the antenna relative to the IMU, from the rotation rate."""
    x, y, z = antenna_offset_body(params)
    if x == 0.0 and y == 0.0 and z == 0.0:
        return 0.0, 0.0, 0.0
    wx, wy, wz = lever_rate(ekf)
    vx, vy, vz = velocity_of_offset(wx, wy, wz, x, y, z)
    return rotate_to_earth(ekf.R_to_earth, vx, vy, vz)


@kernel
def _set_velocity_axis(ekf, aid, axis, velocity, variance):
    index = VELOCITY + axis
    set_axis(aid, axis, velocity, variance, ekf.vel[axis] - velocity, ekf.P[index, index] + variance)


@kernel
def _control_gnss_vel_fusion(ekf, params, force_reset):
    """Start, continue or stop fusing GNSS velocity with the sample that has just been judged."""
    aid = ekf.aid.gnss_vel
    enabled = int(params.EKF2_GPS_CTRL) & GPS_CTRL_VEL != 0
    continuing = enabled and ekf.cs.tilt_align and ekf.cs.yaw_align
    if ekf.cs.gnss_vel:
        if not continuing:
            stop_gnss_vel_fusion(ekf)
            return
        if force_reset:
            reset_velocity_to_gnss(ekf, params)
            return
        fuse_velocity(ekf, params, aid)
        if is_height_reset_required(ekf):
            reset_vertical_velocity_to(ekf, params, aid.observation[2], aid.observation_variance[2])
    elif continuing and have_checks_passed(ekf):
        ekf.events.starting_gps_fusion = True
        if needs_velocity_reset(ekf):
            reset_velocity_to_gnss(ekf, params)
        ekf.cs.gnss_vel = True


@kernel
def needs_velocity_reset(ekf):
    """Whether to start with a reset: not with another source that aids, unless the yaw has only now become known."""
    return (
        not is_horizontal_aiding_active(ekf)
        or is_timed_out(ekf, ekf.time_last_hor_vel_fuse, RESET_TIMEOUT_MAX)
        or not ekf.cs_prev.yaw_align
    )


@kernel
def _control_gnss_vel_fusion_apart(ekf, params, force_reset):
    """As v1.16's, but velocity starts without a reset where it agrees, and minds when it was fused itself."""
    aid, trust = ekf.aid.gnss_vel, ekf.gnss_trust
    enabled = int(params.EKF2_GPS_CTRL) & GPS_CTRL_VEL != 0
    continuing = enabled and ekf.cs.tilt_align and ekf.cs.yaw_align and not trust.fault and not trust.height_fault
    if ekf.cs.gnss_vel:
        if not continuing:
            stop_gnss_vel_fusion(ekf)
            return
        fuse_velocity(ekf, params, aid)
        if force_reset or is_timed_out(ekf, aid.time_last_fuse, RESET_TIMEOUT_MAX):
            if force_reset or _is_velocity_reset_allowed(ekf, params):
                reset_velocity_to_gnss(ekf, params)
            else:
                stop_gnss_vel_fusion(ekf)
    elif continuing and trust.passed:
        fused = may_start_without_reset(ekf, aid, force_reset) and fuse_velocity(ekf, params, aid)
        reset = not fused and (force_reset or _is_velocity_reset_allowed(ekf, params))
        if reset:
            reset_velocity_to_gnss(ekf, params)
        if fused or reset:
            ekf.events.starting_gps_fusion = True
            ekf.cs.gnss_vel = True


@kernel
def _is_velocity_reset_allowed(ekf, params):
    sources = get_number_of_active_horizontal_velocity_aiding_sources(ekf)
    aided = is_other_source_than(sources, ekf.cs.gnss_vel) and not ekf.cs.wind_dead_reckoning
    return is_gnss_reset_allowed(ekf, params, aided, ekf.cs.gnss_vel)


control_gnss_vel_fusion = by_release(
    _control_gnss_vel_fusion, "controls_gnss_sources_apart", _control_gnss_vel_fusion_apart
)


@kernel
def reset_velocity_to_gnss(ekf, params):
    """Set the velocity to the last GNSS velocity."""
    ekf.events.reset_vel_to_gps = True
    aid = ekf.aid.gnss_vel
    reset_velocity_to(ekf, params, aid.observation, aid.observation_variance)
    reset_aid_source_status_zero_innovation(ekf, aid, 3)


@kernel
def stop_gnss_vel_fusion(ekf):
    """Stop fusing velocity; with position stopped, too, the quality checks start anew."""
    if ekf.cs.gnss_vel:
        ekf.cs.gnss_vel = False
        forget_aid_source_status(ekf, ekf.aid.gnss_vel, 3)
        if not ekf.cs.gnss_pos:
            forget_checks(ekf)
