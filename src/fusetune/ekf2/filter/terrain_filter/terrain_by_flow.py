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
from fusetune.ekf2.filter.common.conditions import TERRAIN_TIMEOUT, get_hagl
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release

TERR_MASK_FLOW = 2
DATA_STOPPED_US = 5_000_000
UNKNOWN_TERRAIN_VARIANCE = 100.0
LEAST_VARIANCE = 0.01**2


@kernel
def _does_range_correct(ekf):
    return ekf.terrain_filter.uses_range


@kernel
def _did_range_correct(ekf):
    """Within 5 s."""
    return not is_timed_out(ekf, ekf.aid.terrain_range_finder.time_last_fuse, TERRAIN_TIMEOUT)


_is_seen_by_range = by_release(_does_range_correct, "sees_terrain_in_air", _did_range_correct)


@kernel
def _is_done(ekf, used):
    return False


@kernel
def _waits_if_unused(ekf, used):
    """What nothing has used is there at the next update, too, unless another sample comes."""
    return not used


_is_sample_kept = by_release(_is_done, "integrates_flow", _waits_if_unused)


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
        used = cs.in_air and not cs.opt_flow and (cs.gnss_pos or cs.gnss_vel) and not _is_seen_by_range(ekf)
        if used:
            terrain.uses_flow = True
            _fuse(ekf, params)
        else:
            stop_terrain_by_flow(ekf)
        terrain.flow_is_good = _is_sample_kept(ekf, used)
    elif terrain.uses_flow and ekf.time_delayed_us > ekf.sensors.flow.sample.time_us + DATA_STOPPED_US:
        stop_terrain_by_flow(ekf)


@kernel
def _sensitivity(ekf, axis, hagl):
    """Derivative (rad/s/m) of the rate of an axis by the terrain, with PX4's signs."""
    distance = hagl + math.copysign(FLT_EPSILON, hagl)
    velocity = ekf.vel[1] if axis == 0 else -ekf.vel[0]
    return ekf.R_to_earth[2, 2] * velocity / (distance * distance)


@kernel
def _tells_tried(ekf):
    return True


@kernel
def _tells_nothing(ekf):
    return False


_is_tried_told = by_release(_tells_tried, "integrates_flow", _tells_nothing)
"""Whether what was tried to be fused is told as fused."""


@kernel
def _fuse(ekf, params):
    """Judge and fuse both axes, linearised where the first was."""
    terrain, aid = ekf.terrain_filter, ekf.aid.terrain_optical_flow
    hagl, noise = get_hagl(ekf), aid.observation_variance[0]
    aid.fused = _is_tried_told(ekf)
    for axis in range(2):
        aid.innovation_variance[axis] = terrain.variance * _sensitivity(ekf, axis, hagl) ** 2 + noise
    if aid.innovation_variance[0] < noise or aid.innovation_variance[1] < noise:
        terrain.variance = UNKNOWN_TERRAIN_VARIANCE
        return
    update_aid_source_status(ekf, aid, 2, aid.timestamp_sample, max(params.EKF2_OF_GATE, 1.0))
    aid.fused = _is_tried_told(ekf)
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
    _tell_main_status(ekf)


@kernel
def _tell_own_status_alone(ekf):
    """v1.15 tells the flow of the terrain alone as fused."""


@kernel
def _tell_as_fused(ekf):
    """PX4 v1.14 says so of the main filter's flow, too."""
    ekf.aid.optical_flow.fused = True


_tell_main_status = by_release(_tell_own_status_alone, "integrates_flow", _tell_as_fused)


@kernel
def stop_terrain_by_flow(ekf):
    """Leave optical flow."""
    if ekf.terrain_filter.uses_flow:
        ekf.terrain_filter.uses_flow = False
        forget_aid_source_status(ekf, ekf.aid.terrain_optical_flow, 2)
