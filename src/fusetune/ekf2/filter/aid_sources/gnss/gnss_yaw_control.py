"""Heading from two GNSS antennas: observation equations and fusion.

With a the unit vector of the antenna baseline in the body frame, turned by the offset ψ₀ from the nose, and
v = R a in NED, the observed yaw is atan2(v_e, v_n). An attitude error δθ (NED, from the left) moves v by δθ × v.

Mirrors PX4 v1.16 `EKF/aid_sources/gnss/gnss_yaw_control.cpp`; the Jacobian is written out and not generated.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import is_gnss_distrusted, is_gnss_trusted
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_YAW, have_checks_passed
from fusetune.ekf2.filter.common.aid_source_status import (
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.state import ATTITUDE, ERROR_STATE_SIZE
from fusetune.ekf2.filter.common.timing import (
    GNSS_YAW_MAX_INTERVAL,
    RESET_TIMEOUT_MAX,
    is_newest_sample_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.covariance import initialise_covariance, reset_gyro_bias_z_cov
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import multiply_covariance, scale_kalman_gain
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import attitude_variance, complete_attitude_jacobian
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.source_stops.heading_and_field import stop_field, stop_heading
from fusetune.ekf2.filter.source_stops.yaw import stop_gnss_yaw_fusion
from fusetune.ekf2.numerics.constants import FLT_EPSILON_IN_EIGHT_DIGITS
from fusetune.ekf2.numerics.rotations import rotate_to_earth, wrap_pi
from fusetune.ekf2.releases.by_release import by_release, does

HEADING_NOISE = 0.1
"""Least standard deviation (rad) of the observed heading."""

_goes_on = does("retries_gnss_yaw")

STEEP_BASELINE = math.cos(math.radians(30.0))
WRONG_GYRO_BIAS_TEST_RATIO = 0.2
GYRO_BIAS_RESET_INTERVAL = 1_000_000
SIGNED_TEST_RATIO_ALPHA = 0.1


@kernel
def predict_gnss_yaw(R, yaw_offset, H):
    """Predicted antenna yaw (rad); its derivative by the attitude error goes into `H[0:3]`, the rest is zeroed."""
    v_n, v_e, v_d = rotate_to_earth(R, math.cos(yaw_offset), math.sin(yaw_offset), 0.0)
    # PX4's generated equations keep the arctangent off its singularity by the resolution of single precision
    v_n += FLT_EPSILON_IN_EIGHT_DIGITS if v_n >= 0.0 else -FLT_EPSILON_IN_EIGHT_DIGITS
    squared = v_n * v_n + v_e * v_e
    H[:] = 0.0
    H[ATTITUDE] = -v_n * v_d / squared
    H[ATTITUDE + 1] = -v_e * v_d / squared
    H[ATTITUDE + 2] = 1.0
    return math.atan2(v_e, v_n)


@kernel
def gnss_yaw_innovation_variance(P, H, R):
    """H P Hᵀ + R of a row `H` that is nonzero for the attitude only."""
    variance = R
    for i in range(3):
        for j in range(3):
            variance += H[ATTITUDE + i] * P[ATTITUDE + i, ATTITUDE + j] * H[ATTITUDE + j]
    return variance


@kernel
def _variance_of_errors(ekf, H, R):
    return gnss_yaw_innovation_variance(ekf.P, H, R)


@kernel
def _variance_of_quaternion(ekf, H, R):
    return attitude_variance(ekf, H) + R


_innovation_variance = by_release(_variance_of_errors, "adds_quaternion_errors", _variance_of_quaternion)


@kernel
def _control_gnss_yaw_fusion(ekf, params, sample):
    """Start, continue or stop fusing the heading of a GNSS sample."""
    if int(params.EKF2_GPS_CTRL) & GPS_CTRL_YAW == 0 or ekf.cs.gnss_yaw_fault:
        stop_gnss_yaw_fusion(ekf)
        return
    if not np.isfinite(sample.yaw):
        if ekf.cs.gnss_yaw and not is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_yaw_time_us, RESET_TIMEOUT_MAX):
            stop_gnss_yaw_fusion(ekf)
        return

    update_gnss_yaw(ekf, params, sample)
    continuing = _may_continue(ekf)
    starting = (
        continuing
        and _may_start(ekf)
        and not ekf.gnss.intermittent
        and is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_yaw_time_us, 2 * GNSS_YAW_MAX_INTERVAL)
    )
    if ekf.cs.gnss_yaw:
        if continuing:
            _continue_gnss_yaw(ekf, params, sample, starting)
        else:
            stop_gnss_yaw_fusion(ekf)
    elif starting:
        _start_gnss_yaw(ekf, params, sample)


@kernel
def _control_and_give_up_alignment(ekf, params, sample):
    """As v1.15's, but on the ground the alignment is lost whenever the heading has stopped in this update."""
    _control_gnss_yaw_fusion(ekf, params, sample)
    if not ekf.cs.in_air and not ekf.cs.gnss_yaw and ekf.cs_prev.gnss_yaw:
        ekf.cs.yaw_align = False


