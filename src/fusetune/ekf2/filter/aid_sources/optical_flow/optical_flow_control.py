"""Optical flow: body rate compensation, when it is fused, and resets of velocity and terrain to it.

Mirrors PX4 v1.16 `EKF/aid_sources/optical_flow/optical_flow_control.cpp`. Rates are rad/s about the body axes in the
estimator's sign: positive where the scene turns right-handed, so a flow gyro reads minus the body rate.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import (
    calc_opt_flow_meas_var,
    compute_flow_jacobian,
    fuse_opt_flow,
    predict_flow,
    predict_flow_range,
    set_flow_rejection,
)
from fusetune.ekf2.filter.common.aid_source_status import (
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import (
    get_hagl,
    is_horizontal_aiding_active,
    is_only_active_source_of_horizontal_aiding,
    is_other_source_of_horizontal_aiding_than,
    is_terrain_estimate_valid,
)
from fusetune.ekf2.filter.common.global_position import single_precision
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.common.imu_rates import body_rate
from fusetune.ekf2.filter.common.state import TERRAIN
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, RESET_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.covariance import reset_covariance_block
from fusetune.ekf2.filter.observation_gain import compute_innovation_variance
from fusetune.ekf2.filter.resets.state_resets import reset_horizontal_velocity_to, update_terrain_reset_status
from fusetune.ekf2.releases.by_release import by_release

GYRO_SOURCE_INTERNAL = 1
GYRO_BIAS_FORGETTING = 0.01
GYRO_BIAS_STEP_LIMIT = 0.1
VELOCITY_FILTER_ALPHA = 0.01 / (0.01 + 0.09)
COS_MAX_TILT = 0.7071
MIN_SAMPLES_BEFORE_START = 10
RESTART_INTERVAL_US = 2_000_000
TERRAIN_VARIANCE_AFTER_RESET = 100.0
LEAST_RATE = 1e-6


@kernel
def _complete_gyro_rate(ekf, params):
    """Fill in the gyro rates that the sensor lacks from the IMU, or replace them all if so configured."""
    flow, rate = ekf.flow, ekf.sensors.flow.sample.gyro_rate
    internal = int(params.EKF2_OF_GYR_SRC) == GYRO_SOURCE_INTERNAL
    xy_missing = not math.isfinite(rate[0]) or not math.isfinite(rate[1])
    x, y, z = body_rate(ekf)
    flow.ref_body_rate[0], flow.ref_body_rate[1], flow.ref_body_rate[2] = -x, -y, -z
    for i in range(3):
        if internal or xy_missing or not math.isfinite(rate[i]):
            rate[i] = flow.ref_body_rate[i]


@kernel
def _update_gyro_bias(ekf):
    """Follow the difference between the sensor's gyro and the IMU slowly, whatever its spikes."""
    flow, rate = ekf.flow, ekf.sensors.flow.sample.gyro_rate
    for i in range(3):
        difference = min(max(rate[i] - flow.ref_body_rate[i], -GYRO_BIAS_STEP_LIMIT), GYRO_BIAS_STEP_LIMIT)
        flow.gyro_bias[i] = (1.0 - GYRO_BIAS_FORGETTING) * flow.gyro_bias[i] + GYRO_BIAS_FORGETTING * difference


@kernel
def _update_optical_flow(ekf, params):
    """Judge the sample, and keep the velocity that it amounts to."""
    sample, flow, aid = ekf.sensors.flow.sample, ekf.flow, ekf.aid.optical_flow
    gx = sample.gyro_rate[0] - flow.gyro_bias[0]
    gy = sample.gyro_rate[1] - flow.gyro_bias[1]
    gz = sample.gyro_rate[2] - flow.gyro_bias[2]
    flow.rate_compensated[0] = sample.flow_rate[0] - gx
    flow.rate_compensated[1] = sample.flow_rate[1] - gy
    predicted = predict_flow(ekf, params, gx, gy, gz)
    variance = calc_opt_flow_meas_var(params, sample.quality)
    for axis in range(2):
        observation = flow.rate_compensated[axis]
        compute_flow_jacobian(ekf, axis, flow.H[axis])
        innovation_variance = compute_innovation_variance(ekf, flow.H[axis], variance)
        set_axis(aid, axis, observation, variance, predicted[axis] - observation, innovation_variance)
    update_aid_source_status(ekf, aid, 2, sample.time_us, max(params.EKF2_OF_GATE, 1.0))
    _filter_flow_velocity(ekf, params)


