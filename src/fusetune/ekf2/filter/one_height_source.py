"""The height of v1.13: one source at a time, which EKF2_HGT_MODE names, or what takes its place.

The barometer is held against the others by two offsets: one that follows the height while another source gives it, and
a bias that is learnt from GNSS. Range may lead where it is wanted (EKF2_RNG_AID) and the vehicle is low and slow.

Mirrors `controlHeightSensorTimeouts` and `controlHeightFusion` of PX4 v1.13 `EKF/control.cpp`, `EKF/height_fusion.cpp`
and the resets and starts of `EKF/ekf_helper.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.aid_sources.barometer.baro_offset_bias import (
    BARO_OFFSET_BIAS,
    fuse_baro_bias,
    predict_baro_bias,
)
from fusetune.ekf2.filter.aid_sources.barometer.ground_effect import apply_ground_effect_deadzone, update_ground_effect
from fusetune.ekf2.filter.aid_sources.gnss.gnss_taken import (
    VERTICAL_TO_HORIZONTAL,
    gnss_height,
    gnss_height_variance,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_control import (
    START_HYSTERESIS,
    START_TEST_RATIO,
    check_range_sensor,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import (
    get_hagl,
    is_height_reset_required,
    is_horizontal_aiding_active,
    is_terrain_estimate_valid,
)
from fusetune.ekf2.filter.common.height_reference import (
    HEIGHT_REF_BARO,
    HEIGHT_REF_EV,
    HEIGHT_REF_GNSS,
    HEIGHT_REF_RANGE,
)
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import BARO_MAX_INTERVAL, EV_MAX_INTERVAL, is_newest_sample_recent
from fusetune.ekf2.filter.resets.state_resets import (
    reset_altitude_to,
    reset_vertical_velocity_to,
    reset_vertical_velocity_to_zero,
)
from fusetune.ekf2.filter.vertical_innovations import fuse_vertical_position_apart

HEIGHTS = np.dtype(
    [
        *fields("f8", "sensor_offset", "baro_interval"),
        ("baro_time_us", "i8"),
        *fields("?", "range_suits", "baro_intermittent"),
        ("baro_bias", BARO_OFFSET_BIAS),
    ],
    align=True,
)
"""Sub-record `ekf.heights`: what GNSS or range are taken to be off by (m); the time of the last sample of the barometer
(µs), that to the one before (s, 0 at first), and whether samples are missing; whether the vehicle is low and slow
enough for range. The offset of the barometer (m) is `ekf.baro.lpf`."""

OFFSET_GAIN = 0.1
OFFSET_RATE_MAX = 0.1
LONGEST_INTERVAL_S = 1.0
LEAST_BARO_NOISE = 0.01
LEAST_RANGE_VARIANCE = 0.01
LEAST_VISION_VARIANCE = 0.01**2


@kernel
def watch_range_and_baro(ekf, params):
    """What is to be known of the height sensors before anything is fused."""
    if ekf.sensors.range.exists:
        check_range_sensor(ekf, params)
    heights, baro = ekf.heights, ekf.sensors.baro
    heights.baro_intermittent = not is_newest_sample_recent(ekf, baro.newest_time_us, 2 * BARO_MAX_INTERVAL)
    if baro.data_ready:
        if heights.baro_time_us != 0:
            interval = (baro.sample.time_us - heights.baro_time_us) * 1e-6
            heights.baro_interval = min(max(interval, 0.0), LONGEST_INTERVAL_S)
        heights.baro_time_us = baro.sample.time_us


@kernel
def _is_baro_sound(ekf):
    return not ekf.cs.baro_fault and not ekf.heights.baro_intermittent


@kernel
def _is_gnss_sound(ekf):
    return not ekf.gnss.intermittent and ekf.gnss.checks_passed


@kernel
def replace_lost_height(ekf, params):
    """Where no height was fused for 5 s, or the acceleration was bad for 0.5 s: reset to a source, and the vertical
    velocity, too."""
    if not is_height_reset_required(ekf):
        return
    cs = ekf.cs
    if cs.baro_hgt:
        blames_baro = (ekf.gnss.checks_passed and not ekf.fs.bad_acc_vertical) or not _is_baro_sound(ekf)
        if not ekf.gnss.intermittent and blames_baro:
            cs.baro_fault = True
            _start_gnss_height(ekf, params)
        elif _is_baro_sound(ekf):
            _reset_to_baro(ekf, params)
    elif cs.gps_hgt:
        blames_gnss = (not ekf.fs.bad_acc_vertical and not ekf.gnss.checks_passed) or ekf.gnss.intermittent
        if _is_baro_sound(ekf) and blames_gnss:
            start_baro_height(ekf, params)
        elif not ekf.gnss.intermittent:
            _reset_to_gnss(ekf, params)
    elif cs.rng_hgt:
        if ekf.range.is_sample_valid:
            _reset_to_range(ekf, params)
        elif _is_baro_sound(ekf):
            start_baro_height(ekf, params)
    elif cs.ev_hgt:
        if is_newest_sample_recent(ekf, ekf.sensors.ev.newest_time_us, 2 * EV_MAX_INTERVAL):
            _reset_to_vision(ekf, params)
        elif ekf.range.is_sample_valid:
            _start_range_height(ekf, params)
        elif _is_baro_sound(ekf):
            start_baro_height(ekf, params)
    if cs.gnss_pos and _is_gnss_sound(ekf):
        deviation = VERTICAL_TO_HORIZONTAL * ekf.gnss_taken.sacc
        reset_vertical_velocity_to(ekf, params, ekf.gnss_taken.vel[2], deviation * deviation)
    else:
        reset_vertical_velocity_to_zero(ekf, params)


@kernel
def control_one_height(ekf, params):
    """Choose the source, follow the offsets of the barometer, and fuse."""
    _choose_source(ekf, params)
    _learn_baro_bias(ekf, params)
    _follow_baro_offset(ekf)
    update_ground_effect(ekf, params)
    cs = ekf.cs
    if cs.baro_hgt:
        if ekf.sensors.baro.data_ready and not cs.baro_fault:
            _fuse_baro(ekf, params)
    elif cs.gps_hgt:
        if ekf.sensors.gnss.data_ready:
            _fuse_gnss(ekf, params)
    elif cs.rng_hgt:
        if is_data_healthy(ekf.range):
            _fuse_range(ekf, params)
    elif cs.ev_hgt and ekf.sensors.ev.data_ready:
        _fuse_vision(ekf, params)


@kernel
def _choose_source(ekf, params):
    heights, cs, mode = ekf.heights, ekf.cs, int(params.EKF2_HGT_MODE)
    heights.range_suits = _is_low_and_slow(ekf, params)
    aided = int(params.EKF2_RNG_AID) == 1 and heights.range_suits
    if mode == HEIGHT_REF_RANGE:
        _assume_distance_on_ground(ekf, params)
        if not cs.rng_hgt and is_data_healthy(ekf.range):
            _start_range_height(ekf, params)
    elif mode == HEIGHT_REF_EV:
        recent = is_newest_sample_recent(ekf, ekf.sensors.ev.newest_time_us, 2 * EV_MAX_INTERVAL)
        if not cs.ev_hgt and recent:
            _start_vision_height(ekf, params)
    elif aided:
        if not _led_by_range(ekf, mode) and is_data_healthy(ekf.range):
            _start_range_aid(ekf)
    elif mode == HEIGHT_REF_GNSS:
        if not cs.gps_hgt and _is_gnss_sound(ekf):
            _start_gnss_height(ekf, params)
        elif not cs.gps_hgt and not cs.baro_hgt and _is_baro_sound(ekf):
            start_baro_height(ekf, params)
    elif not cs.baro_hgt:
        if _is_baro_sound(ekf):
            start_baro_height(ekf, params)
        elif not cs.gps_hgt and _is_gnss_sound(ekf):
            _start_gnss_height(ekf, params)


@kernel
def _is_low_and_slow(ekf, params):
    """Whether the vehicle flies low and slow over known, steady ground; to begin with, with room to spare."""
    if not ekf.cs.in_air or not ekf.range.is_sample_valid or not is_terrain_estimate_valid(ekf):
        return False
    aid, gate, suits = ekf.aid.terrain_range_finder, params.EKF2_RNG_A_IGATE, ekf.heights.range_suits
    scale, ratio_max = (1.0, 1.0) if suits else (START_HYSTERESIS, START_TEST_RATIO)
    steady = aid.innovation[0] * aid.innovation[0] < ratio_max * gate * gate * aid.innovation_variance[0]
    low = get_hagl(ekf) < scale * params.EKF2_RNG_A_HMAX
    slow = True
    if is_horizontal_aiding_active(ekf):
        speed_max = scale * params.EKF2_RNG_A_VMAX
        slow = ekf.vel[0] * ekf.vel[0] + ekf.vel[1] * ekf.vel[1] <= speed_max * speed_max
    return steady and low and slow


@kernel
def _led_by_range(ekf, mode):
    """Of this update or, with GNSS, of the one before."""
    return ekf.cs_prev.rng_hgt if mode == HEIGHT_REF_GNSS else ekf.cs.rng_hgt


@kernel
def _assume_distance_on_ground(ekf, params):
    """Standing on the ground the distance is known, whatever the sensor says."""
    rng = ekf.range
    if not ekf.cs.in_air and not is_data_healthy(rng) and rng.is_regularly_sending_data and rng.is_sample_ready:
        rng.sample.range = params.EKF2_MIN_RNG
        rng.is_sample_valid = True


@kernel
def _led_by(ekf, source):
    cs = ekf.cs
    cs.baro_hgt = source == HEIGHT_REF_BARO
    cs.gps_hgt = source == HEIGHT_REF_GNSS
    cs.rng_hgt = source == HEIGHT_REF_RANGE
    cs.ev_hgt = source == HEIGHT_REF_EV


@kernel
def start_baro_height(ekf, params):
    """Let the barometer lead: after range, which it was held against, without a reset."""
    if ekf.cs.baro_hgt:
        return
    if not ekf.cs.rng_hgt:
        _reset_to_baro(ekf, params)
    _led_by(ekf, HEIGHT_REF_BARO)
    ekf.heights.sensor_offset = 0.0


@kernel
def _start_gnss_height(ekf, params):
    if ekf.cs.gps_hgt:
        return
    if ekf.cs.rng_hgt:
        ekf.heights.sensor_offset = gnss_height(ekf) - ekf.gpos_alt
    else:
        ekf.heights.sensor_offset = 0.0
        _reset_to_gnss(ekf, params)
    _led_by(ekf, HEIGHT_REF_GNSS)


@kernel
def _start_range_height(ekf, params):
    """Let range lead: the ground becomes the datum, as it is for vision."""
    if ekf.cs.rng_hgt:
        return
    _led_by(ekf, HEIGHT_REF_RANGE)
    ekf.heights.sensor_offset = 0.0
    if not ekf.cs_prev.ev_hgt:
        _reset_to_range(ekf, params)


@kernel
def _start_range_aid(ekf):
    if not ekf.cs.rng_hgt:
        _led_by(ekf, HEIGHT_REF_RANGE)
        ekf.heights.sensor_offset = ekf.terrain


@kernel
def _start_vision_height(ekf, params):
    _led_by(ekf, HEIGHT_REF_EV)
    if not ekf.cs_prev.rng_hgt:
        _reset_to_vision(ekf, params)


@kernel
def _reset_to_baro(ekf, params):
    ekf.events.reset_hgt_to_baro = True
    height = ekf.sensors.baro.sample.hgt - ekf.baro.lpf
    reset_altitude_to(ekf, params, height, params.EKF2_BARO_NOISE * params.EKF2_BARO_NOISE)


@kernel
def _reset_and_move_baro(ekf, params, height, variance):
    """Set the height (m); the barometer stays as far off as it was."""
    before = ekf.gpos_alt
    reset_altitude_to(ekf, params, height, variance)
    ekf.baro.lpf -= ekf.gpos_alt - before


@kernel
def _reset_to_gnss(ekf, params):
    ekf.events.reset_hgt_to_gps = True
    _reset_and_move_baro(ekf, params, gnss_height(ekf), gnss_height_variance(ekf, params))


@kernel
def _reset_to_range(ekf, params):
    ekf.events.reset_hgt_to_rng = True
    distance = dist_bottom(ekf.range) if ekf.cs.in_air else params.EKF2_MIN_RNG
    noise = params.EKF2_RNG_NOISE
    _reset_and_move_baro(ekf, params, distance - ekf.heights.sensor_offset, noise * noise)


@kernel
def _reset_to_vision(ekf, params):
    ekf.events.reset_hgt_to_ev = True
    sample = ekf.sensors.ev.sample
    _reset_and_move_baro(ekf, params, -sample.pos[2], max(sample.position_var[2], LEAST_VISION_VARIANCE))


@kernel
def _learn_baro_bias(ekf, params):
    """Let the bias wander with the barometer's samples, and hold it against GNSS with those of GNSS."""
    bias, interval, noise = ekf.heights.baro_bias, ekf.heights.baro_interval, params.EKF2_BARO_NOISE
    if ekf.sensors.baro.data_ready and interval != 0.0:
        predict_baro_bias(bias, interval, noise)
    known = ekf.origin.valid and not ekf.cs.baro_fault
    if is_fusion_due(ekf.sensors.gnss) and _is_gnss_sound(ekf) and known:
        difference = ekf.sensors.baro.sample.hgt - ekf.baro.lpf - gnss_height(ekf)
        fuse_baro_bias(bias, difference, gnss_height_variance(ekf, params) + noise * noise, noise)


