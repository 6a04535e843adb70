"""Optical flow over a terrain that is estimated apart: its distance is given, so the flow corrects the vehicle alone.

With u = Rᵀ v the velocity in the body frame and d the distance along the optical axis, the predicted rates (rad/s) are
(u_y / d, -u_x / d), and ∂u/∂θ = Rᵀ [v]×.

Mirrors PX4 v1.15 `EKF/optical_flow_control.cpp` and `EKF/optflow_fusion.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import (
    calc_opt_flow_meas_var,
    flow_sensor_offset_body,
    predict_flow,
    predict_flow_range,
    set_flow_rejection,
)
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import (
    is_horizontal_aiding_active,
    is_only_active_source_of_horizontal_aiding,
    is_terrain_estimate_valid,
)
from fusetune.ekf2.filter.common.imu_rates import body_rate
from fusetune.ekf2.filter.common.state import ATTITUDE, VELOCITY
from fusetune.ekf2.filter.common.timing import NO_AID_TIMEOUT_MAX, RESET_TIMEOUT_MAX, is_recent, is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance, compute_kalman_gain
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import complete_attitude_jacobian
from fusetune.ekf2.filter.resets.state_resets import reset_horizontal_velocity_to, reset_local_horizontal_position_to
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.numerics.lever_arm import velocity_of_offset
from fusetune.ekf2.numerics.rotations import rotate_to_body

COS_MAX_TILT = 0.7071
RESTART_INTERVAL_US = 2_000_000
TERRAIN_COAST_US = 10_000_000
GYRO_BIAS_FORGETTING = 0.01
GYRO_BIAS_STEP_LIMIT = 0.1


@kernel
def control_flow_over_terrain(ekf, params):
    """Start, continue, reset or stop optical flow; what is not good enough is left out, as if it had not come."""
    terrain = ekf.terrain_filter
    terrain.flow_is_good = ekf.sensors.flow.data_ready and _is_sample_good(ekf, params)
    if terrain.flow_is_good:
        _compensate_body_rate(ekf)
        judge_flow(ekf, params, ekf.aid.optical_flow)
        _use_flow(ekf, params)
    elif ekf.cs.opt_flow and is_timed_out(ekf, ekf.sensors.flow.sample.time_us, RESET_TIMEOUT_MAX):
        stop_flow_over_terrain(ekf)


@kernel
def _is_sample_good(ekf, params):
    """Of the least quality, no faster than the sensor can follow, and not tilted too far."""
    sample = ekf.sensors.flow.sample
    least = params.EKF2_OF_QMIN if ekf.cs.in_air else params.EKF2_OF_QMIN_GND
    x, y = sample.flow_rate[0], sample.flow_rate[1]
    return (
        sample.quality >= least
        and math.isfinite(x)
        and math.isfinite(y)
        and not x * x + y * y > ekf.flow.max_rate * ekf.flow.max_rate
        and ekf.R_to_earth[2, 2] > COS_MAX_TILT
    )


@kernel
def _compensate_body_rate(ekf):
    """Take the sensor's turning, as its own gyro has it or else the IMU, off its flow; follow the gyro's bias.

    PX4 turns the sign of the rate that is told the IMU for, but not that of its bias.
    """
    flow, sample = ekf.flow, ekf.sensors.flow.sample
    rate = sample.gyro_rate
    reference_body_rate(ekf)
    lacks_xy = not math.isfinite(rate[0]) or not math.isfinite(rate[1])
    for i in range(3):
        if lacks_xy or not math.isfinite(rate[i]):
            rate[i] = flow.ref_body_rate[i]
        difference = min(max(rate[i] - flow.ref_body_rate[i], -GYRO_BIAS_STEP_LIMIT), GYRO_BIAS_STEP_LIMIT)
        flow.gyro_bias[i] = (1.0 - GYRO_BIAS_FORGETTING) * flow.gyro_bias[i] + GYRO_BIAS_FORGETTING * difference
    for i in range(2):
        flow.rate_compensated[i] = sample.flow_rate[i] - rate[i]


@kernel
def reference_body_rate(ekf):
    """Write what the flow's gyro should read by the IMU into `ekf.flow.ref_body_rate` (rad/s)."""
    imu, flow = ekf.imu_delayed, ekf.flow
    x, y, z = body_rate(ekf)
    corrected = (x, y, z)
    for i in range(3):
        raw = imu.delta_ang[i] / imu.delta_ang_dt
        bias = raw - corrected[i]
        flow.ref_body_rate[i] = -raw - bias


