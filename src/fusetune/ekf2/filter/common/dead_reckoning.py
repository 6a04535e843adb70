"""For how long the filter has navigated without aiding, and so whether position and velocity are still valid.

Mirrors `updateDeadReckoningStatus` of PX4 v1.16 `EKF/ekf_helper.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import (
    is_vertical_position_aiding_active,
    is_vertical_velocity_aiding_active,
)
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, is_recent, is_timed_out
from fusetune.ekf2.releases.by_release import by_release


@kernel
def update_dead_reckoning_status(ekf, params):
    """Renew the dead-reckoning flags and validity timers at the end of an update."""
    _update_horizontal(ekf, params)
    _update_vertical(ekf, params)


@kernel
def _is_fused_recently(ekf, time_last_fuse):
    return is_recent(ekf, time_last_fuse, NO_AID_TIMEOUT_MAX)


@kernel
def _update_by_any_aiding(ekf, params):
    """As v1.16's, but position and velocity stand in for each other, and nothing stands in for aiding on the ground."""
    cs = ekf.cs
    fused = _is_fused_recently(ekf, ekf.time_last_hor_pos_fuse) or _is_fused_recently(ekf, ekf.time_last_hor_vel_fuse)
    aided = (cs.gnss_vel or cs.gnss_pos or cs.ev_pos or cs.ev_vel or cs.aux_gpos) and fused
    flow = cs.opt_flow and _is_fused_recently(ekf, ekf.aid.optical_flow.time_last_fuse)
    air_data = (
        cs.wind
        and _is_fused_recently(ekf, ekf.aid.airspeed.time_last_fuse)
        and _is_fused_recently(ekf, ekf.aid.sideslip.time_last_fuse)
    )
    cs.wind_dead_reckoning = air_data and not (aided or flow)
    cs.inertial_dead_reckoning = not (aided or flow or air_data)
    if not cs.inertial_dead_reckoning and ekf.time_delayed_us > NO_AID_TIMEOUT_MAX:
        ekf.time_last_horizontal_aiding = ekf.time_delayed_us - NO_AID_TIMEOUT_MAX
    ekf.horizontal_deadreckon_time_exceeded = is_timed_out(
        ekf, ekf.time_last_horizontal_aiding, int(params.EKF2_NOAID_TOUT)
    )


@kernel
def _update_by_each_aiding(ekf, params):
    """Nothing that bounds horizontal drift fused for a second is inertial dead reckoning.

    On ground, standing still counts as aiding if air data or optical flow will take over once in the air.
    """
    cs = ekf.cs
    velocity = (cs.gnss_vel or cs.ev_vel) and _is_fused_recently(ekf, ekf.time_last_hor_vel_fuse)
    position = (cs.gnss_pos or cs.ev_pos or cs.aux_gpos) and _is_fused_recently(ekf, ekf.time_last_hor_pos_fuse)
    flow = cs.opt_flow and _is_fused_recently(ekf, ekf.aid.optical_flow.time_last_fuse)
    air_data = (
        cs.fuse_aspd
        and cs.fuse_beta
        and _is_fused_recently(ekf, ekf.aid.airspeed.time_last_fuse)
        and _is_fused_recently(ekf, ekf.aid.sideslip.time_last_fuse)
    )
    aided = velocity or position or flow
    cs.wind_dead_reckoning = air_data and not aided

    expected_in_air = (not flow and _is_flow_expected_in_air(ekf, params)) or (
        not air_data and _is_air_data_expected_in_air(ekf, params)
    )
    standing = _is_fused_recently(ekf, ekf.time_last_zero_velocity_fuse) or (
        cs.valid_fake_pos and _is_fused_recently(ekf, ekf.aid.fake_pos.time_last_fuse)
    )
    cs.inertial_dead_reckoning = not (aided or air_data or (standing and expected_in_air))

    if cs.inertial_dead_reckoning:
        if is_timed_out(ekf, ekf.time_last_horizontal_aiding, int(params.EKF2_NOAID_TOUT)):
            ekf.horizontal_deadreckon_time_exceeded = True
        return
    if ekf.time_delayed_us > NO_AID_TIMEOUT_MAX:
        ekf.time_last_horizontal_aiding = ekf.time_delayed_us - NO_AID_TIMEOUT_MAX
    ekf.horizontal_deadreckon_time_exceeded = False


@kernel
def _is_flow_expected_in_air(ekf, params):
    return (
        not ekf.cs.in_air
        and int(params.EKF2_OF_CTRL) == 1
        and _is_fused_recently(ekf, ekf.aid.optical_flow.timestamp_sample)
    )


@kernel
def _is_air_data_expected_in_air(ekf, params):
    return (
        not ekf.cs.in_air
        and ekf.cs.fixed_wing
        and int(params.EKF2_FUSE_BETA) == 1
        and params.EKF2_ARSP_THR > 0.0
        and _is_fused_recently(ekf, ekf.aid.airspeed.timestamp_sample)
    )


_update_horizontal = by_release(_update_by_each_aiding, "counts_aiding_of_any_kind", _update_by_any_aiding)


@kernel
def _update_vertical(ekf, params):
    """Height is invalid when unaided for too long; vertical velocity only when height is invalid, too."""
    timeout = int(params.EKF2_NOAID_TOUT)
    if is_vertical_position_aiding_active(ekf):
        ekf.time_last_v_pos_aiding = ekf.time_last_hgt_fuse
        ekf.vertical_position_deadreckon_time_exceeded = False
    elif is_timed_out(ekf, ekf.time_last_v_pos_aiding, timeout):
        ekf.vertical_position_deadreckon_time_exceeded = True

    if is_vertical_velocity_aiding_active(ekf):
        ekf.time_last_v_vel_aiding = ekf.time_last_ver_vel_fuse
        ekf.vertical_velocity_deadreckon_time_exceeded = False
    elif is_timed_out(ekf, ekf.time_last_v_vel_aiding, timeout) and ekf.vertical_position_deadreckon_time_exceeded:
        ekf.vertical_velocity_deadreckon_time_exceeded = True