control_gnss_yaw_fusion = by_release(_control_gnss_yaw_fusion, "checks_gnss_on_arrival", _control_and_give_up_alignment)


@kernel
def _is_levelled(ekf):
    return ekf.cs.tilt_align


@kernel
def _is_not_distrusted(ekf):
    return not is_gnss_distrusted(ekf)


_may_continue = by_release(_is_levelled, "checks_gnss_on_arrival", _is_not_distrusted)


@kernel
def _have_checks_passed(ekf):
    return have_checks_passed(ekf)


@kernel
def _is_levelled_and_trusted(ekf):
    return ekf.cs.tilt_align and is_gnss_trusted(ekf)


_may_start = by_release(_have_checks_passed, "checks_gnss_on_arrival", _is_levelled_and_trusted)


@kernel
def _fuse_or_stop_gnss_yaw(ekf, params, sample, may_start):
    fuse_gnss_yaw(ekf, params, sample.yaw_offset)
    if is_timed_out(ekf, ekf.aid.gnss_yaw.time_last_fuse, RESET_TIMEOUT_MAX):
        stop_gnss_yaw_fusion(ekf)
        # before take-off there is time to align anew rather than trust the present heading
        if not ekf.cs.in_air:
            ekf.cs.yaw_align = False


@kernel
def _fuse_or_retry_gnss_yaw(ekf, params, sample, may_start):
    """Fuse; once it has failed for long the yaw is reset, in flight a single time, before the heading is given up."""
    fuse_gnss_yaw(ekf, params, sample.yaw_offset)
    retry_gnss_yaw(ekf, params, sample, may_start)


@kernel
def retry_gnss_yaw(ekf, params, sample, may_start):
    """Reset the yaw, or give the heading up, if it has failed for long."""
    retries = ekf.gnss_yaw_retries
    if not is_timed_out(ekf, ekf.aid.gnss_yaw.time_last_fuse, RESET_TIMEOUT_MAX):
        return
    if retries.resets_left > 0:
        _reset_and_forget_ratio(ekf, params, sample)
        if ekf.cs.in_air:
            retries.resets_left -= 1
    else:
        ekf.cs.gnss_yaw_fault = ekf.cs.gnss_yaw_fault or may_start
        stop_gnss_yaw_fusion(ekf)


_continue_gnss_yaw = by_release(_fuse_or_stop_gnss_yaw, "retries_gnss_yaw", _fuse_or_retry_gnss_yaw)


@kernel
def _reset_and_forget_ratio(ekf, params, sample):
    done = reset_yaw_to_gnss(ekf, params, sample.yaw, sample.yaw_offset)
    if done:
        ekf.aid.gnss_yaw.time_last_fuse = ekf.time_delayed_us
        ekf.gnss_yaw_retries.signed_test_ratio_lpf = 0.0
    return done


@kernel
def start_gnss_yaw_with_reset(ekf, params, sample):
    """Start the heading with a reset of the yaw, unless the baseline is too steep."""
    if _reset_and_forget_ratio(ekf, params, sample):
        _make_room_for_gnss_yaw(ekf, params)
        ekf.cs.gnss_yaw = True
        ekf.cs.yaw_align = True
        ekf.gnss_yaw_retries.resets_left = 1


@kernel
def _leave_mag(ekf, params):
    """v1.15's magnetometer gives way by itself."""


@kernel
def _stop_mag(ekf, params):
    ekf.cs.mag_dec = False
    stop_heading(ekf)
    stop_field(ekf)


_make_room_for_gnss_yaw = by_release(_leave_mag, "checks_gnss_on_arrival", _stop_mag)


@kernel
def _start_in_agreement(ekf, params, sample):
    if not ekf.cs.in_air or not ekf.cs.yaw_align or not is_north_east_aiding_active(ekf):
        if reset_yaw_to_gnss(ekf, params, sample.yaw, sample.yaw_offset):
            reset_aid_source_status_zero_innovation(ekf, ekf.aid.gnss_yaw, 1)
            ekf.cs.gnss_yaw = True
            ekf.cs.yaw_align = True
    elif not ekf.aid.gnss_yaw.innovation_rejected:
        # in flight with a known heading: wait until both agree
        ekf.cs.gnss_yaw = True
        fuse_gnss_yaw(ekf, params, sample.yaw_offset)


_start_gnss_yaw = by_release(_start_in_agreement, "retries_gnss_yaw", start_gnss_yaw_with_reset)


@kernel
def _told_variance(ekf, sample):
    accuracy = sample.yaw_acc if np.isfinite(sample.yaw_acc) else 0.0
    return max(accuracy, HEADING_NOISE) ** 2


