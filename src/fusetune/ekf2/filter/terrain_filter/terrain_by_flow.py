"""Optical flow corrects the terrain while GNSS holds the velocity: the rate v R₂₂ / h tells how far the ground is.

PX4 takes the velocities along east and north for those along the body's axes, and corrects for both axes by the
innovation of the first.

Mirrors PX4 v1.15 `EKF/terrain_estimator.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_over_terrain import judge_flow, predict_flow_of_sample
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import set_flow_rejection
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import get_hagl
from fusetune.ekf2.numerics.constants import FLT_EPSILON

TERR_MASK_FLOW = 2
DATA_STOPPED_US = 5_000_000
UNKNOWN_TERRAIN_VARIANCE = 100.0
LEAST_VARIANCE = 0.01**2


@kernel
def control_terrain_by_flow(ekf, params):
    """Fuse flow that the main filter does not use, where GNSS aids in flight and no range finder sees the ground."""
    terrain = ekf.terrain_filter
    if not int(params.EKF2_TERR_MASK) & TERR_MASK_FLOW:
        stop_terrain_by_flow(ekf)
        return
    if terrain.flow_is_good:
        judge_flow(ekf, params, ekf.aid.terrain_optical_flow)
        cs = ekf.cs
        if cs.in_air and not cs.opt_flow and (cs.gnss_pos or cs.gnss_vel) and not terrain.uses_range:
            terrain.uses_flow = True
            _fuse(ekf, params)
        else:
            stop_terrain_by_flow(ekf)
        terrain.flow_is_good = False
    elif terrain.uses_flow and ekf.time_delayed_us > ekf.sensors.flow.sample.time_us + DATA_STOPPED_US:
        stop_terrain_by_flow(ekf)


@kernel
def _sensitivity(ekf, axis, hagl):
    """Derivative (rad/s/m) of the rate of an axis by the terrain, with PX4's signs."""
    distance = hagl + math.copysign(FLT_EPSILON, hagl)
    velocity = ekf.vel[1] if axis == 0 else -ekf.vel[0]
    return ekf.R_to_earth[2, 2] * velocity / (distance * distance)


@kernel
def _fuse(ekf, params):
    """Judge and fuse both axes, linearised where the first was."""
    terrain, aid = ekf.terrain_filter, ekf.aid.terrain_optical_flow
    hagl, noise = get_hagl(ekf), aid.observation_variance[0]
    aid.fused = True
    for axis in range(2):
        aid.innovation_variance[axis] = terrain.variance * _sensitivity(ekf, axis, hagl) ** 2 + noise
    if aid.innovation_variance[0] < noise or aid.innovation_variance[1] < noise:
        terrain.variance = UNKNOWN_TERRAIN_VARIANCE
        return
    update_aid_source_status(ekf, aid, 2, aid.timestamp_sample, max(params.EKF2_OF_GATE, 1.0))
    aid.fused = True
    set_flow_rejection(ekf, aid.test_ratio[0] > 1.0, aid.test_ratio[1] > 1.0)
    if aid.innovation_rejected:
        return
    for axis in range(2):
        by_terrain = _sensitivity(ekf, axis, hagl)
        if axis == 1:
            aid.innovation_variance[1] = terrain.variance * by_terrain * by_terrain + noise
            _, rate = predict_flow_of_sample(ekf, params)
            aid.innovation[1] = rate - aid.observation[1]
        gain = terrain.variance * by_terrain / aid.innovation_variance[axis]
        ekf.terrain = max(ekf.terrain + gain * aid.innovation[0], params.EKF2_MIN_RNG - ekf.gpos_alt)
        terrain.variance = max(terrain.variance * (1.0 - gain * by_terrain), LEAST_VARIANCE)
    ekf.fs.bad_optflow_x = False
    ekf.fs.bad_optflow_y = False
    aid.time_last_fuse = ekf.time_delayed_us


@kernel
def stop_terrain_by_flow(ekf):
    """Leave optical flow."""
    if ekf.terrain_filter.uses_flow:
        ekf.terrain_filter.uses_flow = False
        forget_aid_source_status(ekf, ekf.aid.terrain_optical_flow, 2)
