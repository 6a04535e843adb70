"""GNSS height: observation, bias against the height reference, and its fusion."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.antenna_offset import antenna_offset_body, rotate_to_earth
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_VPOS
from fusetune.ekf2.filter.bias_estimator.bias_estimator import (
    reset_bias,
    set_bias,
    set_max_state_noise,
    set_process_noise_spectral_density,
)
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import fuse_height_bias, predict_height_bias
from fusetune.ekf2.filter.common.aid_source_status import reset_aid_source_status_zero_innovation
from fusetune.ekf2.filter.common.conditions import (
    is_height_reset_required,
    is_only_active_source_of_vertical_position_aiding,
)
from fusetune.ekf2.filter.common.core_memory import HEIGHT_REF_GNSS, HEIGHT_REF_UNKNOWN
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import (
    GNSS_MAX_INTERVAL,
    HGT_FUSION_TIMEOUT_MAX,
    is_newer_than_latest,
    is_timed_out,
)
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.origin_resets import initialise_altitude_to
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to
from fusetune.ekf2.replay.withholding import pretend_height_fused

TYPICAL_VACC_PER_HACC = 1.5
HEIGHT_BIAS_NOISE_DENSITY = 0.13
"""Random walk of the height bias (m/√Hz/s)."""


@kernel
def control_gnss_height_fusion(ekf, params):
    """Run GNSS height for one update, with the sample in `ekf.gnss_sample` if `ekf.gnss_data_ready`."""
    predict_height_bias(ekf, ekf.gps_hgt_b_est, HEIGHT_REF_GNSS, ekf.dt_ekf_avg)
    if ekf.gnss_data_ready:
        _use_gnss_height(ekf, params, ekf.gnss_sample)
    elif ekf.cs.gps_hgt and not is_newer_than_latest(ekf, ekf.gnss_newest_time_us, 2 * GNSS_MAX_INTERVAL):
        stop_gps_hgt_fusion(ekf)


@kernel
def _use_gnss_height(ekf, params, sample):
    aid = ekf.aid.gnss_hgt
    bias_est = ekf.gps_hgt_b_est
    noise = max(sample.vacc, TYPICAL_VACC_PER_HACC * params.EKF2_GPS_P_NOISE)
    if not is_only_active_source_of_vertical_position_aiding(ekf, ekf.cs.gps_hgt):
        noise = min(noise, params.EKF2_NOAID_NOISE)
    x, y, z = antenna_offset_body(params)
    _, _, offset_d = rotate_to_earth(ekf.R_to_earth, x, y, z)
    measurement = sample.alt + offset_d
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
    if ekf.withheld.gnss:
        pretend_height_fused(ekf, aid, ekf.cs.gps_hgt)
        return
    # the bias follows once the innovation has been formed with its old value, but before the filter is corrected
    if valid:
        set_max_state_noise(bias_est, noise)
        set_process_noise_spectral_density(bias_est, HEIGHT_BIAS_NOISE_DENSITY)
        fuse_height_bias(
            ekf,
            bias_est,
            HEIGHT_REF_GNSS,
            measurement - ekf.gpos_alt,
            variance + ekf.P[POSITION + 2, POSITION + 2],
        )

    usable = valid and ekf.origin.lat_lon_valid and ekf.gnss.checks_passed
    continuing = usable and int(params.EKF2_GPS_CTRL) & GPS_CTRL_VPOS != 0
    if not ekf.cs.gps_hgt:
        recent = is_newer_than_latest(ekf, ekf.gnss_newest_time_us, 2 * GNSS_MAX_INTERVAL)
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
        aid.time_last_fuse = ekf.time_delayed_us
        bias_est.fusion_active = True
        ekf.cs.gps_hgt = True
    if initialise_origin:
        ekf.events.reset_hgt_to_gps = True
        initialise_altitude_to(ekf, params, measurement, variance)
        reset_bias(bias_est)


@kernel
def stop_gps_hgt_fusion(ekf):
    """Stop fusing GNSS height."""
    if ekf.cs.gps_hgt:
        if ekf.height_sensor_ref == HEIGHT_REF_GNSS:
            ekf.height_sensor_ref = HEIGHT_REF_UNKNOWN
        ekf.gps_hgt_b_est.fusion_active = False
        ekf.cs.gps_hgt = False
