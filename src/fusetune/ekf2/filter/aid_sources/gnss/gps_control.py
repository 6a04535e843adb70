"""What GNSS does at each update: checks, yaw estimator, heading, velocity and position, in the order of PX4 v1.16.

Mirrors PX4 v1.16 `EKF/aid_sources/gnss/gps_control.cpp`, of which `gnss_velocity.py`, `gnss_position.py` and
`yaw_emergency.py` hold the parts.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.gnss.gnss_height_control import stop_gps_hgt_fusion
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import (
    GPS_CTRL_HPOS,
    GPS_CTRL_VEL,
    forget_checks,
    have_checks_passed,
)
from fusetune.ekf2.filter.aid_sources.gnss.gnss_position import (
    control_gnss_pos_fusion,
    reset_horizontal_position_to_gnss,
    stop_gnss_pos_fusion,
    update_gnss_position,
)
from fusetune.ekf2.filter.aid_sources.gnss.gnss_velocity import (
    control_gnss_vel_fusion,
    needs_velocity_reset,
    reset_velocity_to_gnss,
    stop_gnss_vel_fusion,
    update_gnss_velocity,
)
from fusetune.ekf2.filter.aid_sources.gnss.gnss_yaw_control import control_gnss_yaw_fusion
from fusetune.ekf2.filter.aid_sources.gnss.gps_checks import check_gnss_sample
from fusetune.ekf2.filter.aid_sources.gnss.origin_by_checks import collect_gnss_sample
from fusetune.ekf2.filter.aid_sources.gnss.yaw_emergency import control_gnss_yaw_estimator, try_yaw_emergency_reset
from fusetune.ekf2.filter.common.imu_rates import gyro_bias
from fusetune.ekf2.filter.common.timing import (
    GNSS_MAX_INTERVAL,
    RESET_TIMEOUT_MAX,
    is_newest_sample_recent,
    is_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.position_fusion import fuse_horizontal_position
from fusetune.ekf2.filter.source_stops.yaw import stop_gnss_yaw_fusion
from fusetune.ekf2.filter.velocity_fusion import fuse_velocity
from fusetune.ekf2.filter.yaw_estimator.converged_yaw import is_yaw_failure
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import reset_gsf, set_gyro_bias
from fusetune.ekf2.filter.yaw_estimator.yaw_bank import predict_yaw_bank
from fusetune.ekf2.releases.by_release import by_release

YAW_EMERGENCY_DELAY = 1_000_000
"""How long (µs) horizontal velocity must have been rejected before the yaw is blamed."""


@kernel
def control_gnss_fusion(ekf, params):
    """Run GNSS for one update, with the sample in `ekf.sensors.gnss.sample` if `ekf.sensors.gnss.data_ready`.

    A sample that fails the checks is not used: `ekf.sensors.gnss.data_ready` is cleared, for the height, too.
    """
    if not ekf.sensors.gnss.exists or int(params.EKF2_GPS_CTRL) == 0:
        stop_gnss_fusion(ekf)
        return

    _run_yaw_estimator(ekf)
    ekf.gnss.intermittent = not is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL)

    if ekf.sensors.gnss.data_ready:
        if not check_gnss_sample(ekf, params, ekf.sensors.gnss.sample):
            ekf.sensors.gnss.data_ready = False
            if _uses_gnss(ekf) and is_timed_out(ekf, ekf.gnss.last_pass_us, RESET_TIMEOUT_MAX):
                stop_gnss_fusion(ekf)
        else:
            collect_gnss_sample(ekf, ekf.sensors.gnss.sample)
        update_gnss_position(ekf, params, ekf.sensors.gnss.sample)
        update_gnss_velocity(ekf, params, ekf.sensors.gnss.sample)
    elif _uses_gnss(ekf) and not is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_time_us, RESET_TIMEOUT_MAX):
        stop_gnss_fusion(ekf)

    if is_fusion_due(ekf.sensors.gnss):
        control_gnss_yaw_fusion(ekf, params, ekf.sensors.gnss.sample)
        control_gnss_yaw_estimator(ekf, params)
        _control_velocity_and_position(ekf, params)


@kernel
def _uses_gnss(ekf):
    return ekf.cs.gnss_vel or ekf.cs.gnss_pos


@kernel
def _run_yaw_estimator(ekf):
    inhibited = ekf.gyro_bias_inhibit[0] or ekf.gyro_bias_inhibit[1] or ekf.gyro_bias_inhibit[2]
    if not inhibited:
        set_gyro_bias(ekf.gsf, gyro_bias(ekf), ekf.cs.vehicle_at_rest)
    predict_yaw_bank(ekf, ekf.imu_delayed, ekf.cs.in_air and not ekf.cs.vehicle_at_rest)


@kernel
def _control_each(ekf, params):
    """Decide about a reset first, since one of the two would hide the need of the other."""
    force_reset = _is_reset_due(ekf, params)
    control_gnss_vel_fusion(ekf, params, force_reset)
    control_gnss_pos_fusion(ekf, params, force_reset)


@kernel
def _control_together(ekf, params):
    """Start, continue or stop velocity and position as one; where both have timed out they are reset once fused."""
    control = int(params.EKF2_GPS_CTRL)
    enabled = control & (GPS_CTRL_VEL | GPS_CTRL_HPOS) != 0
    continuing = enabled and ekf.cs.tilt_align and ekf.cs.yaw_align and ekf.origin.valid
    if _uses_gnss(ekf) and not continuing:
        stop_gnss_fusion(ekf)
    elif _uses_gnss(ekf):
        if control & GPS_CTRL_VEL != 0:
            fuse_velocity(ekf, params, ekf.aid.gnss_vel)
        if control & GPS_CTRL_HPOS != 0:
            fuse_horizontal_position(ekf, params, ekf.aid.gnss_pos)
        if _is_joint_reset_due(ekf, params):
            _reset_to_gnss(ekf, params, True)
    elif continuing and have_checks_passed(ekf):
        ekf.events.starting_gps_fusion = True
        _reset_to_gnss(ekf, params, needs_velocity_reset(ekf))
        ekf.cs.gnss_vel = True
        ekf.cs.gnss_pos = True


@kernel
def _reset_to_gnss(ekf, params, with_velocity):
    if with_velocity and int(params.EKF2_GPS_CTRL) & GPS_CTRL_VEL != 0:
        reset_velocity_to_gnss(ekf, params)
    if int(params.EKF2_GPS_CTRL) & GPS_CTRL_HPOS != 0:
        reset_horizontal_position_to_gnss(ekf, params)


_control_velocity_and_position = by_release(_control_each, "aids_by_one_gnss_flag", _control_together)


@kernel
def _is_joint_reset_due(ekf, params):
    """Whether velocity and position are to be reset; decided once for both, since resetting one would hide the need.

    A yaw found wrong in flight is put right here, and calls for a reset of both.
    """
    if not _uses_gnss(ekf):
        return False
    due = should_reset_gnss_fusion(ekf, params)
    if has_yaw_failed(ekf):
        due = try_yaw_emergency_reset(ekf, params)
    return due


@kernel
def _is_yaw_put_right(ekf, params):
    """Whether the yaw was found wrong in flight and has been put right; the sources see to their own time-outs."""
    if ekf.gnss_trust.fault or not _uses_gnss(ekf):
        return False
    return _is_yaw_blamed(ekf) and try_yaw_emergency_reset(ekf, params)


@kernel
def has_yaw_failed(ekf):
    """Whether horizontal velocity has been rejected for too long in flight, and the yaw is off."""
    return (
        ekf.cs.in_air
        and is_yaw_failure(ekf)
        and is_timed_out(ekf, ekf.time_last_hor_vel_fuse, YAW_EMERGENCY_DELAY)
        and ekf.time_last_hor_vel_fuse > ekf.time_last_on_ground
    )


@kernel
def _is_rejected_yaw_wrong(ekf):
    """Whether in flight velocity, or position, is being rejected and has been for too long, and the yaw is off."""
    if not ekf.cs.in_air or not is_yaw_failure(ekf):
        return False
    velocity = ekf.cs.gnss_vel and ekf.aid.gnss_vel.innovation_rejected and _is_failing(ekf, ekf.time_last_hor_vel_fuse)
    position = ekf.cs.gnss_pos and ekf.aid.gnss_pos.innovation_rejected and _is_failing(ekf, ekf.time_last_hor_pos_fuse)
    return velocity or position


@kernel
def _is_failing(ekf, time_last_fuse):
    return is_timed_out(ekf, time_last_fuse, YAW_EMERGENCY_DELAY) and time_last_fuse > ekf.time_last_on_ground


_is_yaw_blamed = by_release(has_yaw_failed, "blames_yaw_for_rejections", _is_rejected_yaw_wrong)
_is_reset_due = by_release(_is_joint_reset_due, "controls_gnss_sources_apart", _is_yaw_put_right)


@kernel
def should_reset_gnss_fusion(ekf, params):
    """Whether nothing has bounded the horizontal drift for 7 s, or no position has for 14 s."""
    pos_timed_out = is_timed_out(ekf, ekf.time_last_hor_pos_fuse, RESET_TIMEOUT_MAX)
    vel_timed_out = is_timed_out(ekf, ekf.time_last_hor_vel_fuse, RESET_TIMEOUT_MAX)
    aiding_timed_out = pos_timed_out and vel_timed_out
    if aiding_timed_out and ekf.cs.opt_flow:
        if is_recent(ekf, ekf.aid.optical_flow.time_last_fuse, RESET_TIMEOUT_MAX):
            aiding_timed_out = False
    position_lost = is_timed_out(ekf, ekf.time_last_hor_pos_fuse, 2 * RESET_TIMEOUT_MAX) and _may_miss_position(
        ekf, params
    )
    failing_since_take_off = (
        ekf.cs.in_air
        and vel_timed_out
        and pos_timed_out
        and ekf.time_last_hor_vel_fuse > ekf.time_last_on_ground
        and ekf.time_last_hor_pos_fuse > ekf.time_last_on_ground
    )
    return aiding_timed_out or position_lost or failing_since_take_off


@kernel
def _is_position_enabled(ekf, params):
    return int(params.EKF2_GPS_CTRL) & GPS_CTRL_HPOS != 0


@kernel
def _always(ekf, params):
    return True


_may_miss_position = by_release(_is_position_enabled, "aids_by_one_gnss_flag", _always)


@kernel
def stop_gnss_fusion(ekf):
    """Stop everything that GNSS gives."""
    if _uses_gnss(ekf):
        forget_checks(ekf)
    stop_gnss_vel_fusion(ekf)
    stop_gnss_pos_fusion(ekf)
    stop_gps_hgt_fusion(ekf)
    stop_gnss_yaw_fusion(ekf)
    reset_gsf(ekf.gsf)
