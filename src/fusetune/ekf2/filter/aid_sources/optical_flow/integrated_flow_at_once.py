"""Optical flow of v1.13: judged where it is fused, both axes from the covariance of before.

It starts with the first sample that may be used, which is fused at once. The bias of the sensor's gyro is put on the
flow, and not taken off the gyro.

Mirrors PX4 v1.13 `EKF/control.cpp`, `EKF/optflow_fusion.cpp` and the resets of `EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_over_terrain import (
    COS_MAX_TILT,
    judge_flow,
)
from fusetune.ekf2.filter.aid_sources.optical_flow.integrated_flow import (
    CLOSE_INTERVALS_S,
    DATA_STOPPED_US,
    LARGEST_INTERVAL_S,
    TERRAIN_COAST_US,
    add_rotation,
    follow_gyro_bias,
    forget_rotation,
    integrate_sample,
    is_flow_inhibited,
    publish_rates,
    take_imu_for_gyro,
    watch_motion,
)
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import calc_opt_flow_meas_var, set_flow_rejection
from fusetune.ekf2.filter.common.aid_mask import MASK_FLOW
from fusetune.ekf2.filter.common.conditions import get_hagl, is_other_source_of_horizontal_aiding_than
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_NONE
from fusetune.ekf2.filter.common.local_origin import remember_horizontal_position
from fusetune.ekf2.filter.common.state import ATTITUDE, ERROR_STATE_SIZE, POSITION, TERRAIN
from fusetune.ekf2.filter.common.timing import RESET_TIMEOUT_MAX, horizon_us, is_recent, is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import compute_kalman_gain, multiply_covariance, scale_kalman_gain
from fusetune.ekf2.filter.resets.state_resets import reset_horizontal_velocity_to, reset_local_horizontal_position_to
from fusetune.ekf2.numerics.constants import FLT_EPSILON

LONGEST_SUM_S = 1.0
LEAST_REACH = 0.3


@kernel
def control_flow_at_once(ekf, params):
    """Start, continue, reset or stop optical flow."""
    memory, terrain = ekf.flow_integrals, ekf.terrain_filter
    if not terrain.flow_is_good or (not ekf.cs.opt_flow and not terrain.uses_flow):
        terrain.flow_is_good = ekf.sensors.flow.data_ready
        if ekf.sensors.flow.data_ready:
            integrate_sample(ekf)
    watch_motion(ekf)
    add_rotation(ekf)
    if terrain.flow_is_good:
        _prepare_sample(ekf, params)
        publish_rates(ekf, memory)
    if terrain.flow_is_good:
        _use_flow(ekf, params)
    elif ekf.cs.opt_flow and horizon_us(ekf) > ekf.sensors.flow.sample.time_us + DATA_STOPPED_US:
        ekf.cs.opt_flow = False


@kernel
def _learn_gyro_bias(ekf):
    """Hold the sensor's gyro against the IMU, or take that for it; return whether either could be done."""
    memory = ekf.flow_integrals
    gyro, dt = memory.gyro, memory.sample_time
    comparable = memory.imu_time > FLT_EPSILON and dt > FLT_EPSILON
    available = False
    if memory.imu_time > LONGEST_SUM_S:
        available = False
    elif math.isfinite(gyro[0]) and math.isfinite(gyro[1]) and math.isfinite(gyro[2]):
        if comparable and abs(memory.imu_time - dt) < CLOSE_INTERVALS_S:
            follow_gyro_bias(memory)
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
    interval_good = least <= memory.sample_time <= min(1.3 * memory.imu_time, LARGEST_INTERVAL_S)
    good = (
        ekf.sensors.flow.sample.quality >= params.EKF2_OF_QMIN
        and not x * x + y * y > reach * reach
        and ekf.R_to_earth[2, 2] > COS_MAX_TILT
    )
    compensated = _learn_gyro_bias(ekf)
    gyro, rates, bias = memory.gyro, flow.rate_compensated, memory.gyro_bias
    if good and compensated and interval_good:
        rates[0] = (x - gyro[0]) / memory.sample_time + bias[0]
        rates[1] = (y - gyro[1]) / memory.sample_time + bias[1]
        return
    rates[0], rates[1] = bias[0], bias[1]
    if ekf.cs.in_air:
        ekf.terrain_filter.flow_is_good = False
        return
    if not interval_good:
        memory.sample_time = least
    if not compensated and not (math.isfinite(gyro[0]) and math.isfinite(gyro[1]) and math.isfinite(gyro[2])):
        gyro[0], gyro[1], gyro[2] = 0.0, 0.0, 0.0