@kernel
def _follow_baro_offset(ekf):
    """While another source leads, the offset follows what the barometer differs by."""
    interval = ekf.heights.baro_interval
    if not ekf.cs.baro_hgt and ekf.sensors.baro.data_ready and interval != 0.0:
        unbiased = ekf.sensors.baro.sample.hgt - ekf.heights.baro_bias.bias
        rate = OFFSET_GAIN * (unbiased - ekf.gpos_alt - ekf.baro.lpf)
        ekf.baro.lpf += interval * min(max(rate, -OFFSET_RATE_MAX), OFFSET_RATE_MAX)


@kernel
def _set_height(ekf, aid, told, variance, innovation):
    """Set what is told (m): heights up, but that of vision down; the innovation is down like the state."""
    set_axis(aid, 0, told, variance, innovation, ekf.P[POSITION + 2, POSITION + 2] + variance)


@kernel
def _judge_and_fuse(ekf, params, sensor, aid, time_us, gate):
    update_aid_source_status(ekf, aid, 1, time_us, gate)
    if not sensor.withheld:
        fuse_vertical_position_apart(ekf, params, aid, gate)


@kernel
def _fuse_baro(ekf, params):
    baro, aid = ekf.sensors.baro, ekf.aid.baro_hgt
    height = baro.sample.hgt - ekf.heights.baro_bias.bias - ekf.baro.lpf
    innovation = height - ekf.gpos_alt
    if ekf.cs.gnd_effect and params.EKF2_GND_EFF_DZ > 0.0:
        innovation = apply_ground_effect_deadzone(innovation, params.EKF2_GND_EFF_DZ)
    noise = max(params.EKF2_BARO_NOISE, LEAST_BARO_NOISE)
    _set_height(ekf, aid, height, noise * noise, innovation)
    _judge_and_fuse(ekf, params, baro, aid, baro.sample.time_us, max(params.EKF2_BARO_GATE, 1.0))