@kernel
def predict_flow_of_sample(ekf, params):
    """Predicted rates (rad/s) about body X and Y for the sample at hand."""
    rate, bias = ekf.sensors.flow.sample.gyro_rate, ekf.flow.gyro_bias
    return predict_flow(ekf, params, rate[0] - bias[0], rate[1] - bias[1], rate[2] - bias[2])


@kernel
def predict_flow_velocity(ekf, params):
    """Velocity (m/s) of the flow sensor along body X and Y, for the sample at hand."""
    rate, bias = ekf.sensors.flow.sample.gyro_rate, ekf.flow.gyro_bias
    px, py, pz = flow_sensor_offset_body(params)
    offset_x, offset_y, _ = velocity_of_offset(bias[0] - rate[0], bias[1] - rate[1], bias[2] - rate[2], px, py, pz)
    forward, right, _ = rotate_to_body(ekf.R_to_earth, ekf.vel[0], ekf.vel[1], ekf.vel[2])
    return forward + offset_x, right + offset_y


@kernel
def compute_flow_jacobian_at(ekf, axis, distance, H):
    """Write the derivative of the predicted rate about body axis 0 or 1, at a distance (m), into `H` (24,)."""
    R, v = ekf.R_to_earth, ekf.vel
    scale = 1.0 / (distance + math.copysign(FLT_EPSILON, distance))
    body = 1
    if axis == 1:
        body, scale = 0, -scale
    bx, by, bz = R[0, body], R[1, body], R[2, body]
    clear_jacobian(H)
    H[ATTITUDE] = scale * (by * v[2] - bz * v[1])
    H[ATTITUDE + 1] = scale * (bz * v[0] - bx * v[2])
    H[ATTITUDE + 2] = scale * (bx * v[1] - by * v[0])
    H[VELOCITY] = scale * bx
    H[VELOCITY + 1] = scale * by
    H[VELOCITY + 2] = scale * bz
    complete_attitude_jacobian(ekf, H, 2.0 * scale * (bx * v[0] + by * v[1] + bz * v[2]))


@kernel
def judge_flow(ekf, params, aid):
    """Judge the sample, for the status of the main filter or of the terrain, and keep the velocity it amounts to."""
    flow, sample = ekf.flow, ekf.sensors.flow.sample
    distance = predict_flow_range(ekf, params)
    flow.vel_body[0] = -flow.rate_compensated[1] * distance
    flow.vel_body[1] = flow.rate_compensated[0] * distance
    predicted = predict_flow_of_sample(ekf, params)
    variance = calc_opt_flow_meas_var(params, sample.quality)
    for axis in range(2):
        observation = flow.rate_compensated[axis]
        compute_flow_jacobian_at(ekf, axis, distance, flow.H[axis])
        innovation_variance = compute_innovation_variance(ekf, flow.H[axis], variance)
        set_axis(aid, axis, observation, variance, predicted[axis] - observation, innovation_variance)
    update_aid_source_status(ekf, aid, 2, sample.time_us, max(params.EKF2_OF_GATE, 1.0))


@kernel
def is_flow_required(ekf):
    """Whether in flight nothing but flow can hold the horizontal drift."""
    return ekf.cs.in_air and (
        ekf.cs.inertial_dead_reckoning or is_only_active_source_of_horizontal_aiding(ekf, ekf.cs.opt_flow)
    )


