"""Optical flow as integrals over the sensor's own interval, until v1.14.

The IMU's rotation is summed up over the same time, so that the gyro of the sensor can be held against it and its
interval be checked. On the ground flow of bad quality counts as none, and the vehicle must not be shaken. The sample
is used once the filter has come past the middle of its interval.

Mirrors PX4 v1.14 `EKF/optical_flow_control.cpp` and `EKF/optflow_fusion.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_over_terrain import (
    COS_MAX_TILT,
    GYRO_BIAS_FORGETTING,
    GYRO_BIAS_STEP_LIMIT,
    fuse_flow_over_terrain,
    judge_flow,
    stop_flow_over_terrain,
)
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import calc_opt_flow_meas_var
from fusetune.ekf2.filter.common.conditions import (
    is_horizontal_aiding_active,
    is_only_active_source_of_horizontal_aiding,
    is_other_source_of_horizontal_aiding_than,
    is_terrain_estimate_valid,
)
from fusetune.ekf2.filter.common.imu_rates import body_rate
from fusetune.ekf2.filter.common.local_origin import remember_horizontal_position
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, is_recent, is_timed_out
from fusetune.ekf2.filter.resets.state_resets import reset_horizontal_velocity_to, reset_local_horizontal_position_to
from fusetune.ekf2.numerics.constants import FLT_EPSILON

CONSTANTS_ONE_G = 9.80665
LARGEST_INTERVAL_S = 0.2
CLOSE_INTERVALS_S = 0.1
COS_MAX_TILT_ON_GROUND = math.cos(math.radians(30.0))
GOOD_MOTION_HOLD_US, BAD_MOTION_HOLD_US = 100_000, 5_000_000
TERRAIN_COAST_US = 10_000_000
DATA_STOPPED_US = 10_000_000

FLOW_INTEGRALS = np.dtype(
    [
        ("imu_angle", "f8", (3,)),
        *fields("f8", "imu_time", "sample_time"),
        ("flow", "f8", (2,)),
        *fields("f8", "gyro", "gyro_bias", shape=(3,)),
        *fields("i8", "time_good_motion", "time_bad_motion"),
    ],
    align=True,
)
"""Sub-record `ekf.flow_integrals`: rotation of the IMU (rad, body) since the last sample and over what time (s); of
the sample in hand its interval (s), the flow and what the gyro turned (rad, in the estimator's sign); the gyro's bias
(rad/s); when the motion on the ground was last good, and bad (µs)."""


@kernel
def control_integrated_flow(ekf, params):
    """Start, continue, reset or stop optical flow."""
    memory, terrain = ekf.flow_integrals, ekf.terrain_filter
    if not terrain.flow_is_good or (not ekf.cs.opt_flow and not terrain.uses_flow):
        terrain.flow_is_good = ekf.sensors.flow.data_ready
        if ekf.sensors.flow.data_ready:
            integrate_sample(ekf)
    watch_motion(ekf)
    _integrate_imu(ekf)
    if terrain.flow_is_good:
        _prepare_sample(ekf, params)
        publish_rates(ekf, memory)
        judge_flow(ekf, params, ekf.aid.optical_flow)
    if terrain.flow_is_good:
        _use_flow(ekf, params)
    elif ekf.cs.opt_flow and not is_recent(ekf, ekf.sensors.flow.sample.time_us, DATA_STOPPED_US):
        stop_flow_over_terrain(ekf)


@kernel
def integrate_sample(ekf):
    """Turn the rates of the sample back into what was measured."""
    memory, sample = ekf.flow_integrals, ekf.sensors.flow.sample
    dt = ekf.flow_interval
    memory.sample_time = dt
    for i in range(2):
        memory.flow[i] = sample.flow_rate[i] * dt
    for i in range(3):
        memory.gyro[i] = sample.gyro_rate[i] * dt


@kernel
def publish_rates(ekf, memory):
    """What the prediction and the observation are made of, over the interval that the sample has now."""
    sample, dt = ekf.sensors.flow.sample, memory.sample_time
    for i in range(3):
        sample.gyro_rate[i] = memory.gyro[i] / dt


@kernel
def watch_motion(ekf):
    """On the ground, see that the vehicle is not shaken, turned too fast or tilted too far for the sensor."""
    memory, force = ekf.flow_integrals, ekf.quaternion.mean_force
    memory_time = ekf.time_delayed_us
    if ekf.cs.in_air:
        memory.time_bad_motion = 0
        memory.time_good_motion = memory_time
        return
    size = math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    excessive = (
        size > 1.5 * CONSTANTS_ONE_G
        or size < 0.5 * CONSTANTS_ONE_G
        or ekf.ang_rate_magnitude_filt > ekf.flow.max_rate
        or ekf.R_to_earth[2, 2] < COS_MAX_TILT_ON_GROUND
    )
    if excessive:
        memory.time_bad_motion = memory_time
    else:
        memory.time_good_motion = memory_time


@kernel
def _restart_imu(ekf):
    memory, dt = ekf.flow_integrals, ekf.imu_delayed.delta_ang_dt
    x, y, z = body_rate(ekf)
    memory.imu_angle[0], memory.imu_angle[1], memory.imu_angle[2] = x * dt, y * dt, z * dt
    memory.imu_time = dt


@kernel
def add_rotation(ekf):
    """Add this update's rotation (rad, FRD) to that since the last sample."""
    memory, dt = ekf.flow_integrals, ekf.imu_delayed.delta_ang_dt
    x, y, z = body_rate(ekf)
    memory.imu_angle[0] += x * dt
    memory.imu_angle[1] += y * dt
    memory.imu_angle[2] += z * dt
    memory.imu_time += dt


@kernel
def forget_rotation(memory):
    """Begin the IMU's rotation since the last sample anew."""
    for i in range(3):
        memory.imu_angle[i] = 0.0
    memory.imu_time = 0.0


@kernel
def follow_gyro_bias(memory):
    """Filter the difference (rad/s) of the sensor's gyro from the IMU, a limited step at a time."""
    for i in range(3):
        difference = memory.gyro[i] / memory.sample_time - memory.imu_angle[i] / memory.imu_time
        step = min(max(difference, -GYRO_BIAS_STEP_LIMIT), GYRO_BIAS_STEP_LIMIT)
        memory.gyro_bias[i] = (1.0 - GYRO_BIAS_FORGETTING) * memory.gyro_bias[i] + GYRO_BIAS_FORGETTING * step


@kernel
def take_imu_for_gyro(memory):
    """The sensor has no gyro: its rotation is the IMU's, without a bias."""
    for i in range(3):
        memory.gyro[i] = -memory.imu_angle[i] / memory.imu_time * memory.sample_time
        memory.gyro_bias[i] = 0.0


@kernel
def _integrate_imu(ekf):
    """Add this update's rotation, or begin anew where no sample came for 0.2 s."""
    if not ekf.flow_integrals.imu_time < LARGEST_INTERVAL_S:
        _restart_imu(ekf)
        return
    add_rotation(ekf)


@kernel
def _is_interval_good(ekf, least, largest):
    """Whether the sensor's interval is that since its last sample, nearly; else the IMU's begins anew with this one."""
    memory = ekf.flow_integrals
    if least <= memory.sample_time <= largest:
        return True
    if memory.sample_time > FLT_EPSILON and abs(ekf.imu_delayed.delta_ang_dt - memory.sample_time) < CLOSE_INTERVALS_S:
        _restart_imu(ekf)
        return True
    return False


@kernel
def _compensate_gyro(ekf):
    """Take the bias off the sensor's gyro, or take the IMU for it; return whether either could be done.

    PX4 holds the gyro against the IMU with the sign that its flow does not have.
    """
    memory = ekf.flow_integrals
    gyro, dt = memory.gyro, memory.sample_time
    comparable = memory.imu_time > FLT_EPSILON and dt > FLT_EPSILON
    available = False
    if math.isfinite(gyro[0]) and math.isfinite(gyro[1]) and math.isfinite(gyro[2]):
        if comparable and abs(memory.imu_time - dt) < CLOSE_INTERVALS_S:
            follow_gyro_bias(memory)
            for i in range(3):
                gyro[i] -= memory.gyro_bias[i] * dt
            available = True
    elif comparable:
        take_imu_for_gyro(memory)
        available = True
    forget_rotation(memory)
    return available


@kernel
def _prepare_sample(ekf, params):
    """Compensate the flow; one that is not good enough is none on the ground, and in the air it is not used."""
    memory, flow = ekf.flow_integrals, ekf.flow
    x, y = memory.flow[0], memory.flow[1]
    reach = memory.sample_time * flow.max_rate
    least = max(0.7 * memory.imu_time, 0.001)
    interval_good = _is_interval_good(ekf, least, min(1.3 * memory.imu_time, LARGEST_INTERVAL_S))
    quality = params.EKF2_OF_QMIN if ekf.cs.in_air else params.EKF2_OF_QMIN_GND
    good = (
        ekf.sensors.flow.sample.quality >= quality
        and not x * x + y * y > reach * reach
        and ekf.R_to_earth[2, 2] > COS_MAX_TILT
    )
    compensated = _compensate_gyro(ekf)
    gyro = memory.gyro
    if not (math.isfinite(gyro[0]) and math.isfinite(gyro[1]) and math.isfinite(gyro[2])):
        gyro[0], gyro[1], gyro[2] = 0.0, 0.0, 0.0
    rates = flow.rate_compensated
    rates[0], rates[1] = 0.0, 0.0
    if good and compensated and interval_good:
        rates[0] = (x - gyro[0]) / memory.sample_time
        rates[1] = (y - gyro[1]) / memory.sample_time
    elif ekf.cs.in_air:
        ekf.terrain_filter.flow_is_good = False
    elif not interval_good:
        memory.sample_time = least


@kernel
def _gnss_error(ekf, params):
    """The largest of the accuracies that GNSS tells, each over what is asked for."""
    sample = ekf.sensors.gnss.sample
    return max(sample.hacc / params.EKF2_REQ_EPH, sample.vacc / params.EKF2_REQ_EPV, sample.sacc / params.EKF2_REQ_SACC)


@kernel
def _is_required(ekf, params):
    """Whether in flight nothing but flow can hold the horizontal drift, or nothing but bad GNSS beside it."""
    if not ekf.cs.in_air:
        return False
    gnss_error_limit = 0.7 if ekf.cs.opt_flow else 1.0
    gnss_bad = (ekf.cs.gnss_pos or ekf.cs.gnss_vel) and _gnss_error(ekf, params) > gnss_error_limit
    alone = is_only_active_source_of_horizontal_aiding(ekf, ekf.cs.opt_flow)
    return ekf.cs.inertial_dead_reckoning or alone or gnss_bad


@kernel
def is_flow_inhibited(ekf, params):
    """Whether motion on the ground, or an unknown terrain in the air, keep the flow from being used."""
    memory, now = ekf.flow_integrals, ekf.time_delayed_us
    if ekf.cs.in_air:
        unsuitable = not is_terrain_estimate_valid(ekf)
    else:
        unsuitable = (
            now > memory.time_good_motion + GOOD_MOTION_HOLD_US or now < memory.time_bad_motion + BAD_MOTION_HOLD_US
        )
    return (unsuitable and not _is_required(ekf, params)) or not ekf.cs.tilt_align


@kernel
def _use_flow(ekf, params):
    enabled, inhibited = int(params.EKF2_OF_CTRL) == 1, is_flow_inhibited(ekf, params)
    if not ekf.cs.opt_flow:
        if enabled and not inhibited:
            _start(ekf, params)
    elif not enabled or inhibited:
        stop_flow_over_terrain(ekf)
    else:
        if is_recent(ekf, ekf.aid.terrain_range_finder.time_last_fuse, TERRAIN_COAST_US):
            fuse_flow_over_terrain(ekf, params)
            remember_horizontal_position(ekf)
        ekf.terrain_filter.flow_is_good = False
        alone = not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.opt_flow)
        if alone and is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, NO_AID_TIMEOUT_MAX):
            _reset_velocity(ekf, params)
            _reset_to_last_position(ekf, params)
            ekf.aid.optical_flow.time_last_fuse = ekf.time_delayed_us


