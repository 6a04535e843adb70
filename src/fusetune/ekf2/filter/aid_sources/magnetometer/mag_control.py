"""When the magnetometer is fused, into which states, and when its states are reset.

`cs.mag`: the field states are estimated. `cs.mag_hdg`: yaw too (EKF2_MAG_TYPE heading, or automatic until the field
was aligned in flight). `cs.mag_3d`: every state. `cs.mag_dec`: declination too, as nothing else fixes north.

Mirrors PX4 v1.16 `EKF/aid_sources/magnetometer/mag_control.cpp`, of which `field_checks.py`, `mag_heading.py`,
`mag_resets.py` and `world_field.py` hold the parts. How v1.15 does stands in `mag_3d_control.py`, v1.14 in
`mag_mode_control.py`, v1.13 in `mag_inhibition_control.py`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.magnetometer.field_checks import check_mag_field
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_3d_control import control_mag_3d_fusion
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import (
    R_MAG_MIN,
    compute_mag_h,
    fuse_declination,
    fuse_mag,
    predict_mag,
)
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import check_mag_heading_consistency
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_inhibition_control import control_mag_with_inhibition
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_mode_control import control_mag_modes
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_resets import (
    check_hagl_yaw_reset_req,
    reset_mag_states,
    stop_mag_fusion,
)
from fusetune.ekf2.filter.common.aid_source_status import (
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_AUTO, MAG_TYPE_HEADING, MAG_TYPE_INIT, MAG_TYPE_NONE
from fusetune.ekf2.filter.common.state import MAG_BODY, MAG_EARTH
from fusetune.ekf2.filter.common.timing import (
    MAG_MAX_INTERVAL,
    RESET_TIMEOUT_MAX,
    horizon_us,
    is_newest_sample_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.covariance import reset_mag_bias_cov
from fusetune.ekf2.filter.observation_gain import compute_innovation_variance
from fusetune.ekf2.filter.source_stops.heading_and_field import clear_mag_faults
from fusetune.ekf2.filter.world_field import (
    check_world_magnetic_model,
    has_saved_declination,
    has_wmm_declination,
    synthesise_z,
)
from fusetune.ekf2.releases.by_release import by_release

MAG_LPF_ALPHA = 0.1
MIN_SAMPLES_TO_START = 3
MAG_VARIANCE_MIN = 1e-6
DECLINATION_VARIANCE_WMM = 0.5
DECLINATION_VARIANCE = 0.5**2


@kernel
def _control_mag_fusion(ekf, params):
    """Process the magnetometer sample that reached the fusion time horizon, if any."""
    if ekf.cs.in_air and not ekf.cs_prev.in_air:
        ekf.cs.mag_aligned_in_flight = False

    if int(params.EKF2_MAG_TYPE) == MAG_TYPE_NONE:
        stop_mag_fusion(ekf, params)
        return

    if ekf.sensors.mag.data_ready:
        _filter_sample(ekf, params)
        wmm_updated = check_world_magnetic_model(ekf)
        _control_with_sample(ekf, params, wmm_updated)
    elif not is_newest_sample_recent(ekf, ekf.sensors.mag.newest_time_us, 2 * MAG_MAX_INTERVAL):
        stop_mag_fusion(ekf, params)


@kernel
def _filter_sample(ekf, params):
    """Low-pass the field; start anew at the first sample and when sensor or calibration changed."""
    sample, mag = ekf.sensors.mag.sample.mag, ekf.mag
    if not ekf.sensors.mag.sample.reset and mag.counter > 0:
        for axis in range(3):
            mag.lpf[axis] += MAG_LPF_ALPHA * (sample[axis] - mag.lpf[axis])
        mag.counter += 1
        return

    ekf.cs.mag_fault = False
    ekf.mag_B[:] = 0.0
    reset_mag_bias_cov(ekf, params)
    stop_mag_fusion(ekf, params)
    for axis in range(3):
        mag.lpf[axis] = sample[axis]
    mag.counter = 1
    if not ekf.cs.in_air:
        ekf.cs.yaw_align = False


@kernel
def _control_with_sample(ekf, params, wmm_updated):
    """Judge the sample, choose the mode, then fuse, reset, start or stop."""
    sample, aid = ekf.sensors.mag.sample.mag, ekf.aid.mag
    synthesise_z(ekf, params, sample)
    clear_mag_faults(ekf)

    R_mag = max(params.EKF2_MAG_NOISE * params.EKF2_MAG_NOISE, R_MAG_MIN)
    _update_mag_status(ekf, params, sample, R_mag)
    if not is_fusion_due(ekf.sensors.mag):
        return

    continuing = _continuing_conditions_passing(ekf, params, sample)
    # the field checks need a levelled attitude, and their timer starts with the first sample that has one
    starting = continuing and check_mag_field(ekf, params, sample) and _may_start(ekf)
    check_mag_heading_consistency(ekf, params, sample)

    _forgive_mag_fault(ekf)
    no_ne_aiding_or_not_moving = not is_north_east_aiding_active(ekf) or ekf.cs.vehicle_at_rest
    _choose_mode(ekf, params, no_ne_aiding_or_not_moving)

    if not ekf.cs.mag:
        if starting:
            _start(ekf, params, sample, R_mag, wmm_updated)
        return
    if not (continuing and ekf.cs.yaw_align):
        stop_mag_fusion(ekf, params)
        return

    if check_hagl_yaw_reset_req(ekf):
        _reset_on_climb(ekf, params)
    elif wmm_updated and no_ne_aiding_or_not_moving:
        _reset_to_filtered(ekf, params, ekf.cs.mag_hdg or ekf.cs.mag_3d)
    else:
        _fuse_sample(ekf, params, sample, R_mag)

    if is_timed_out(ekf, aid.time_last_fuse, RESET_TIMEOUT_MAX):
        if no_ne_aiding_or_not_moving:
            _reset_to_filtered(ekf, params, ekf.cs.mag_hdg or ekf.cs.mag_3d)
        else:
            stop_mag_fusion(ekf, params)


@kernel
def _update_mag_status(ekf, params, sample, R_mag):
    """Innovations and variances of all axes before any is fused, and their verdict."""
    H = ekf.scratch.H
    for axis in range(3):
        compute_mag_h(ekf, axis, H)
        variance = compute_innovation_variance(ekf, H, R_mag)
        set_axis(ekf.aid.mag, axis, sample[axis], R_mag, predict_mag(ekf, axis) - sample[axis], variance)
    update_aid_source_status(ekf, ekf.aid.mag, 3, ekf.sensors.mag.sample.time_us, max(params.EKF2_MAG_GATE, 1.0))


@kernel
def _continuing_conditions_passing(ekf, params, sample):
    """Enabled, levelled, not waiting for external vision to align yaw, and a field that is a field."""
    enabled = int(params.EKF2_MAG_TYPE) in (MAG_TYPE_AUTO, MAG_TYPE_HEADING, MAG_TYPE_INIT)
    squared = sample[0] * sample[0] + sample[1] * sample[1] + sample[2] * sample[2]
    return (
        enabled
        and ekf.cs.tilt_align
        and (ekf.cs.yaw_align or not ekf.cs.ev_yaw)
        and math.isfinite(squared)
        and squared > 0.0
    )


@kernel
def _may_start(ekf):
    """Enough samples filtered, none missing now, and neither yaw alignment nor yaw changed in this update."""
    return (
        ekf.mag.counter > MIN_SAMPLES_TO_START
        and ekf.cs.yaw_align == ekf.cs_prev.yaw_align
        and ekf.state_reset.quat_counter == ekf.state_reset_prev.quat_counter
        and is_newest_sample_recent(ekf, ekf.sensors.mag.newest_time_us, MAG_MAX_INTERVAL)
    )


@kernel
def _forgive_nothing(ekf):
    """v1.17 keeps a magnetometer at fault out for good."""


@kernel
def _forgive_consistent_mag(ekf):
    cs = ekf.cs
    if cs.mag_heading_consistent and cs.mag and is_timed_out(ekf, ekf.time_last_heading_fuse, RESET_TIMEOUT_MAX):
        cs.mag_fault = False


@kernel
def _is_never_kept(ekf):
    return False


@kernel
def _is_position_constant(ekf):
    return ekf.cs.constant_pos


_forgive_mag_fault = by_release(_forgive_nothing, "trusts_mag_again", _forgive_consistent_mag)
_is_heading_kept = by_release(_is_never_kept, "trusts_mag_again", _is_position_constant)


@kernel
def _choose_mode(ekf, params, no_ne_aiding_or_not_moving):
    """Set which states the magnetometer may correct."""
    cs = ekf.cs
    consistent = cs.mag_heading_consistent or not is_north_east_aiding_active(ekf)
    heading_usable = (cs.yaw_align and consistent) or (not cs.ev_yaw and not cs.yaw_align)
    usable = (
        cs.mag
        and heading_usable
        and not cs.mag_fault
        and not _is_heading_kept(ekf)
        and not cs.mag_field_disturbed
        and not cs.ev_yaw
        and not cs.gnss_yaw
    )
    mag_type = int(params.EKF2_MAG_TYPE)
    cs.mag_3d = usable and mag_type == MAG_TYPE_AUTO and cs.mag_aligned_in_flight
    cs.mag_hdg = usable and (mag_type == MAG_TYPE_HEADING or (mag_type == MAG_TYPE_AUTO and not cs.mag_3d))
    cs.mag_dec = cs.mag and no_ne_aiding_or_not_moving


@kernel
def _reset_to_filtered(ekf, params, reset_heading):
    """Reset the field states, and yaw if asked, to the filtered measurement."""
    reset_mag_states(ekf, params, ekf.mag.lpf, reset_heading)
    ekf.aid.mag.time_last_fuse = ekf.time_delayed_us


@kernel
def _reset_with_heading(ekf, params):
    _reset_to_filtered(ekf, params, ekf.cs.mag_hdg or ekf.cs.mag_3d)


@kernel
def _reset_with_unaided_heading(ekf, params):
    """North-east aiding knows the heading better; the field is aligned either way."""
    _reset_to_filtered(ekf, params, (ekf.cs.mag_hdg or ekf.cs.mag_3d) and not is_north_east_aiding_active(ekf))
    ekf.cs.mag_aligned_in_flight = True
    ekf.mag.flt_mag_align_start_time = horizon_us(ekf)


_reset_on_climb = by_release(_reset_with_heading, "aligns_field_on_climb", _reset_with_unaided_heading)


@kernel
def _fuse_sample(ekf, params, sample, R_mag):
    """Fuse the three axes and, where nothing else fixes north, the declination."""
    aid = ekf.aid.mag
    update_all_states = ekf.cs.mag_3d or ekf.cs.mag_hdg
    fuse_mag(ekf, params, sample, R_mag, update_all_states, ekf.cs.mag_3d)
    if ekf.cs.mag_3d:
        ekf.fs.bad_mag_x = aid.innovation_variance[0] < aid.observation_variance[0]
        ekf.fs.bad_mag_y = aid.innovation_variance[1] < aid.observation_variance[1]
        ekf.fs.bad_mag_z = aid.innovation_variance[2] < aid.observation_variance[2]

    if ekf.cs.mag_dec:
        if has_wmm_declination(ekf, params):
            fuse_declination(ekf, params, ekf.mag.wmm_declination, DECLINATION_VARIANCE_WMM, update_all_states)
        elif has_saved_declination(params):
            saved = math.radians(params.EKF2_MAG_DECL)
            fuse_declination(ekf, params, saved, DECLINATION_VARIANCE, update_all_states)
        else:
            # an unknown declination is better held at zero than left to drift
            fuse_declination(ekf, params, 0.0, DECLINATION_VARIANCE, False)


@kernel
def _start(ekf, params, sample, R_mag, wmm_updated):
    """Begin fusion: with a reset if the field states (or yaw) are not known, else with a fusion that must succeed."""
    field = ekf.mag_I
    smallest_variance = ekf.P[MAG_EARTH, MAG_EARTH]
    for i in range(MAG_EARTH, MAG_BODY + 3):
        smallest_variance = min(smallest_variance, ekf.P[i, i])
    field_unknown = field[0] == 0.0 and field[1] == 0.0 and field[2] == 0.0
    if not ekf.cs.yaw_align or wmm_updated or field_unknown or smallest_variance < MAG_VARIANCE_MIN:
        reset_heading = not ekf.cs.yaw_align
        _reset_to_filtered(ekf, params, reset_heading)
        if reset_heading:
            ekf.cs.yaw_align = True
            reset_aid_source_status_zero_innovation(ekf, ekf.aid.mag, 3)
        ekf.cs.mag = True
    elif fuse_mag(ekf, params, sample, R_mag, False, False):
        ekf.cs.mag = True


control_mag_fusion = by_release(
    by_release(
        by_release(_control_mag_fusion, "counts_field_resets", control_mag_3d_fusion),
        "fuses_heading_or_field",
        control_mag_modes,
    ),
    "clears_field_whenever_stopped",
    control_mag_with_inhibition,
)
"""Process the magnetometer sample that reached the fusion time horizon, if any."""
