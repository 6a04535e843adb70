"""The range finder corrects the terrain in the air alone, where it starts with the distance that it sees.

What it found last is kept in the status of `terrain_range_finder`, of which these releases publish nothing.

Mirrors PX4 v1.14 `EKF/terrain_estimator.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import get_hagl
from fusetune.ekf2.filter.common.timing import RESET_TIMEOUT_MAX, is_timed_out
from fusetune.ekf2.filter.terrain_filter.terrain_by_range import (
    START_TEST_RATIO,
    TERR_MASK_RANGE,
    TERRAIN_RESET_TIMEOUT,
    correct_terrain,
    give_up_or_reset,
    range_variance,
    reset_terrain_to_range,
)
from fusetune.ekf2.releases.by_release import by_release

NEVER_PUBLISHED = 0


@kernel
def control_terrain_in_air(ekf, params):
    """Start, continue, reset or stop the range finder; a sensor at fault is not used."""
    rng, terrain = ekf.range, ekf.terrain_filter
    if not int(params.EKF2_TERR_MASK) & TERR_MASK_RANGE or ekf.cs.rng_fault:
        stop_terrain_in_air(ekf)
        return
    if is_data_healthy(rng):
        terrain.time_last_healthy_range = ekf.time_delayed_us
        _use_healthy_sample(ekf, params)
    elif terrain.uses_range and is_timed_out(ekf, terrain.time_last_healthy_range, RESET_TIMEOUT_MAX):
        stop_terrain_in_air(ekf)


@kernel
def _use_healthy_sample(ekf, params):
    rng, terrain, aid = ekf.range, ekf.terrain_filter, ekf.aid.terrain_range_finder
    continuing = ekf.cs.in_air and rng.is_kinematically_consistent
    starting = continuing and rng.is_regularly_sending_data and rng.kin_test_ratio < 1.0
    if terrain.uses_range:
        if not continuing:
            stop_terrain_in_air(ekf)
            return
        _judge(ekf, params)
        correct_terrain(ekf)
        if is_timed_out(ekf, aid.time_last_fuse, TERRAIN_RESET_TIMEOUT) and not give_up_or_reset(ekf, params, starting):
            stop_terrain_in_air(ekf)
    elif starting:
        terrain.uses_range = True
        if terrain.uses_flow and _agrees(ekf, params):
            _judge(ekf, params)
            correct_terrain(ekf)
        else:
            reset_terrain_to_range(ekf, params)


@kernel
def _agrees(ekf, params):
    """Whether the distance is near enough to what flow has found to be fused."""
    variance, gate = range_variance(ekf, params), max(params.EKF2_RNG_GATE, 1.0)
    innovation = get_hagl(ekf) - dist_bottom(ekf.range)
    innovation_variance = max(ekf.terrain_filter.variance + variance, variance)
    return innovation * innovation <= START_TEST_RATIO * gate * gate * innovation_variance


@kernel
def _judge(ekf, params):
    measured, variance, aid = dist_bottom(ekf.range), range_variance(ekf, params), ekf.aid.terrain_range_finder
    innovation_variance = max(ekf.terrain_filter.variance + variance, variance)
    set_axis(aid, 0, measured, variance, get_hagl(ekf) - measured, innovation_variance)
    update_aid_source_status(ekf, aid, 1, _time_of_row(ekf), max(params.EKF2_RNG_GATE, 1.0))


@kernel
def _never(ekf):
    return NEVER_PUBLISHED


@kernel
def _measured(ekf):
    return ekf.range.sample.time_us


_time_of_row = by_release(_never, "keeps_terrain_known", _measured)
"""PX4 v1.14 publishes nothing of the range finder; of v1.13 the figures are those of its fusion."""


@kernel
def _forget_agreement(ekf):
    aid = ekf.aid.terrain_range_finder
    aid.innovation[0] = 0.0
    aid.innovation_variance[0] = 0.0
    aid.test_ratio[0] = 0.0
    ekf.reject.hagl = False


@kernel
def _keep_agreement(ekf):
    """What was found last stands."""


_leave_agreement = by_release(_forget_agreement, "keeps_terrain_known", _keep_agreement)


@kernel
def stop_terrain_in_air(ekf):
    """Leave the range finder."""
    if ekf.terrain_filter.uses_range:
        _leave_agreement(ekf)
        ekf.terrain_filter.uses_range = False
    ekf.terrain_filter.time_last_healthy_range = 0