@kernel
def _start(ekf, params):
    """Begin with the next sample; without other aiding the velocity is the flow's, and the position starts anew."""
    if not is_horizontal_aiding_active(ekf):
        _reset_velocity(ekf, params)
        if ekf.cs.in_air:
            _reset_to_last_position(ekf, params)
        else:
            reset_local_horizontal_position_to(ekf, params, 0.0, 0.0, 0.0, 0.0)
            remember_horizontal_position(ekf)
    ekf.aid.optical_flow.time_last_fuse = ekf.time_delayed_us
    ekf.cs.opt_flow = True


@kernel
def _reset_velocity(ekf, params):
    ekf.events.reset_vel_to_flow = True
    forward, right, R = ekf.flow.vel_body[0], ekf.flow.vel_body[1], ekf.R_to_earth
    variance = calc_opt_flow_meas_var(params, ekf.sensors.flow.sample.quality)
    north, east = R[0, 0] * forward + R[0, 1] * right, R[1, 0] * forward + R[1, 1] * right
    reset_horizontal_velocity_to(ekf, params, north, east, variance, variance)


@kernel
def _reset_to_last_position(ekf, params):
    ekf.events.reset_pos_to_last_known = True
    local = ekf.local
    reset_local_horizontal_position_to(ekf, params, local.last_known_north, local.last_known_east, 0.0, 0.0)