@kernel
def _use_flow(ekf, params):
    required, aid = is_flow_required(ekf), ekf.aid.optical_flow
    terrain_available = is_terrain_estimate_valid(ekf) or is_recent(
        ekf, ekf.aid.terrain_range_finder.time_last_fuse, TERRAIN_COAST_US
    )
    continuing = int(params.EKF2_OF_CTRL) == 1 and ekf.cs.tilt_align and (terrain_available or required)
    if ekf.cs.opt_flow:
        if not continuing:
            stop_flow_over_terrain(ekf)
            return
        fuse_flow_over_terrain(ekf, params)
        if is_timed_out(ekf, aid.time_last_fuse, NO_AID_TIMEOUT_MAX):
            if required:
                reset_to_flow(ekf, params)
            else:
                stop_flow_over_terrain(ekf)
    elif continuing and is_timed_out(ekf, aid.time_last_fuse, RESTART_INTERVAL_US):
        _start_flow(ekf, params)


@kernel
def _start_flow(ekf, params):
    """Fuse what agrees with other aiding; without any, set the velocity to the flow's."""
    if not is_horizontal_aiding_active(ekf):
        reset_to_flow(ekf, params)
        ekf.cs.opt_flow = True
    elif not ekf.aid.optical_flow.innovation_rejected:
        fuse_flow_over_terrain(ekf, params)
        ekf.cs.opt_flow = True


@kernel
def reset_to_flow(ekf, params):
    """Set the horizontal velocity to that of the sample and, on the ground, the position to the origin."""
    ekf.events.reset_vel_to_flow = True
    forward, right, R = ekf.flow.vel_body[0], ekf.flow.vel_body[1], ekf.R_to_earth
    variance = calc_opt_flow_meas_var(params, ekf.sensors.flow.sample.quality)
    north, east = R[0, 0] * forward + R[0, 1] * right, R[1, 0] * forward + R[1, 1] * right
    reset_horizontal_velocity_to(ekf, params, north, east, variance, variance)
    if not ekf.cs.in_air:
        reset_local_horizontal_position_to(ekf, params, 0.0, 0.0, 0.0, 0.0)
    judge_flow(ekf, params, ekf.aid.optical_flow)
    set_flow_rejection(ekf, False, False)
    ekf.aid.optical_flow.time_last_fuse = ekf.time_delayed_us


@kernel
def fuse_flow_over_terrain(ekf, params):
    """Fuse the judged flow, X before Y, both linearised where the first was."""
    aid, H = ekf.aid.optical_flow, ekf.flow.H
    noise = aid.observation_variance[0]
    if aid.innovation_variance[0] < noise or aid.innovation_variance[1] < noise:
        initialise_covariance(ekf, params)
        return
    set_flow_rejection(ekf, aid.test_ratio[0] > 1.0, aid.test_ratio[1] > 1.0)
    if aid.innovation_rejected:
        return
    compute_kalman_gain(ekf, H[0], aid.innovation_variance[0])
    fused_x = measurement_update(ekf, params, noise, aid.innovation[0])
    aid.innovation_variance[1] = compute_innovation_variance(ekf, H[1], noise)
    _, rate = predict_flow_of_sample(ekf, params)
    aid.innovation[1] = rate - aid.observation[1]
    if aid.innovation_variance[1] < noise:
        initialise_covariance(ekf, params)
        return
    compute_kalman_gain(ekf, H[1], aid.innovation_variance[1])
    fused_y = measurement_update(ekf, params, noise, aid.innovation[1])
    ekf.fs.bad_optflow_x = not fused_x
    ekf.fs.bad_optflow_y = not fused_y
    if fused_x and fused_y:
        aid.time_last_fuse = ekf.time_delayed_us
        aid.fused = True


@kernel
def stop_flow_over_terrain(ekf):
    """Leave optical flow."""
    if ekf.cs.opt_flow:
        ekf.cs.opt_flow = False
        forget_aid_source_status(ekf, ekf.aid.optical_flow, 2)
