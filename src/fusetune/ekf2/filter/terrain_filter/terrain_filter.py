"""Height of the terrain as a filter of one state: a random walk that is steeper the faster the vehicle flies.

Range finder and optical flow correct it, each by way of the vehicle's height, which is taken as known. It runs after
the main filter, whose position and velocity it reads.

Mirrors PX4 v1.15 `EKF/terrain_estimator.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.timing import is_recent
from fusetune.ekf2.filter.terrain_filter.terrain_by_flow import control_terrain_by_flow
from fusetune.ekf2.filter.terrain_filter.terrain_by_range import control_terrain_by_range
from fusetune.ekf2.releases.by_release import by_release

LARGEST_VARIANCE = 1e4
NO_TERRAIN_AIDING_TIMEOUT = 1_000_000


@kernel
def _nothing_to_start(ekf, params):
    """v1.16 has the terrain in its state."""


@kernel
def _put_terrain_below(ekf, params):
    """Take the vehicle to stand on the ground, as uncertain as the clearance that it has there."""
    ekf.terrain = params.EKF2_MIN_RNG - ekf.gpos_alt
    ekf.terrain_filter.variance = params.EKF2_MIN_RNG * params.EKF2_MIN_RNG
    ekf.aid.terrain_range_finder.time_last_fuse = ekf.time_delayed_us
    ekf.aid.terrain_optical_flow.time_last_fuse = ekf.time_delayed_us


start_terrain_filter = by_release(_nothing_to_start, "filters_terrain_apart", _put_terrain_below)


@kernel
def _nothing_to_run(ekf, params):
    """v1.16 has the terrain in its state."""


@kernel
def _run_beside_main_filter(ekf, params):
    """Predict the terrain and correct it by what there is; it starts anew at take-off, and lies below the vehicle."""
    if not ekf.cs.in_air:
        ekf.last_on_ground_pos_d = -ekf.gpos_alt
        ekf.cs.rng_fault = False
    elif not ekf.cs_prev.in_air:
        _put_terrain_below(ekf, params)
    _predict(ekf, params)
    control_terrain_by_range(ekf, params)
    control_terrain_by_flow(ekf, params)
    _hold_on_ground(ekf, params)
    ekf.terrain = max(ekf.terrain, params.EKF2_MIN_RNG - ekf.gpos_alt)


run_terrain_filter = by_release(_nothing_to_run, "filters_terrain_apart", _run_beside_main_filter)


@kernel
def _predict(ekf, params):
    """Let the variance grow: by the vehicle's own height error, and by the slope that it flies over."""
    terrain, dt = ekf.terrain_filter, ekf.imu_delayed.delta_vel_dt
    speed_squared = ekf.vel[0] * ekf.vel[0] + ekf.vel[1] * ekf.vel[1]
    grown = terrain.variance + (dt * params.EKF2_TERR_NOISE) ** 2 + (dt * params.EKF2_TERR_GRAD) ** 2 * speed_squared
    terrain.variance = min(max(grown, 0.0), LARGEST_VARIANCE)


@kernel
def _hold_on_ground(ekf, params):
    """On the ground the terrain is right below, at rest or where no sensor has said more for a second."""
    terrain, aid = ekf.terrain_filter, ekf.aid
    if ekf.cs.in_air or terrain.uses_range or terrain.uses_flow:
        return
    recently_aided = is_recent(ekf, aid.terrain_range_finder.time_last_fuse, NO_TERRAIN_AIDING_TIMEOUT) or is_recent(
        ekf, aid.terrain_optical_flow.time_last_fuse, NO_TERRAIN_AIDING_TIMEOUT
    )
    if ekf.cs.vehicle_at_rest or not recently_aided:
        _put_terrain_below(ekf, params)
