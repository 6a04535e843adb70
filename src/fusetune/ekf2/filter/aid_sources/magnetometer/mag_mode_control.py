"""When v1.14 fuses the heading or the field, and when it resets the yaw to them.

Of every sample heading and field are told, with a variance only if they are fused.

Mirrors PX4 v1.14 `EKF/mag_control.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.magnetometer.field_checks import is_strength_disturbed
from fusetune.ekf2.filter.aid_sources.magnetometer.heading_or_field import (
    fuse_field,
    fuse_heading,
    is_heading_wanted,
    judge_heading,
    mag_variance,
    reset_yaw_to_filtered_field,
    take_filtered_field,
)
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import judge_mag, predict_mag
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import measured_heading
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_modes import select_mode, update_declination_mode
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_resets import check_hagl_yaw_reset_req, put_body_field
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status, set_axis
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_3D, MAG_TYPE_INDOOR, MAG_TYPE_NONE
from fusetune.ekf2.filter.common.global_position import single_precision
from fusetune.ekf2.filter.common.state import MAG_BODY
from fusetune.ekf2.filter.common.timing import MAG_MAX_INTERVAL, horizon_us, is_newest_sample_recent, is_timed_out
from fusetune.ekf2.filter.covariance import reset_mag_bias_cov
from fusetune.ekf2.filter.field_covariance import reset_field_covariance
from fusetune.ekf2.filter.output_predictor.output_predictor import align_output_predictor
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.source_stops.heading_and_field import stop_heading_and_field
from fusetune.ekf2.filter.world_field import is_wmm_field_known, synthesise_z
from fusetune.ekf2.filter.yaw_estimator.converged_yaw import is_yaw_emergency_estimate_available
from fusetune.ekf2.numerics.rotations import dcm_to_quat, euler_yaw, quat_to_dcm, update_yaw_in_rot_mat, wrap_pi

MAG_LPF_ALPHA = 0.1
LEVELLING_INTERVAL_US = 100_000
LEAST_CHANGE_WHILE_LEVELLING = np.radians(1.0)
INHIBITED_FOR_US = 5_000_000
BODY_FIELD_KNOWN_VARIANCE = float(np.float32(0.02) * np.float32(0.02))


@kernel
def control_mag_modes(ekf, params):
    """Process the magnetometer sample that reached the fusion time horizon, if any."""
    is_new = ekf.sensors.mag.data_ready
    if is_new:
        _take_sample(ekf, params)
    elif not is_newest_sample_recent(ekf, ekf.sensors.mag.newest_time_us, 2 * MAG_MAX_INTERVAL):
        stop_heading_and_field(ekf, params)
    if not ekf.cs.in_air:
        ekf.cs.mag_aligned_in_flight = False

    if is_new and not ekf.cs.tilt_align and not ekf.cs.yaw_align:
        _align_while_levelling(ekf, params)
        return
    if int(params.EKF2_MAG_TYPE) >= MAG_TYPE_NONE or ekf.cs.mag_fault or not ekf.cs.tilt_align:
        stop_heading_and_field(ekf, params)
        return
    if not ekf.cs.yaw_align:
        ekf.mag_modes.yaw_reset_requested = True
    if is_new and not ekf.cs.ev_yaw and not ekf.cs.gnss_yaw:
        if is_fusion_due(ekf.sensors.mag):
            _control_with_sample(ekf, params)
        else:
            _judge_withheld(ekf, params, ekf.sensors.mag.sample.mag)


@kernel
def _take_sample(ekf, params):
    """Filter and check a sample, and tell what heading and field it shows."""
    mag, arrived = ekf.mag, ekf.sensors.mag.sample
    sample = arrived.mag
    if arrived.reset or mag.counter == 0:
        ekf.mag_B[:] = 0.0
        reset_mag_bias_cov(ekf, params)
        ekf.mag_modes.saved_body_variance[:] = 0.0
        ekf.cs.mag_fault = False
        for axis in range(3):
            mag.lpf[axis] = sample[axis]
        mag.counter = 1
    else:
        for axis in range(3):
            mag.lpf[axis] += MAG_LPF_ALPHA * (sample[axis] - mag.lpf[axis])
        mag.counter += 1
    synthesise_z(ekf, params, sample)
    ekf.cs.mag_field_disturbed = is_strength_disturbed(ekf, params, sample)
    _tell_sample(ekf, params, sample, arrived.time_us)


@kernel
def _tell_sample(ekf, params, sample, time_us):
    """What is seen before it is known whether it will be fused."""
    heading, field = ekf.aid.mag_heading, ekf.aid.mag
    forget_aid_source_status(ekf, heading, 1)
    forget_aid_source_status(ekf, field, 3)
    heading.timestamp_sample = field.timestamp_sample = time_us
    x, y, z = sample[0] - ekf.mag_B[0], sample[1] - ekf.mag_B[1], sample[2] - ekf.mag_B[2]
    observed = measured_heading(ekf, params, x, y, z)
    set_axis(heading, 0, observed, 0.0, wrap_pi(euler_yaw(ekf.R_to_earth) - observed), 0.0)
    for axis in range(3):
        set_axis(field, axis, sample[axis] - ekf.mag_B[axis], 0.0, predict_mag(ekf, axis) - sample[axis], 0.0)


@kernel
def _align_while_levelling(ekf, params):
    """Follow the heading of the low-passed field, at most every 100 ms and by more than 1°; nothing is aligned yet."""
    heading, lpf = ekf.aid.mag_heading, ekf.mag.lpf
    if int(params.EKF2_MAG_TYPE) > MAG_TYPE_3D or ekf.mag.counter <= 1:
        return
    if not is_timed_out(ekf, heading.time_last_fuse, LEVELLING_INTERVAL_US):
        return
    yaw = measured_heading(ekf, params, lpf[0], lpf[1], lpf[2])
    if not abs(yaw - euler_yaw(ekf.R_to_earth)) > LEAST_CHANGE_WHILE_LEVELLING:
        return
    quat_to_dcm(ekf.q, ekf.scratch.R)
    update_yaw_in_rot_mat(yaw, ekf.scratch.R, ekf.R_to_earth)
    dcm_to_quat(ekf.R_to_earth, ekf.q)
    align_output_predictor(ekf)
    take_filtered_field(ekf)
    ekf.mag_B[:] = 0.0
    heading.time_last_fuse = ekf.time_delayed_us
    ekf.time_last_heading_fuse = ekf.time_delayed_us
    ekf.mag_modes.static_yaw = np.nan


@kernel
def _judge_withheld(ekf, params, sample):
    """What the filter would have found of a sample that an experiment keeps from it."""
    if ekf.cs.mag_3d:
        judge_mag(ekf, params, sample, mag_variance(params))
    elif ekf.cs.mag_hdg:
        judge_heading(ekf, params, sample)


@kernel
def _control_with_sample(ekf, params):
    """Choose the mode, reset the yaw where that is due, and fuse."""
    sample, modes = ekf.sensors.mag.sample.mag, ekf.mag_modes
    if _is_inhibited(ekf, params):
        if ekf.time_delayed_us - modes.time_last_used > INHIBITED_FOR_US:
            stop_heading_and_field(ekf, params)
        return
    modes.time_last_used = ekf.time_delayed_us

    was_fused = ekf.cs_prev.mag_hdg or ekf.cs_prev.mag_3d
    select_mode(ekf, params)
    is_due = modes.yaw_reset_requested or not was_fused or ekf.sensors.mag.sample.reset
    if is_due or not ekf.cs.yaw_align or check_hagl_yaw_reset_req(ekf):
        modes.yaw_reset_requested = not _reset_yaw(ekf, params)
    if not ekf.cs.yaw_align:
        return
    update_declination_mode(ekf, params)
    if ekf.cs.mag_3d:
        fuse_field(ekf, params, sample, _is_body_field_known(ekf))
    else:
        fuse_heading(ekf, params, sample)


@kernel
def _is_inhibited(ekf, params):
    """Indoors the magnetometer is used only where GNSS needs a yaw; a disturbed field nowhere."""
    indoors = int(params.EKF2_MAG_TYPE) == MAG_TYPE_INDOOR and not is_north_east_aiding_active(ekf)
    return indoors or ekf.cs.mag_field_disturbed


@kernel
def _is_body_field_known(ekf):
    """Whether the field may correct more than its own states: aligned in flight, its body part known to 0.02 Gauss.

    In single precision, as PX4 compares: a noise of 0.02 Gauss is what the variance begins with.
    """
    P = ekf.P
    a, b, c = P[MAG_BODY, MAG_BODY], P[MAG_BODY + 1, MAG_BODY + 1], P[MAG_BODY + 2, MAG_BODY + 2]
    return (
        ekf.cs.mag_aligned_in_flight
        and min(a, b, c) > 0.0
        and single_precision(max(a, b, c)) < BODY_FIELD_KNOWN_VARIANCE
    )


@kernel
def _reset_yaw(ekf, params):
    """Reset the yaw, to the yaw estimator with GNSS, else to the field; once per update. Return whether it was."""
    is_repeated = ekf.mag.flt_mag_align_start_time == horizon_us(ekf)
    if is_repeated or ekf.cs_prev.yaw_align != ekf.cs.yaw_align or ekf.mag.counter <= 1:
        return False
    if is_north_east_aiding_active(ekf) and is_yaw_emergency_estimate_available(ekf):
        _reset_to_yaw_estimator(ekf, params)
    elif is_heading_wanted(ekf, params) and not is_strength_disturbed(ekf, params, ekf.mag.lpf):
        reset_yaw_to_filtered_field(ekf, params)
    else:
        return False
    ekf.cs.yaw_align = True
    if ekf.cs.in_air:
        ekf.cs.mag_aligned_in_flight = True
        ekf.mag.flt_mag_align_start_time = horizon_us(ekf)
    return True


@kernel
def _reset_to_yaw_estimator(ekf, params):
    """Set the yaw to the yaw estimator's, the earth field to the model's, and the body field to what remains."""
    reset_quat_state_yaw(ekf, params, ekf.gsf.yaw, ekf.gsf.yaw_variance)
    ekf.events.yaw_aligned_to_imu_gps = True
    if is_wmm_field_known(ekf):
        for axis in range(3):
            ekf.mag_I[axis] = ekf.mag.wmm_earth_field[axis]
        put_body_field(ekf, ekf.mag.lpf, 0.0)
    else:
        take_filtered_field(ekf)
        ekf.mag_B[:] = 0.0
    reset_field_covariance(ekf, params)
