"""GNSS height: observation, bias against the height reference, and its fusion.

Mirrors PX4 v1.16 `EKF/aid_sources/gnss/gnss_height_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.gnss.antenna_offset import antenna_offset_body
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import is_gnss_distrusted, is_gnss_trusted
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_VEL, GPS_CTRL_VPOS
from fusetune.ekf2.filter.aid_sources.gnss.gnss_resets import GPS_MODE_DEAD_RECKONING
from fusetune.ekf2.filter.bias_estimator.bias_estimator import reset_bias, set_bias
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import (
    predict_height_bias,
    start_height_source,
    stop_height_source,
    update_height_bias,
)
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    reset_aid_source_status_zero_innovation,
)
from fusetune.ekf2.filter.common.conditions import (
    is_height_reset_required,
    is_only_active_source_of_vertical_position_aiding,
    is_other_source_of_vertical_position_aiding_than,
)
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_GNSS
from fusetune.ekf2.filter.common.local_origin import origin_altitude
from fusetune.ekf2.filter.common.timing import (
    GNSS_MAX_INTERVAL,
    HGT_FUSION_TIMEOUT_MAX,
    is_newest_sample_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.origin_resets import initialise_altitude_to
from fusetune.ekf2.filter.resets.state_resets import (
    reset_altitude_to,
    reset_vertical_velocity_to,
    reset_vertical_velocity_to_zero,
)
from fusetune.ekf2.numerics.rotations import component_in_earth
from fusetune.ekf2.releases.by_release import by_release

TYPICAL_VACC_PER_HACC = 1.5


@kernel
def control_gnss_height_fusion(ekf, params):
    """Run GNSS height for one update, with the sample in `ekf.sensors.gnss.sample` if `ekf.sensors.gnss.data_ready`."""
    predict_height_bias(ekf, ekf.gps_hgt_b_est, HEIGHT_REF_GNSS, ekf.dt_ekf_avg)
    if ekf.sensors.gnss.data_ready:
        _use_gnss_height(ekf, params, ekf.sensors.gnss.sample)
    elif ekf.cs.gps_hgt and not is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL):
        stop_gps_hgt_fusion(ekf)


@kernel
def _use_gnss_height(ekf, params, sample):
    aid = ekf.aid.gnss_hgt
    bias_est = ekf.gps_hgt_b_est
    noise = max(sample.vacc, TYPICAL_VACC_PER_HACC * params.EKF2_GPS_P_NOISE)
    if not is_only_active_source_of_vertical_position_aiding(ekf, ekf.cs.gps_hgt):
        noise = min(noise, params.EKF2_NOAID_NOISE)
    x, y, z = antenna_offset_body(params)
    measurement = sample.alt + component_in_earth(ekf.R_to_earth, 2, x, y, z) - sea_level_to_zero_height(ekf)
    variance = noise * noise
    valid = math.isfinite(measurement) and math.isfinite(variance)

    update_vertical_position_aid_status(
        ekf,
        aid,
        sample.time_us,
        -(measurement - bias_est.bias),
        variance + bias_est.bias_var,
        max(params.EKF2_GPS_P_GATE, 1.0),
    )
    if is_fusion_due(ekf.sensors.gnss):
        _control_with_height(ekf, params, measurement, variance, valid)


@kernel
def _control_with_latched_checks(ekf, params, measurement, variance, valid):
    """Start, continue or stop the height that has been judged, once the checks have passed at some time."""
    if valid:
        update_height_bias(ekf, ekf.gps_hgt_b_est, HEIGHT_REF_GNSS, measurement - ekf.gpos_alt, variance)

    usable = valid and ekf.origin.lat_lon_valid and ekf.gnss.checks_passed
    continuing = usable and int(params.EKF2_GPS_CTRL) & GPS_CTRL_VPOS != 0
    if not ekf.cs.gps_hgt:
        recent = is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL)
        _start_gnss_height(ekf, params, measurement, variance, continuing and recent, usable and recent)
    elif continuing:
        _continue_gnss_height(ekf, params, measurement, variance)
    else:
        stop_gps_hgt_fusion(ekf)


@kernel
def _continue_gnss_height(ekf, params, measurement, variance):
    aid = ekf.aid.gnss_hgt
    fuse_vertical_position(ekf, params, aid)
    fusion_failing = is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX)
    if is_height_reset_required(ekf) and ekf.height_sensor_ref == HEIGHT_REF_GNSS:
        # all height sources are failing
        ekf.events.reset_hgt_to_gps = True
        reset_altitude_to(ekf, params, measurement, variance)
        set_bias(ekf.gps_hgt_b_est, measurement - ekf.gpos_alt)
        reset_aid_source_status_zero_innovation(ekf, aid, 1)
    elif fusion_failing:
        # another height source still works
        stop_gps_hgt_fusion(ekf)


@kernel
def _start_gnss_height(ekf, params, measurement, variance, may_start, may_initialise):
    """Start fusing GNSS height, or at least let it set the altitude of the origin if it is to be the reference."""
    aid = ekf.aid.gnss_hgt
    bias_est = ekf.gps_hgt_b_est
    is_reference = int(params.EKF2_HGT_REF) == HEIGHT_REF_GNSS
    initialise_origin = may_initialise and is_reference and not math.isfinite(ekf.origin.alt)
    if may_start:
        if is_reference:
            ekf.height_sensor_ref = HEIGHT_REF_GNSS
            ekf.events.reset_hgt_to_gps = True
            initialise_altitude_to(ekf, params, measurement, variance)
            reset_bias(bias_est)
            reset_aid_source_status_zero_innovation(ekf, aid, 1)
        else:
            set_bias(bias_est, measurement - ekf.gpos_alt)
        start_height_source(ekf, bias_est, aid)
        ekf.cs.gps_hgt = True
    if initialise_origin:
        ekf.events.reset_hgt_to_gps = True
        initialise_altitude_to(ekf, params, measurement, variance)
        reset_bias(bias_est)


@kernel
def _control_faulty_height(ekf, params, measurement, variance, valid):
    """As v1.16's, but a height that fails beside a source that works can be declared faulty.

    The bias is learnt while the height is fused, and the altitude of the origin is set before that begins.
    """
    usable = valid and ekf.origin.lat_lon_valid and ekf.gnss_trust.passed and not ekf.gnss_trust.fault
    continuing = usable and int(params.EKF2_GPS_CTRL) & GPS_CTRL_VPOS != 0
    if ekf.cs.gps_hgt:
        if not continuing:
            stop_gps_hgt_fusion(ekf)
            return
        update_height_bias(ekf, ekf.gps_hgt_b_est, HEIGHT_REF_GNSS, measurement - ekf.gpos_alt, variance)
        _continue_or_fault_height(ekf, params, measurement, variance)
    elif is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL):
        is_reference = int(params.EKF2_HGT_REF) == HEIGHT_REF_GNSS
        if usable and is_reference and not math.isfinite(ekf.origin.alt):
            _initialise_altitude(ekf, params, measurement, variance, continuing)
        elif continuing:
            _start_sound_height(ekf, params, measurement, variance, is_reference)


@kernel
def _continue_or_fault_height(ekf, params, measurement, variance):
    aid = ekf.aid.gnss_hgt
    fuse_vertical_position(ekf, params, aid)
    reset_allowed = _is_height_reset_allowed(ekf, params)
    if is_height_reset_required(ekf) and ekf.height_sensor_ref == HEIGHT_REF_GNSS and reset_allowed:
        ekf.events.reset_hgt_to_gps = True
        reset_altitude_to(ekf, params, measurement, variance)
        set_bias(ekf.gps_hgt_b_est, measurement - ekf.gpos_alt)
        reset_aid_source_status_zero_innovation(ekf, aid, 1)
    elif is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX):
        stop_gps_hgt_fusion(ekf)
        if not _is_height_reset_allowed(ekf, params):
            ekf.gnss_trust.height_fault = True
            ekf.gnss_trust.height_rejected_us = ekf.time_delayed_us


@kernel
def _initialise_altitude(ekf, params, measurement, variance, starting):
    """Give the origin its altitude, whether or not the height is to be fused."""
    ekf.events.reset_hgt_to_gps = True
    initialise_altitude_to(ekf, params, measurement, variance)
    reset_bias(ekf.gps_hgt_b_est)
    if starting:
        ekf.height_sensor_ref = HEIGHT_REF_GNSS
        reset_aid_source_status_zero_innovation(ekf, ekf.aid.gnss_hgt, 1)
        _set_height_active(ekf)


@kernel
def _start_sound_height(ekf, params, measurement, variance, is_reference):
    """Start as the reference, with a reset, or beside it; a height that was faulty must have agreed for 5 s."""
    aid, trust = ekf.aid.gnss_hgt, ekf.gnss_trust
    if is_reference and _is_height_reset_allowed(ekf, params):
        ekf.height_sensor_ref = HEIGHT_REF_GNSS
        ekf.events.reset_hgt_to_gps = True
        reset_altitude_to(ekf, params, measurement, variance)
        reset_bias(ekf.gps_hgt_b_est)
        reset_aid_source_status_zero_innovation(ekf, aid, 1)
    else:
        if trust.height_fault:
            if aid.innovation_rejected:
                trust.height_rejected_us = ekf.time_delayed_us
            if not is_timed_out(ekf, trust.height_rejected_us, HGT_FUSION_TIMEOUT_MAX):
                return
        if not is_reference:
            set_bias(ekf.gps_hgt_b_est, measurement - ekf.gpos_alt)
    _set_height_active(ekf)
    trust.height_fault = False


@kernel
def _set_height_active(ekf):
    start_height_source(ekf, ekf.gps_hgt_b_est, ekf.aid.gnss_hgt)
    ekf.cs.gps_hgt = True


@kernel
def _is_height_reset_allowed(ekf, params):
    """Whether the height may be reset to GNSS: EKF2_GPS_MODE can have it yield to another source."""
    yields = int(params.EKF2_GPS_MODE) == GPS_MODE_DEAD_RECKONING and is_other_source_of_vertical_position_aiding_than(
        ekf, ekf.cs.gps_hgt
    )
    return not yields or not math.isfinite(ekf.origin.alt)


@kernel
def _control_with_every_reset(ekf, params, measurement, variance, valid):
    """As v1.16's, but the height is reset to GNSS whatever its reference is, and the vertical velocity along with it.

    `measurement` is above the origin.
    """
    trusted = _is_trusted(ekf)
    if valid and trusted:
        update_height_bias(ekf, ekf.gps_hgt_b_est, HEIGHT_REF_GNSS, measurement - ekf.gpos_alt, variance)
    continuing = (
        valid and ekf.origin.valid and ekf.gnss.checks_passed and int(params.EKF2_GPS_CTRL) & GPS_CTRL_VPOS != 0
    )
    if ekf.cs.gps_hgt and continuing:
        _fuse_or_reset_to_height(ekf, params, measurement, variance)
    elif ekf.cs.gps_hgt:
        stop_gps_hgt_fusion(ekf)
    elif (
        continuing and trusted and is_newest_sample_recent(ekf, ekf.sensors.gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL)
    ):
        start_gnss_height_once_placed(ekf, params, measurement, variance)


@kernel
def _always(ekf):
    """v1.15 uses no sample that is not to be trusted."""
    return True


@kernel
def _by_checks_of_5_s(ekf):
    return is_gnss_trusted(ekf) and not is_gnss_distrusted(ekf)


_is_trusted = by_release(_always, "checks_gnss_on_arrival", _by_checks_of_5_s)
"""Whether the height may start, and its bias be learnt."""


@kernel
def _fuse_or_reset_to_height(ekf, params, measurement, variance):
    aid, bias_est = ekf.aid.gnss_hgt, ekf.gps_hgt_b_est
    fuse_vertical_position(ekf, params, aid)
    failing = is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX)
    if is_height_reset_required(ekf):
        ekf.events.reset_hgt_to_gps = True
        reset_altitude_to(ekf, params, measurement - bias_est.bias, variance)
        set_bias(bias_est, measurement - ekf.gpos_alt)
        reset_vertical_velocity_to_gnss(ekf, params, ekf.sensors.gnss.sample)
        aid.time_last_fuse = ekf.time_delayed_us
    elif failing:
        stop_gps_hgt_fusion(ekf)


@kernel
def reset_vertical_velocity_to_gnss(ekf, params, sample):
    """Set the vertical velocity to that of a sample, or to zero where it is not to be used."""
    if math.isfinite(sample.vel[2]) and int(params.EKF2_GPS_CTRL) & GPS_CTRL_VEL != 0:
        deviation = max(TYPICAL_VACC_PER_HACC * sample.sacc, params.EKF2_GPS_V_NOISE)
        reset_vertical_velocity_to(ekf, params, sample.vel[2], deviation * deviation)
    else:
        reset_vertical_velocity_to_zero(ekf, params)


@kernel
def start_gnss_height_once_placed(ekf, params, measurement, variance):
    """Start as the reference, by a reset, or beside it, with a bias that makes both agree."""
    if int(params.EKF2_HGT_REF) == HEIGHT_REF_GNSS:
        ekf.height_sensor_ref = HEIGHT_REF_GNSS
        ekf.events.reset_hgt_to_gps = True
        reset_altitude_to(ekf, params, measurement, variance)
        reset_bias(ekf.gps_hgt_b_est)
    else:
        set_bias(ekf.gps_hgt_b_est, measurement - ekf.gpos_alt)
    _set_height_active(ekf)


_control_with_height = by_release(
    by_release(_control_with_latched_checks, "faults_gnss_height", _control_faulty_height),
    "resets_height_to_each_source",
    _control_with_every_reset,
)


@kernel
def _nothing(ekf):
    return 0.0


sea_level_to_zero_height = by_release(_nothing, "keeps_position_local", origin_altitude)
"""Altitude above sea level (m) of what `ekf.gpos_alt` counts from."""


@kernel
def stop_gps_hgt_fusion(ekf):
    """Stop fusing GNSS height."""
    if ekf.cs.gps_hgt:
        stop_height_source(ekf, ekf.gps_hgt_b_est, HEIGHT_REF_GNSS)
        ekf.cs.gps_hgt = False
        forget_aid_source_status(ekf, ekf.aid.gnss_hgt, 1)