@kernel
def _fuse_gnss(ekf, params):
    """Fuse the height of GNSS, with the gate of the barometer."""
    aid, height = ekf.aid.gnss_hgt, gnss_height(ekf) - ekf.heights.sensor_offset
    _set_height(ekf, aid, height, gnss_height_variance(ekf, params), height - ekf.gpos_alt)
    gate = max(params.EKF2_BARO_GATE, 1.0)
    _judge_and_fuse(ekf, params, ekf.sensors.gnss, aid, ekf.gnss_taken.time_us, gate)


@kernel
def _fuse_range(ekf, params):
    aid, measured = ekf.aid.rng_hgt, dist_bottom(ekf.range)
    distance, scaled = max(measured, params.EKF2_MIN_RNG), params.EKF2_RNG_SFE * measured
    variance = max(params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE + scaled * scaled, LEAST_RANGE_VARIANCE)
    height = distance - ekf.heights.sensor_offset
    _set_height(ekf, aid, height, variance, height - ekf.gpos_alt)
    gate = max(params.EKF2_RNG_GATE, 1.0)
    _judge_and_fuse(ekf, params, ekf.sensors.range, aid, ekf.range.sample.time_us, gate)


@kernel
def _fuse_vision(ekf, params):
    """Fuse the down position of vision, which is told of as that."""
    aid, sample = ekf.aid.ev_hgt, ekf.sensors.ev.sample
    variance = max(sample.position_var[2], LEAST_VISION_VARIANCE)
    _set_height(ekf, aid, sample.pos[2], variance, -ekf.gpos_alt - sample.pos[2])
    _judge_and_fuse(ekf, params, ekf.sensors.ev, aid, sample.time_us, max(params.EKF2_EVP_GATE, 1.0))
