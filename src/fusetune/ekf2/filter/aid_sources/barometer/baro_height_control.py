"""Fusion of barometric height: bias, start, reset as the height reference, fault.

Mirrors PX4 v1.16 `EKF/aid_sources/barometer/baro_height_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.barometer.ground_effect import apply_ground_effect_deadzone
from fusetune.ekf2.filter.aid_sources.barometer.static_pressure import compensate_baro_for_dynamic_pressure
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
from fusetune.ekf2.filter.common.conditions import is_height_reset_required, is_vertical_velocity_aiding_active
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_BARO
from fusetune.ekf2.filter.common.timing import (
    BARO_MAX_INTERVAL,
    HGT_FUSION_TIMEOUT_MAX,
    is_newest_sample_recent,
    is_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.origin_resets import initialise_altitude_to
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to, reset_vertical_velocity_to_zero
from fusetune.ekf2.releases.by_release import by_release, does

BARO_LPF_ALPHA = 0.1

_keeps_fault = does("starts_at_filtered_baro")
_resets_always = does("resets_height_to_each_source")


@kernel
def control_baro_height_fusion(ekf, params):
    """Process the barometer sample that reached the fusion time horizon, if any."""
    predict_height_bias(ekf, ekf.baro_b_est, HEIGHT_REF_BARO, ekf.dt_ekf_avg)

    if ekf.sensors.baro.data_ready:
        measurement = compensate_baro_for_dynamic_pressure(ekf, params, ekf.sensors.baro.sample.hgt)
        variance = params.EKF2_BARO_NOISE * params.EKF2_BARO_NOISE
        valid = math.isfinite(measurement) and math.isfinite(variance)
        if valid:
            _filter_measurement(ekf, measurement)
        _update_baro_status(ekf, params, measurement, variance)
        if not is_fusion_due(ekf.sensors.baro):
            return
        if valid:
            observed_bias = measurement - ekf.gpos_alt
            update_height_bias(ekf, ekf.baro_b_est, HEIGHT_REF_BARO, observed_bias, variance)
        _control_with_sample(ekf, params, measurement, variance, valid)
    elif ekf.cs.baro_hgt and not is_newest_sample_recent(ekf, ekf.sensors.baro.newest_time_us, 2 * BARO_MAX_INTERVAL):
        stop_baro_hgt_fusion(ekf)


@kernel
def _filter_measurement(ekf, measurement):
    """Low-pass the height; while the filter fills, the bias is what the height differs from the estimate by."""
    baro = ekf.baro
    if baro.counter == 0 or ekf.sensors.baro.sample.reset:
        baro.lpf = measurement
        baro.counter = 1
        if not _keeps_fault(ekf):
            ekf.cs.baro_fault = False
    else:
        baro.lpf += BARO_LPF_ALPHA * (measurement - baro.lpf)
        baro.counter += 1
    if baro.counter <= ekf.buffers.observation_length:
        set_bias(ekf.baro_b_est, baro.lpf - ekf.gpos_alt)


@kernel
def _update_baro_status(ekf, params, measurement, variance):
    """Judge the height less its bias, then forgive what ground effect explains."""
    aid, bias = ekf.aid.baro_hgt, ekf.baro_b_est
    update_vertical_position_aid_status(
        ekf,
        aid,
        ekf.sensors.baro.sample.time_us,
        -(measurement - bias.bias),
        variance + bias.bias_var,
        max(params.EKF2_BARO_GATE, 1.0),
    )
    if ekf.cs.gnd_effect and params.EKF2_GND_EFF_DZ > 0.0:
        aid.innovation[0] = apply_ground_effect_deadzone(aid.innovation[0], params.EKF2_GND_EFF_DZ)


@kernel
def _control_with_sample(ekf, params, measurement, variance, valid):
    continuing = (
        int(params.EKF2_BARO_CTRL) == 1
        and valid
        and ekf.baro.counter > ekf.buffers.observation_length
        and not ekf.cs.baro_fault
    )
    if ekf.cs.baro_hgt:
        if continuing:
            _fuse_or_recover(ekf, params, variance)
        else:
            stop_baro_hgt_fusion(ekf)
    elif continuing and is_newest_sample_recent(ekf, ekf.sensors.baro.newest_time_us, 2 * BARO_MAX_INTERVAL):
        _start(ekf, params, measurement, variance)


@kernel
def _fuse_or_recover(ekf, params, variance):
    """Fuse; reset the height if all sources fail and this is the reference; give up if only this one fails."""
    aid = ekf.aid.baro_hgt
    fuse_vertical_position(ekf, params, aid)
    is_fusion_failing = is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX)

    if is_height_reset_required(ekf) and (ekf.height_sensor_ref == HEIGHT_REF_BARO or _resets_always(ekf)):
        ekf.events.reset_hgt_to_baro = True
        reset_altitude_to(ekf, params, ekf.baro.lpf - ekf.baro_b_est.bias, variance)
        set_bias(ekf.baro_b_est, ekf.baro.lpf - ekf.gpos_alt)
        reset_aid_source_status_zero_innovation(ekf, aid, 1)
        if _resets_always(ekf) or not is_vertical_velocity_aiding_active(ekf):
            reset_vertical_velocity_to_zero(ekf, params)
        aid.time_last_fuse = ekf.time_delayed_us
    elif is_fusion_failing:
        stop_baro_hgt_fusion(ekf)
        if is_recent(ekf, ekf.time_last_hgt_fuse, HGT_FUSION_TIMEOUT_MAX):
            # other height sources agree with the filter, so it is the barometer that is wrong
            ekf.cs.baro_fault = True


@kernel
def _start(ekf, params, measurement, variance):
    """Begin fusion: as the height reference by setting the altitude, else with a bias that starts at agreement."""
    if int(params.EKF2_HGT_REF) == HEIGHT_REF_BARO:
        ekf.height_sensor_ref = HEIGHT_REF_BARO
        ekf.events.reset_hgt_to_baro = True
        _set_altitude(ekf, params, measurement, variance)
    else:
        set_bias(ekf.baro_b_est, ekf.baro.lpf - ekf.gpos_alt)
    start_height_source(ekf, ekf.baro_b_est, ekf.aid.baro_hgt)
    ekf.cs.baro_hgt = True


@kernel
def _take_measured_altitude(ekf, params, measurement, variance):
    initialise_altitude_to(ekf, params, measurement, variance)
    reset_bias(ekf.baro_b_est)
    reset_aid_source_status_zero_innovation(ekf, ekf.aid.baro_hgt, 1)


@kernel
def _take_filtered_height(ekf, params, measurement, variance):
    reset_altitude_to(ekf, params, ekf.baro.lpf - ekf.baro_b_est.bias, variance)
    set_bias(ekf.baro_b_est, ekf.baro.lpf - ekf.gpos_alt)


_set_altitude = by_release(_take_measured_altitude, "starts_at_filtered_baro", _take_filtered_height)


@kernel
def stop_baro_hgt_fusion(ekf):
    """Stop fusing barometric height; another source becomes the reference if this was it."""
    if ekf.cs.baro_hgt:
        stop_height_source(ekf, ekf.baro_b_est, HEIGHT_REF_BARO)
        ekf.cs.baro_hgt = False
        forget_aid_source_status(ekf, ekf.aid.baro_hgt, 1)
