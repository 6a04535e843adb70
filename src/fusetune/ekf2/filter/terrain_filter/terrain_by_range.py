"""The range finder corrects the terrain: innovation and gain are those of one state, h = terrain - p_z.

Mirrors PX4 v1.15 `EKF/terrain_estimator.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy
from fusetune.ekf2.filter.common.aid_source_status import (
    forget_aid_source_status,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import get_hagl
from fusetune.ekf2.filter.common.timing import RESET_TIMEOUT_MAX, horizon_us, is_timed_out

TERR_MASK_RANGE = 1
TERRAIN_RESET_TIMEOUT = 10_000_000
START_TEST_RATIO = 0.2


@kernel
def control_terrain_by_range(ekf, params):
    """Start, continue, reset or stop the range finder; a sensor at fault is not used."""
    rng, terrain = ekf.range, ekf.terrain_filter
    if not int(params.EKF2_TERR_MASK) & TERR_MASK_RANGE or ekf.cs.rng_fault:
        stop_terrain_by_range(ekf)
        return
    if rng.is_sample_ready:
        _judge(ekf, params)
    if is_data_healthy(rng):
        terrain.time_last_healthy_range = ekf.time_delayed_us
        _use_healthy_sample(ekf, params)
    elif terrain.uses_range and is_timed_out(ekf, terrain.time_last_healthy_range, RESET_TIMEOUT_MAX):
        stop_terrain_by_range(ekf)


@kernel
def _use_healthy_sample(ekf, params):
    rng, terrain, aid = ekf.range, ekf.terrain_filter, ekf.aid.terrain_range_finder
    consistent = rng.is_kinematically_consistent
    starting = consistent and rng.is_regularly_sending_data and rng.kin_test_ratio < 1.0
    if terrain.uses_range:
        if not consistent:
            stop_terrain_by_range(ekf)
            return
        correct_terrain(ekf)
        if is_timed_out(ekf, aid.time_last_fuse, TERRAIN_RESET_TIMEOUT) and not give_up_or_reset(ekf, params, starting):
            stop_terrain_by_range(ekf)
    elif starting:
        terrain.uses_range = True
        if terrain.uses_flow and aid.test_ratio[0] < START_TEST_RATIO:
            correct_terrain(ekf)
        else:
            reset_terrain_to_range(ekf, params)


@kernel
def give_up_or_reset(ekf, params, starting):
    """Take the distance over, and return whether; that of the sensor's own feet is no ground, if it is a good one."""
    if dist_bottom(ekf.range) > 2.0 * params.EKF2_MIN_RNG:
        reset_terrain_to_range(ekf, params)
        return True
    if starting:
        ekf.cs.rng_fault = True
        ekf.terrain_filter.range_is_faulty = True
    return False


@kernel
def range_variance(ekf, params):
    """Observation variance (m²): noise, and a part that grows with the distance."""
    scaled = params.EKF2_RNG_SFE * ekf.range.sample.range
    return params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE + scaled * scaled


@kernel
def _judge(ekf, params):
    measured, variance = dist_bottom(ekf.range), range_variance(ekf, params)
    aid = ekf.aid.terrain_range_finder
    innovation_variance = max(ekf.terrain_filter.variance + variance, variance)
    set_axis(aid, 0, measured, variance, get_hagl(ekf) - measured, innovation_variance)
    update_aid_source_status(ekf, aid, 1, horizon_us(ekf), max(params.EKF2_RNG_GATE, 1.0))


@kernel
def correct_terrain(ekf):
    """Fuse the judged distance unless it was rejected."""
    terrain, aid = ekf.terrain_filter, ekf.aid.terrain_range_finder
    ekf.reject.hagl = aid.innovation_rejected
    if aid.innovation_rejected:
        return
    gain = terrain.variance / aid.innovation_variance[0]
    ekf.terrain -= gain * aid.innovation[0]
    terrain.variance = max(terrain.variance * (1.0 - gain), 0.0)
    aid.time_last_fuse = ekf.time_delayed_us
    aid.fused = True


@kernel
def reset_terrain_to_range(ekf, params):
    """Put the terrain where the range finder sees it."""
    ekf.terrain = dist_bottom(ekf.range) - ekf.gpos_alt
    ekf.terrain_filter.variance = range_variance(ekf, params)
    ekf.aid.terrain_range_finder.time_last_fuse = ekf.time_delayed_us


@kernel
def stop_terrain_by_range(ekf):
    """Leave the range finder."""
    if ekf.terrain_filter.uses_range:
        forget_aid_source_status(ekf, ekf.aid.terrain_range_finder, 1)
        ekf.reject.hagl = False
        ekf.terrain_filter.uses_range = False