@kernel
def _filter_flow_velocity(ekf, params):
    flow = ekf.flow
    distance = predict_flow_range(ekf, params)
    flow.vel_body[0] = -flow.rate_compensated[1] * distance
    flow.vel_body[1] = flow.rate_compensated[0] * distance
    for i in range(2):
        if flow.counter == 0:
            flow.vel_body_lpf[i] = flow.vel_body[i]
        else:
            flow.vel_body_lpf[i] += VELOCITY_FILTER_ALPHA * (flow.vel_body[i] - flow.vel_body_lpf[i])
    _filter_flow_rates(ekf)
    flow.counter += 1


@kernel
def _filter_nothing(ekf):
    """v1.16 asks for the velocities alone."""


@kernel
def _filter_compensated_rates(ekf):
    flow, filtered = ekf.flow, ekf.flow_rates.compensated_lpf
    for i in range(2):
        if flow.counter == 0:
            filtered[i] = flow.rate_compensated[i]
        else:
            filtered[i] += VELOCITY_FILTER_ALPHA * (flow.rate_compensated[i] - filtered[i])


_filter_flow_rates = by_release(_filter_nothing, "scales_terrain_to_flow", _filter_compensated_rates)


@kernel
def _is_magnitude_good(ekf):
    """Whether flow stays below what the sensor can follow, raw and compensated."""
    raw, compensated = ekf.sensors.flow.sample.flow_rate, ekf.flow.rate_compensated
    limit = ekf.flow.max_rate * ekf.flow.max_rate
    return (
        math.isfinite(raw[0])
        and math.isfinite(raw[1])
        and not raw[0] * raw[0] + raw[1] * raw[1] > limit
        and not compensated[0] * compensated[0] + compensated[1] * compensated[1] > limit
    )


@kernel
def _is_quality_good(ekf, params):
    minimum = params.EKF2_OF_QMIN if ekf.cs.in_air else params.EKF2_OF_QMIN_GND
    return ekf.sensors.flow.sample.quality >= minimum


@kernel
def control_optical_flow_fusion(ekf, params):
    """Start, continue, reset or stop optical flow."""
    if not ekf.sensors.flow.exists or int(params.EKF2_OF_CTRL) != 1:
        stop_flow_fusion(ekf)
        return
    if ekf.sensors.flow.data_ready:
        _use_flow_sample(ekf, params)
    elif ekf.cs.opt_flow and is_timed_out(ekf, ekf.sensors.flow.sample.time_us, RESET_TIMEOUT_MAX):
        stop_flow_fusion(ekf)


@kernel
def _by_terrain(ekf):
    return is_terrain_estimate_valid(ekf)


@kernel
def _by_terrain_or_reference(ekf):
    return is_terrain_estimate_valid(ekf) or ekf.height_sensor_ref == HEIGHT_REF_RANGE


_is_height_known = by_release(_by_terrain, "knows_height_by_range", _by_terrain_or_reference)


@kernel
def _use_flow_sample(ekf, params):
    _complete_gyro_rate(ekf, params)
    _update_gyro_bias(ekf)
    _update_optical_flow(ekf, params)
    magnitude_good = _is_magnitude_good(ekf)
    quality_good = _is_quality_good(ekf, params)
    sample_good = quality_good and magnitude_good and ekf.R_to_earth[2, 2] > COS_MAX_TILT
    continuing_conditions_passing = (
        ekf.cs.tilt_align and ekf.flow.min_distance <= get_hagl(ekf) <= ekf.flow.max_distance
    )
    starting_conditions_passing = (
        continuing_conditions_passing
        and sample_good
        and ekf.flow.counter > MIN_SAMPLES_BEFORE_START
        and (_is_height_known(ekf) or is_horizontal_aiding_active(ekf))
        and is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, RESTART_INTERVAL_US)
    )
    _update_terrain_flag(ekf)
    if ekf.cs.opt_flow:
        if continuing_conditions_passing:
            _continue_flow(ekf, params, sample_good, quality_good and magnitude_good)
        else:
            stop_flow_fusion(ekf)
    elif starting_conditions_passing:
        _start_flow(ekf, params)
        _update_terrain_flag(ekf)


@kernel
def _update_terrain_flag(ekf):
    """Terrain is observable by flow unless the height itself is measured from the ground."""
    ekf.cs.opt_flow_terrain = ekf.cs.opt_flow and ekf.height_sensor_ref != HEIGHT_REF_RANGE


