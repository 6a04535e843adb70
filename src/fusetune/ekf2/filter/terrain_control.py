"""The terrain state where no sensor observes it, and when its estimate can be relied on.

Mirrors PX4 v1.16 `EKF/terrain_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_fusion import compute_hagl_variance
from fusetune.ekf2.filter.common.conditions import get_hagl
from fusetune.ekf2.filter.common.global_position import single_precision
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.common.state import TERRAIN
from fusetune.ekf2.filter.common.timing import HGT_FUSION_TIMEOUT_MAX, is_recent, is_timed_out
from fusetune.ekf2.filter.covariance import reset_covariance_block
from fusetune.ekf2.releases.by_release import by_release

NO_TERRAIN_AIDING_TIMEOUT = 1_000_000


@kernel
def init_terrain(ekf, params):
    """Put the terrain EKF2_MIN_RNG below the vehicle, as uncertain as that."""
    ekf.terrain = single_precision(params.EKF2_MIN_RNG - ekf.gpos_alt)
    reset_covariance_block(ekf, TERRAIN, 1, params.EKF2_MIN_RNG * params.EKF2_MIN_RNG)


@kernel
def _put_terrain_below(ekf, params):
    """On the ground the terrain is right below, unless a sensor says more; it starts there anew at take-off.

    With optical flow a distance taken too large makes the velocity too large, so take-off starts with a small one.
    """
    if not ekf.cs.in_air:
        ekf.last_on_ground_pos_d = -ekf.gpos_alt
        ekf.cs.rng_fault = False
        no_terrain_aiding = (
            not ekf.cs.rng_terrain
            and not ekf.cs.opt_flow_terrain
            and is_timed_out(ekf, ekf.time_last_terrain_fuse, NO_TERRAIN_AIDING_TIMEOUT)
        )
        if no_terrain_aiding and ekf.height_sensor_ref != HEIGHT_REF_RANGE:
            init_terrain(ekf, params)
    elif not ekf.cs_prev.in_air:
        init_terrain(ekf, params)


@kernel
def _leave_terrain(ekf, params):
    """The terrain has a filter of its own."""


control_terrain_fake_fusion = by_release(_put_terrain_below, "filters_terrain_apart", _leave_terrain)


@kernel
def _judge_terrain(ekf):
    """Set `ekf.terrain_valid`.

    It takes a range finder (or optical flow of small variance) to become valid, and a standard deviation below 10 %
    of the height above ground (at least 0.5 m) to stay valid.
    """
    by_flow = ekf.cs.opt_flow_terrain and is_recent(ekf, ekf.aid.optical_flow.time_last_fuse, HGT_FUSION_TIMEOUT_MAX)
    by_range = ekf.cs.rng_terrain and is_recent(ekf, ekf.aid.rng_hgt.time_last_fuse, HGT_FUSION_TIMEOUT_MAX)

    hagl = get_hagl(ekf)
    positive_variance = False
    small_variance = False
    if ekf.time_last_terrain_fuse != 0:
        variance = compute_hagl_variance(ekf)
        positive_variance = variance > 0.0
        small_variance = positive_variance and variance < max(0.1 * hagl, 0.5) ** 2

    if ekf.terrain_valid:
        ekf.terrain_valid = hagl >= 0.0 and small_variance
    else:
        ekf.terrain_valid = hagl >= 0.0 and positive_variance and (by_range or (by_flow and small_variance))


@kernel
def _judge_nothing(ekf):
    """Whether the terrain is known is found whenever that is asked."""


update_terrain_validity = by_release(_judge_terrain, "filters_terrain_apart", _judge_nothing)
