"""When v1.15 fuses the magnetometer: the field is reset a limited number of times, and whenever the yaw was.

What is observed is told only while it is fused, less the body field. `cs.mag`, `cs.mag_hdg`, `cs.mag_3d` and
`cs.mag_dec` mean what they mean in `mag_control.py`.

Mirrors PX4 v1.15 `EKF/mag_control.cpp` and `EKF/mag_3d_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.magnetometer.field_checks import check_mag_field
from fusetune.ekf2.filter.aid_sources.magnetometer.field_limits import reference_declination
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import (
    R_MAG_MIN,
    fuse_declination,
    fuse_mag,
    judge_mag,
    recover_from_bad_mag_covariance,
)
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import (
    check_mag_heading_consistency,
    update_yaw_observability,
)
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_resets import (
    check_hagl_yaw_reset_req,
    reset_mag_states,
    stop_mag_fusion,
)
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_AUTO, MAG_TYPE_HEADING, MAG_TYPE_NONE
from fusetune.ekf2.filter.common.state import MAG_BODY, MAG_EARTH
from fusetune.ekf2.filter.common.timing import (
    MAG_MAX_INTERVAL,
    RESET_TIMEOUT_MAX,
    is_newest_sample_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.field_covariance import reset_field_covariance
from fusetune.ekf2.filter.world_field import synthesise_z

MAG_LPF_ALPHA = 0.1
MIN_SAMPLES_TO_START = 5
MAG_VARIANCE_MIN = 1e-6
RESETS_AFTER_START = 2
DECLINATION_DEVIATION_AT_FIRST = 0.02
DECLINATION_DEVIATION = 0.5


@kernel
def control_mag_3d_fusion(ekf, params):
    """Process the magnetometer sample that reached the fusion time horizon, if any."""
    if ekf.cs.in_air and not ekf.cs_prev.in_air:
        ekf.cs.mag_aligned_in_flight = False
    update_yaw_observability(ekf, params)

    if int(params.EKF2_MAG_TYPE) == MAG_TYPE_NONE:
        stop_mag_fusion(ekf, params)
        return

    if ekf.field_history.declination_fused and not _is_yaw_as_it_was(ekf):
        stop_mag_fusion(ekf, params)
        reset_field_covariance(ekf, params)

    if ekf.sensors.mag.data_ready:
        _filter_sample(ekf, params)
        _control_with_sample(ekf, params)
    elif not is_newest_sample_recent(ekf, ekf.sensors.mag.newest_time_us, 2 * MAG_MAX_INTERVAL):
        stop_mag_fusion(ekf, params)


@kernel
def _is_yaw_as_it_was(ekf):
    return ekf.state_reset.quat_counter == ekf.state_reset_prev.quat_counter


@kernel
def _filter_sample(ekf, params):
    """Low-pass the field; the first sample, and one after a change of sensor or calibration, start anew."""
    sample, mag = ekf.sensors.mag.sample.mag, ekf.mag
    if ekf.sensors.mag.sample.reset or mag.counter == 0:
        ekf.cs.mag_fault = False
        ekf.mag_B[:] = 0.0
        reset_field_covariance(ekf, params)
        for axis in range(3):
            mag.lpf[axis] = sample[axis]
        mag.counter = 1
        return
    for axis in range(3):
        mag.lpf[axis] += MAG_LPF_ALPHA * (sample[axis] - mag.lpf[axis])
    mag.counter += 1


@kernel
def _control_with_sample(ekf, params):
    """Judge the sample, choose the mode, then fuse, reset, start or stop."""
    sample, aid = ekf.sensors.mag.sample.mag, ekf.aid.mag
    if not is_fusion_due(ekf.sensors.mag):
        _judge_withheld(ekf, params, sample)
        return
    starting = check_mag_field(ekf, params, sample) and _may_start(ekf)
    synthesise_z(ekf, params, sample)
    check_mag_heading_consistency(ekf, params, sample)

    forget_aid_source_status(ekf, aid, 3)
    # the model may have been looked up after the last fusion, in the same update
    wmm_updated = ekf.field_history.wmm_time_last_set >= aid.time_last_fuse
    continuing = _continuing_conditions_passing(ekf, sample)
    _choose_mode(ekf, params)

    if not ekf.cs.mag:
        if starting and continuing:
            _start(ekf, params, sample, wmm_updated)
        return
    aid.timestamp_sample = ekf.sensors.mag.sample.time_us
    if not (continuing and ekf.cs.yaw_align):
        stop_mag_fusion(ekf, params)
        return

    if ekf.sensors.mag.sample.reset or check_hagl_yaw_reset_req(ekf) or wmm_updated:
        _reset_to_filtered(ekf, params)
    else:
        _fuse_sample(ekf, params, sample)
    if is_timed_out(ekf, aid.time_last_fuse, RESET_TIMEOUT_MAX):
        _reset_or_stop(ekf, params)


@kernel
def _judge_withheld(ekf, params, sample):
    """What the filter would have found of a sample that an experiment keeps from it."""
    synthesise_z(ekf, params, sample)
    if ekf.cs.mag:
        ekf.aid.mag.timestamp_sample = ekf.sensors.mag.sample.time_us
        judge_mag(ekf, params, sample, _mag_variance(params))


@kernel
def _may_start(ekf):
    """Enough samples filtered, none missing now, and neither yaw alignment nor yaw changed in this update."""
    return (
        ekf.mag.counter > MIN_SAMPLES_TO_START
        and ekf.cs.yaw_align == ekf.cs_prev.yaw_align
        and _is_yaw_as_it_was(ekf)
        and is_newest_sample_recent(ekf, ekf.sensors.mag.newest_time_us, MAG_MAX_INTERVAL)
    )


@kernel
def _continuing_conditions_passing(ekf, sample):
    """Levelled, not waiting for external vision to align yaw, and a field that is a field."""
    squared = sample[0] * sample[0] + sample[1] * sample[1] + sample[2] * sample[2]
    return ekf.cs.tilt_align and (ekf.cs.yaw_align or not ekf.cs.ev_yaw) and math.isfinite(squared) and squared > 0.0


@kernel
def _choose_mode(ekf, params):
    """Set which states the magnetometer may correct. A disturbed field keeps only the heading from being fused."""
    cs = ekf.cs
    mag_type = int(params.EKF2_MAG_TYPE)
    trusted = cs.mag_heading_consistent or not is_north_east_aiding_active(ekf)
    usable = not cs.mag_fault and not cs.ev_yaw and not cs.gnss_yaw
    cs.mag_3d = usable and trusted and mag_type == MAG_TYPE_AUTO and cs.mag and cs.mag_aligned_in_flight
    cs.mag_hdg = (
        usable
        and (mag_type == MAG_TYPE_HEADING or (mag_type == MAG_TYPE_AUTO and not cs.mag_3d))
        and cs.tilt_align
        and (trusted or not cs.yaw_align)
        and not cs.mag_field_disturbed
    )
    cs.mag_dec = cs.mag and (not is_north_east_aiding_active(ekf) or not cs.mag_aligned_in_flight)


@kernel
def _reset_to_filtered(ekf, params):
    """Reset the field states, and the yaw where it is fused, to the filtered measurement."""
    reset_mag_states(ekf, params, ekf.mag.lpf, ekf.cs.mag_hdg or ekf.cs.mag_3d)
    ekf.aid.mag.time_last_fuse = ekf.time_delayed_us


@kernel
def _reset_or_stop(ekf, params):
    """A fusion that fails for 7 s: reset while that may help, which in flight it may twice."""
    if ekf.field_history.resets_available > 0:
        _reset_to_filtered(ekf, params)
        if ekf.cs.in_air:
            ekf.field_history.resets_available -= 1
    else:
        stop_mag_fusion(ekf, params)


@kernel
def _fuse_sample(ekf, params, sample):
    """Fuse the field; the declination before it where its covariance is new, after it where nothing fixes north."""
    if not ekf.field_history.declination_fused:
        _fuse_known_declination(ekf, params, DECLINATION_DEVIATION_AT_FIRST)
        ekf.field_history.declination_fused = True
        _judge_and_fuse(ekf, params, sample, False, True)
        return
    _judge_and_fuse(ekf, params, sample, ekf.cs.mag_3d or ekf.cs.mag_hdg, ekf.cs.mag_3d)
    if ekf.cs.mag_dec:
        _fuse_known_declination(ekf, params, DECLINATION_DEVIATION)


@kernel
def _fuse_known_declination(ekf, params, deviation):
    """Fuse the reference's declination with this standard deviation (rad), if there is one."""
    declination = reference_declination(ekf, params)
    if ekf.cs.mag and math.isfinite(declination):
        fuse_declination(ekf, params, declination, deviation * deviation, True)