@kernel
def _fixed_variance(ekf, sample):
    return HEADING_NOISE * HEADING_NOISE


_heading_variance = by_release(_told_variance, "aids_gnss_by_mask", _fixed_variance)
"""Variance (rad²) of a heading."""


@kernel
def update_gnss_yaw(ekf, params, sample):
    """Judge the heading of a sample; the observation is the yaw of the antenna baseline."""
    aid = ekf.aid.gnss_yaw
    measured = wrap_pi(sample.yaw + sample.yaw_offset)
    variance = _heading_variance(ekf, sample)
    H = ekf.scratch.H
    predicted = predict_gnss_yaw(ekf.R_to_earth, sample.yaw_offset, H)
    complete_attitude_jacobian(ekf, H, 0.0)
    set_axis(
        aid,
        0,
        measured,
        variance,
        wrap_pi(predicted - measured),
        _innovation_variance(ekf, H, variance),
    )
    update_aid_source_status(ekf, aid, 1, sample.time_us, max(params.EKF2_HDG_GATE, 1.0))


@kernel
def _was_not_just_fused(ekf):
    return is_timed_out(ekf, ekf.aid.gnss_yaw.time_last_fuse, GYRO_BIAS_RESET_INTERVAL)


@kernel
def _always(ekf):
    """v1.13 asks for no time in between."""
    return True


_may_reset_gyro_bias = by_release(_was_not_just_fused, "aids_gnss_by_mask", _always)


@kernel
def fuse_gnss_yaw(ekf, params, yaw_offset):
    """Fuse the heading that has been judged."""
    aid = ekf.aid.gnss_yaw
    if aid.innovation_rejected:
        ekf.reject.yaw = True
        return
    offset = yaw_offset if np.isfinite(yaw_offset) else 0.0
    H = ekf.scratch.H
    predict_gnss_yaw(ekf.R_to_earth, offset, H)
    complete_attitude_jacobian(ekf, H, 0.0)
    variance = aid.innovation_variance[0]
    if variance < aid.observation_variance[0]:
        # the state covariance is no longer positive: start it anew
        ekf.fs.bad_hdg = True
        initialise_covariance(ekf, params)
        if not _goes_on(ekf):
            stop_gnss_yaw_fusion(ekf)
        return
    ekf.reject.yaw = False

    if abs(_signed_test_ratio(ekf)) > WRONG_GYRO_BIAS_TEST_RATIO and not ekf.cs.in_air and _may_reset_gyro_bias(ekf):
        # innovations that stay on one side tell of a wrong yaw gyro bias: let it be learnt faster
        reset_gyro_bias_z_cov(ekf, params)

    multiply_covariance(ekf, H)
    _scale_gain(ekf, variance)
    aid.fused = measurement_update(ekf, params, aid.observation_variance[0], aid.innovation[0])
    ekf.fs.bad_hdg = not aid.fused
    if aid.fused:
        aid.time_last_fuse = ekf.time_delayed_us
        ekf.time_last_heading_fuse = ekf.time_delayed_us


@kernel
def _divide_by_variance(ekf, variance):
    for i in range(ERROR_STATE_SIZE):
        ekf.scratch.K[i] = ekf.scratch.PH[i] / variance


_scale_gain = by_release(_divide_by_variance, "adds_quaternion_errors", scale_kalman_gain)


@kernel
def _ratio_of_status(ekf):
    return ekf.aid.gnss_yaw.test_ratio_filtered[0]


@kernel
def _ratio_of_fused(ekf):
    """Low-passed over the headings that are fused."""
    aid, retries = ekf.aid.gnss_yaw, ekf.gnss_yaw_retries
    ratio = np.sign(aid.innovation[0]) * aid.test_ratio[0]
    retries.signed_test_ratio_lpf += SIGNED_TEST_RATIO_ALPHA * (ratio - retries.signed_test_ratio_lpf)
    return retries.signed_test_ratio_lpf


_signed_test_ratio = by_release(_ratio_of_status, "retries_gnss_yaw", _ratio_of_fused)


@kernel
def is_baseline_steep(ekf, yaw_offset):
    """Whether the antenna baseline is within 30° of the vertical."""
    _, _, v_d = rotate_to_earth(ekf.R_to_earth, math.cos(yaw_offset), math.sin(yaw_offset), 0.0)
    return abs(v_d) > STEEP_BASELINE


@kernel
def reset_yaw_to_gnss(ekf, params, yaw, yaw_offset):
    """Set the yaw to the receiver's heading, unless the antenna baseline is within 30° of the vertical."""
    if is_baseline_steep(ekf, yaw_offset):
        return False
    reset_quat_state_yaw(ekf, params, yaw, HEADING_NOISE * HEADING_NOISE)
    return True
