"""Height of the terrain as a filter of one state: a random walk that is steeper the faster the vehicle flies.

Range finder and optical flow correct it, each by way of the vehicle's height, which is taken as known. It runs after
the main filter, whose position and velocity it reads.

Mirrors PX4 v1.15 `EKF/terrain_estimator.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import TERRAIN_TIMEOUT
from fusetune.ekf2.filter.common.timing import is_recent
from fusetune.ekf2.filter.terrain_filter.terrain_by_flow import control_terrain_by_flow, stop_terrain_by_flow
from fusetune.ekf2.filter.terrain_filter.terrain_by_flow_axes import control_terrain_by_flow_axes
from fusetune.ekf2.filter.terrain_filter.terrain_by_range import control_terrain_by_range
from fusetune.ekf2.filter.terrain_filter.terrain_in_air import control_terrain_in_air, stop_terrain_in_air
from fusetune.ekf2.releases.by_release import by_release

LARGEST_VARIANCE = 1e4
NO_TERRAIN_AIDING_TIMEOUT = 1_000_000


@kernel
def _nothing_to_start(ekf, params):
    """v1.16 has the terrain in its state."""


@kernel
def _count_as_aided(ekf):
    ekf.aid.terrain_range_finder.time_last_fuse = ekf.time_delayed_us
    ekf.aid.terrain_optical_flow.time_last_fuse = ekf.time_delayed_us


@kernel
def _stop_aiding(ekf):
    """Where the ground is known without them, the sensors are left."""
    stop_terrain_by_flow(ekf)
    stop_terrain_in_air(ekf)


@kernel
def _count_range_as_aided(ekf):
    ekf.aid.terrain_range_finder.time_last_fuse = ekf.time_delayed_us


_note_ground = by_release(
    by_release(_count_as_aided, "sees_terrain_in_air", _stop_aiding), "keeps_terrain_known", _count_range_as_aided
)


@kernel
def _put_terrain_below(ekf, params):
    """Take the vehicle to stand on the ground, as uncertain as the clearance that it has there."""
    _note_ground(ekf)
    ekf.terrain = params.EKF2_MIN_RNG - ekf.gpos_alt
    ekf.terrain_filter.variance = params.EKF2_MIN_RNG * params.EKF2_MIN_RNG


start_terrain_filter = by_release(_nothing_to_start, "filters_terrain_apart", _put_terrain_below)


@kernel
def _start_at_take_off(ekf, params):
    """A distance taken too large makes the velocity by flow too large."""
    if not ekf.cs_prev.in_air:
        _put_terrain_below(ekf, params)


@kernel
def _go_on_at_take_off(ekf, params):
    """On the ground it was there anyway."""


_take_off = by_release(_start_at_take_off, "sees_terrain_in_air", _go_on_at_take_off)
_control_by_flow = by_release(control_terrain_by_flow, "keeps_terrain_known", control_terrain_by_flow_axes)
_control_by_range = by_release(control_terrain_by_range, "sees_terrain_in_air", control_terrain_in_air)


@kernel
def _nothing_to_run(ekf, params):
    """v1.16 has the terrain in its state."""


@kernel
def _run_beside_main_filter(ekf, params):
    """Predict the terrain and correct it by what there is; it starts anew at take-off, and lies below the vehicle."""
    if not ekf.cs.in_air:
        ekf.last_on_ground_pos_d = -ekf.gpos_alt
        ekf.cs.rng_fault = False
    else:
        _take_off(ekf, params)
    _predict(ekf, params)
    _control_by_range(ekf, params)
    _control_by_flow(ekf, params)
    _hold_on_ground(ekf, params)
    ekf.terrain = max(ekf.terrain, params.EKF2_MIN_RNG - ekf.gpos_alt)
    _note_validity(ekf)


run_terrain_filter = by_release(_nothing_to_run, "filters_terrain_apart", _run_beside_main_filter)


@kernel
def _predict(ekf, params):
    """Let the variance grow: by the vehicle's own height error, and by the slope that it flies over."""
    terrain, dt = ekf.terrain_filter, ekf.imu_delayed.delta_vel_dt
    speed_squared = ekf.vel[0] * ekf.vel[0] + ekf.vel[1] * ekf.vel[1]
    grown = terrain.variance + (dt * params.EKF2_TERR_NOISE) ** 2 + (dt * params.EKF2_TERR_GRAD) ** 2 * speed_squared
    terrain.variance = min(max(grown, 0.0), LARGEST_VARIANCE)


@kernel
def _is_unaided(ekf):
    """At rest, or no sensor has told of the terrain for a second."""
    aid = ekf.aid
    recently_aided = is_recent(ekf, aid.terrain_range_finder.time_last_fuse, NO_TERRAIN_AIDING_TIMEOUT) or is_recent(
        ekf, aid.terrain_optical_flow.time_last_fuse, NO_TERRAIN_AIDING_TIMEOUT
    )
    return ekf.cs.vehicle_at_rest or not recently_aided


@kernel
def _always(ekf):
    return True


_may_hold = by_release(_is_unaided, "sees_terrain_in_air", _always)


@kernel
def _hold_on_ground(ekf, params):
    """On the ground the terrain is right below, where no sensor says more."""
    terrain = ekf.terrain_filter
    if not ekf.cs.in_air and not terrain.uses_range and not terrain.uses_flow and _may_hold(ekf):
        _put_terrain_below(ekf, params)


@kernel
def _note_nothing(ekf):
    """Whether the terrain is known is found whenever that is asked."""


@kernel
def _note_recent_aiding(ekf):
    """Whether anything has told of the terrain within 5 s, used still or not."""
    aid = ekf.aid
    ekf.terrain_valid = is_recent(ekf, aid.terrain_range_finder.time_last_fuse, TERRAIN_TIMEOUT) or is_recent(
        ekf, aid.terrain_optical_flow.time_last_fuse, TERRAIN_TIMEOUT
    )


_note_validity = by_release(_note_nothing, "keeps_terrain_known", _note_recent_aiding)