@kernel
def _mag_variance(params):
    """Variance (Gauss²) of an axis."""
    return max(params.EKF2_MAG_NOISE * params.EKF2_MAG_NOISE, R_MAG_MIN)


@kernel
def _judge_and_fuse(ekf, params, sample, update_all_states, update_tilt):
    """A sample that starts the fusion has no time, and is not told."""
    R_mag = _mag_variance(params)
    if judge_mag(ekf, params, sample, R_mag):
        fuse_mag(ekf, params, sample, R_mag, update_all_states, update_tilt)
    else:
        recover_from_bad_mag_covariance(ekf, params, update_all_states)


@kernel
def _start(ekf, params, sample, wmm_updated):
    """Begin fusion: with a reset where field states, their covariance or yaw are not known."""
    field = ekf.mag_I
    smallest_variance = ekf.P[MAG_EARTH, MAG_EARTH]
    for i in range(MAG_EARTH, MAG_BODY + 3):
        smallest_variance = min(smallest_variance, ekf.P[i, i])
    field_unknown = field[0] == 0.0 and field[1] == 0.0 and field[2] == 0.0
    covariance_unknown = not ekf.field_history.declination_fused or smallest_variance < MAG_VARIANCE_MIN
    ekf.cs.mag = True
    if not ekf.cs.yaw_align or wmm_updated or field_unknown or covariance_unknown:
        reset_mag_states(ekf, params, ekf.mag.lpf, not ekf.cs.yaw_align)
        ekf.cs.yaw_align = True
    else:
        _judge_and_fuse(ekf, params, sample, False, True)
    ekf.aid.mag.time_last_fuse = ekf.time_delayed_us
    ekf.field_history.resets_available = RESETS_AFTER_START