@kernel
def _is_flow_required(ekf):
    """Whether in flight nothing but flow can hold the horizontal drift."""
    return ekf.cs.in_air and (
        ekf.cs.inertial_dead_reckoning or is_only_active_source_of_horizontal_aiding(ekf, ekf.cs.opt_flow)
    )


@kernel
def _continue_flow(ekf, params, sample_good, reset_possible):
    flow_required = _is_flow_required(ekf)
    if sample_good:
        fuse_opt_flow(ekf, params, ekf.cs.opt_flow_terrain)
    if is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, NO_AID_TIMEOUT_MAX):
        if flow_required and reset_possible:
            reset_flow_fusion(ekf, params)
            if ekf.cs.opt_flow_terrain and not is_terrain_estimate_valid(ekf):
                reset_terrain_to_flow(ekf, params)
        else:
            stop_flow_fusion(ekf)


@kernel
def _start_flow(ekf, params):
    height_from_ground = ekf.height_sensor_ref == HEIGHT_REF_RANGE
    update_terrain = not height_from_ground
    ekf.cs.opt_flow_terrain = update_terrain
    if is_horizontal_aiding_active(ekf):
        if fuse_opt_flow(ekf, params, update_terrain):
            ekf.cs.opt_flow = True
        elif update_terrain and not ekf.cs.rng_terrain:
            reset_terrain_to_flow(ekf, params)
            ekf.cs.opt_flow = True
    elif is_terrain_estimate_valid(ekf) or height_from_ground:
        reset_flow_fusion(ekf, params)
        ekf.cs.opt_flow = True
    elif update_terrain:
        reset_terrain_to_flow(ekf, params)
        ekf.cs.opt_flow = True


@kernel
def _settle_flow_status(ekf):
    reset_aid_source_status_zero_innovation(ekf, ekf.aid.optical_flow, 2)
    set_flow_rejection(ekf, False, False)


@kernel
def reset_flow_fusion(ekf, params):
    """Set the horizontal velocity to that of flow."""
    ekf.events.reset_vel_to_flow = True
    distance = predict_flow_range(ekf, params)
    variance = distance * distance * calc_opt_flow_meas_var(params, ekf.sensors.flow.sample.quality)
    forward, right, R = ekf.flow.vel_body_lpf[0], ekf.flow.vel_body_lpf[1], ekf.R_to_earth
    north = R[0, 0] * forward + R[0, 1] * right
    east = R[1, 0] * forward + R[1, 1] * right
    reset_horizontal_velocity_to(ekf, params, north, east, variance, variance)
    _settle_flow_status(ekf)


@kernel
def _height_on_ground(ekf, params):
    """Take the vehicle to stand on the ground."""
    return params.EKF2_MIN_RNG


@kernel
def _height_of_aided_velocity(ekf, params):
    """The distance at which the velocity, where something else aids it, causes this flow; else as on the ground."""
    if not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.opt_flow):
        return params.EKF2_MIN_RNG
    rates, R = ekf.flow_rates.compensated_lpf, ekf.R_to_earth
    north = -R[0, 0] * rates[1] + R[0, 1] * rates[0]
    east = -R[1, 0] * rates[1] + R[1, 1] * rates[0]
    rate = math.hypot(north, east)
    if rate <= LEAST_RATE:
        return params.EKF2_MIN_RNG
    return max(math.hypot(ekf.vel[0], ekf.vel[1]) / rate, params.EKF2_MIN_RNG)


_height_by_flow = by_release(_height_on_ground, "scales_terrain_to_flow", _height_of_aided_velocity)


@kernel
def reset_terrain_to_flow(ekf, params):
    """Start the terrain anew; flow will find the true height as the vehicle moves."""
    terrain = single_precision(_height_by_flow(ekf, params) - ekf.gpos_alt)
    change = terrain - ekf.terrain
    ekf.terrain = terrain
    reset_covariance_block(ekf, TERRAIN, 1, TERRAIN_VARIANCE_AFTER_RESET)
    _settle_flow_status(ekf)
    update_terrain_reset_status(ekf, change)


@kernel
def stop_flow_fusion(ekf):
    """Leave optical flow."""
    if ekf.cs.opt_flow:
        ekf.cs.opt_flow = False
        ekf.cs.opt_flow_terrain = False
        set_flow_rejection(ekf, False, False)
        ekf.fs.bad_optflow_x = False
        ekf.fs.bad_optflow_y = False
        ekf.flow.counter = 0
