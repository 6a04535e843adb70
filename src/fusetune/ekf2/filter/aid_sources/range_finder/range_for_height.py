"""The range finder as one more height source, with a bias against the height reference.

What it measures is the height over the ground where it took over: -(distance - bias) is a down position. As an
unconditional reference it makes the ground the datum.

Mirrors PX4 v1.15 `EKF/range_height_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_control import (
    RNG_CTRL_CONDITIONAL,
    RNG_CTRL_ENABLED,
    START_HYSTERESIS,
    START_TEST_RATIO,
    check_range_sensor,
    has_recent_range,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy
from fusetune.ekf2.filter.bias_estimator.bias_estimator import reset_bias, set_bias
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import (
    predict_height_bias,
    start_height_source,
    stop_height_source,
    update_height_bias,
)
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status
from fusetune.ekf2.filter.common.conditions import (
    get_hagl,
    is_height_reset_required,
    is_horizontal_aiding_active,
    is_terrain_estimate_valid,
)
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.common.timing import HGT_FUSION_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to, reset_vertical_velocity_to_zero


@kernel
def control_range_for_height(ekf, params):
    """Process the range sample that reached the fusion time horizon, if any, and watch over the sensor."""
    if not ekf.sensors.range.exists:
        return
    check_range_sensor(ekf, params)
    predict_height_bias(ekf, ekf.rng_hgt_b_est, HEIGHT_REF_RANGE, ekf.dt_ekf_avg)
    if ekf.sensors.range.data_ready:
        _use_sample(ekf, params)
    elif ekf.cs.rng_hgt and not has_recent_range(ekf):
        stop_range_for_height(ekf)


@kernel
def _use_sample(ekf, params):
    """Judge the distance, learn its bias, then fuse, reset, start or stop."""
    rng, bias = ekf.range, ekf.rng_hgt_b_est
    distance = max(dist_bottom(rng), params.EKF2_MIN_RNG)
    scaled = params.EKF2_RNG_SFE * dist_bottom(rng)
    variance = params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE + scaled * scaled
    update_vertical_position_aid_status(
        ekf,
        ekf.aid.rng_hgt,
        rng.sample.time_us,
        bias.bias - distance,
        max(variance + bias.bias_var, 0.01**2),
        max(params.EKF2_RNG_GATE, 1.0),
    )
    valid = math.isfinite(distance) and math.isfinite(variance) and is_data_healthy(rng)
    if valid:
        update_height_bias(ekf, bias, HEIGHT_REF_RANGE, distance - ekf.gpos_alt, variance)

    ctrl = int(params.EKF2_RNG_CTRL)
    conditionally = ctrl == RNG_CTRL_CONDITIONAL and is_low_and_slow(ekf, params)
    continuing = valid and (ctrl == RNG_CTRL_ENABLED or conditionally)
    if ekf.cs.rng_hgt:
        if continuing:
            _fuse_or_recover(ekf, params, distance)
        else:
            stop_range_for_height(ekf)
    elif continuing and has_recent_range(ekf) and rng.is_regularly_sending_data:
        _start(ekf, params, distance, variance)


@kernel
def _set_bias_to_difference(ekf, distance):
    """Let the distance agree with the height."""
    set_bias(ekf.rng_hgt_b_est, distance - ekf.gpos_alt)


@kernel
def _fuse_or_recover(ekf, params, distance):
    """Fuse; reset the height where every source fails, and give up a sensor that fails alone."""
    aid = ekf.aid.rng_hgt
    fuse_vertical_position(ekf, params, aid)
    if is_height_reset_required(ekf):
        ekf.events.reset_hgt_to_rng = True
        reset_altitude_to(ekf, params, distance - ekf.rng_hgt_b_est.bias, math.nan)
        _set_bias_to_difference(ekf, distance)
        reset_vertical_velocity_to_zero(ekf, params)
        aid.time_last_fuse = ekf.time_delayed_us
    elif is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX):
        stop_range_for_height(ekf)
        ekf.cs.rng_fault = True
        ekf.terrain_filter.range_is_faulty = True


@kernel
def _start(ekf, params, distance, variance):
    """As the wanted reference it leads; only as an unconditional one it also becomes the height."""
    is_reference = int(params.EKF2_HGT_REF) == HEIGHT_REF_RANGE
    if is_reference:
        ekf.height_sensor_ref = HEIGHT_REF_RANGE
    if is_reference and int(params.EKF2_RNG_CTRL) != RNG_CTRL_CONDITIONAL:
        ekf.events.reset_hgt_to_rng = True
        reset_altitude_to(ekf, params, distance, variance)
        reset_bias(ekf.rng_hgt_b_est)
    else:
        _set_bias_to_difference(ekf, distance)
    start_height_source(ekf, ekf.rng_hgt_b_est, ekf.aid.rng_hgt)
    ekf.cs.rng_hgt = True


@kernel
def is_low_and_slow(ekf, params):
    """Whether the vehicle flies low and slow enough over known, steady ground for range to aid the height.

    Starting takes 70 % of EKF2_RNG_A_HMAX and EKF2_RNG_A_VMAX, and a test ratio a hundred times smaller. The ratio is
    the terrain's, with the gate EKF2_RNG_A_IGATE.
    """
    if not ekf.cs.in_air or not ekf.range.is_sample_valid or not is_terrain_estimate_valid(ekf):
        return False
    aid, gate = ekf.aid.terrain_range_finder, params.EKF2_RNG_A_IGATE
    scale, ratio_max = 1.0, 1.0
    if not ekf.cs.rng_hgt:
        scale, ratio_max = START_HYSTERESIS, START_TEST_RATIO
    innovation_squared = aid.innovation[0] * aid.innovation[0]
    if not innovation_squared < ratio_max * gate * gate * aid.innovation_variance[0]:
        return False
    if not get_hagl(ekf) < scale * params.EKF2_RNG_A_HMAX:
        return False
    if is_horizontal_aiding_active(ekf):
        return math.hypot(ekf.vel[0], ekf.vel[1]) <= scale * params.EKF2_RNG_A_VMAX
    return True


@kernel
def stop_range_for_height(ekf):
    """Leave the range finder as height source, and as height reference."""
    if ekf.cs.rng_hgt:
        stop_height_source(ekf, ekf.rng_hgt_b_est, HEIGHT_REF_RANGE)
        forget_aid_source_status(ekf, ekf.aid.rng_hgt, 1)
        ekf.cs.rng_hgt = False