@kernel
def _use_flow(ekf, params):
    enabled, inhibited = int(params.EKF2_AID_MASK) & MASK_FLOW != 0, is_flow_inhibited(ekf, params)
    if ekf.cs.opt_flow and (not enabled or inhibited):
        ekf.cs.opt_flow = False
        return
    knows_heading = ekf.cs.yaw_align or int(params.EKF2_MAG_TYPE) == MAG_TYPE_NONE
    if not ekf.cs.opt_flow and enabled and not inhibited and knows_heading:
        ekf.cs.opt_flow = True
        ekf.aid.optical_flow.time_last_fuse = ekf.time_delayed_us
        if not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.opt_flow):
            _reset_to_flow(ekf, params)
    if not ekf.cs.opt_flow:
        return
    if is_recent(ekf, ekf.aid.terrain_range_finder.time_last_fuse, TERRAIN_COAST_US):
        _fuse(ekf, params)
        remember_horizontal_position(ekf)
    ekf.terrain_filter.flow_is_good = False
    alone = not is_other_source_of_horizontal_aiding_than(ekf, ekf.cs.opt_flow)
    if alone and is_timed_out(ekf, ekf.aid.optical_flow.time_last_fuse, RESET_TIMEOUT_MAX):
        _reset_to_flow(ekf, params)


@kernel
def _reset_to_flow(ekf, params):
    """Set the velocity to the flow's, or to rest close to the ground, and the position to where it was last known."""
    ekf.events.reset_vel_to_flow = True
    reach = max(get_hagl(ekf), params.EKF2_MIN_RNG) / ekf.range.cos_tilt
    north, east = 0.0, 0.0
    if reach - params.EKF2_MIN_RNG > LEAST_REACH:
        rates, bias, R = ekf.flow.rate_compensated, ekf.flow_integrals.gyro_bias, ekf.R_to_earth
        forward, right = -reach * (rates[1] - bias[1]), reach * (rates[0] - bias[0])
        north, east = R[0, 0] * forward + R[0, 1] * right, R[1, 0] * forward + R[1, 1] * right
    variance = reach * reach * calc_opt_flow_meas_var(params, ekf.sensors.flow.sample.quality)
    reset_horizontal_velocity_to(ekf, params, north, east, variance, variance)
    ekf.events.reset_pos_to_last_known = True
    local = ekf.local
    if ekf.cs.in_air:
        reset_local_horizontal_position_to(ekf, params, local.last_known_north, local.last_known_east, 0.0, 0.0)
    else:
        reset_local_horizontal_position_to(ekf, params, 0.0, 0.0, 0.0, 0.0)


@kernel
def _fuse(ekf, params):
    """Judge and fuse both axes.

    The gains of attitude and velocity for the second axis are those of before the first, as PX4 computes them; the
    others follow its covariance.
    """
    aid, flow = ekf.aid.optical_flow, ekf.flow
    judge_flow(ekf, params, aid)
    noise = aid.observation_variance[0]
    if aid.innovation_variance[0] < noise or aid.innovation_variance[1] < noise:
        initialise_covariance(ekf, params)
        return
    set_flow_rejection(ekf, aid.test_ratio[0] > 1.0, aid.test_ratio[1] > 1.0)
    if aid.innovation_rejected:
        return
    before = ekf.quaternion.gains[1]
    multiply_covariance(ekf, flow.H[1])
    for i in range(ERROR_STATE_SIZE):
        before[i] = ekf.scratch.PH[i]
    compute_kalman_gain(ekf, flow.H[0], aid.innovation_variance[0])
    fused_x = measurement_update(ekf, params, noise, aid.innovation[0])
    multiply_covariance(ekf, flow.H[1])
    for i in range(ATTITUDE, POSITION):
        ekf.scratch.PH[i] = before[i]
    ekf.scratch.PH[TERRAIN] = before[TERRAIN]
    scale_kalman_gain(ekf, aid.innovation_variance[1])
    fused_y = measurement_update(ekf, params, noise, aid.innovation[1])
    ekf.fs.bad_optflow_x = not fused_x
    ekf.fs.bad_optflow_y = not fused_y
    aid.fused = fused_x and fused_y
    if fused_x or fused_y:
        aid.time_last_fuse = ekf.time_delayed_us
