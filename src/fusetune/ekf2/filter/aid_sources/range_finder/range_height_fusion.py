"""Fusion of height above ground: h = terrain - p_z (both down), so H is -1 at the height and +1 at the terrain.

Mirrors PX4 v1.16 `EKF/aid_sources/range_finder/range_height_fusion.cpp`, and `updateRangeHagl` and
`resetTerrainToRng` of `range_height_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy
from fusetune.ekf2.filter.common.aid_source_status import (
    reset_aid_source_status_zero_innovation,
    set_axis,
    update_aid_source_status,
)
from fusetune.ekf2.filter.common.conditions import get_hagl
from fusetune.ekf2.filter.common.state import POSITION, TERRAIN
from fusetune.ekf2.filter.covariance import reset_covariance_block
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import compute_kalman_gain, multiply_covariance
from fusetune.ekf2.filter.resets.state_resets import update_terrain_reset_status
from fusetune.ekf2.releases.by_release import by_release

HEIGHT = POSITION + 2


@kernel
def compute_hagl_h(H):
    """Write the observation Jacobian of height above ground into H (24,)."""
    H[:] = 0.0
    H[HEIGHT] = -1.0
    H[TERRAIN] = 1.0


@kernel
def compute_hagl_variance(ekf):
    """Variance (m²) of the estimated height above ground."""
    P = ekf.P
    return P[HEIGHT, HEIGHT] - P[HEIGHT, TERRAIN] - P[TERRAIN, HEIGHT] + P[TERRAIN, TERRAIN]


@kernel
def get_range_variance(ekf, params):
    """Observation variance (m²): noise, a part that grows with range, and the height's own variance."""
    scaled = params.EKF2_RNG_SFE * ekf.range.sample.range
    return max(ekf.P[HEIGHT, HEIGHT] + params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE + scaled * scaled, 0.0)


@kernel
def _any_sample(ekf):
    return True


@kernel
def _healthy_sample(ekf):
    aid = ekf.aid.rng_hgt
    finite = math.isfinite(aid.observation[0]) and math.isfinite(aid.observation_variance[0])
    return finite and is_data_healthy(ekf.range)


_may_be_limited = by_release(_any_sample, "skips_unhealthy_range", _healthy_sample)


@kernel
def update_range_hagl(ekf, params):
    """Judge the distance to ground.

    While the vertical acceleration is bad the innovation is limited to the gate rather than rejected.
    """
    aid = ekf.aid.rng_hgt
    measurement = max(dist_bottom(ekf.range), params.EKF2_MIN_RNG)
    variance = get_range_variance(ekf, params)
    innovation_variance = compute_hagl_variance(ekf) + variance
    gate = max(params.EKF2_RNG_GATE, 1.0)
    set_axis(aid, 0, measurement, variance, get_hagl(ekf) - measurement, innovation_variance)
    update_aid_source_status(ekf, aid, 1, ekf.range.sample.time_us, gate)
    if ekf.fs.bad_acc_vertical and aid.innovation_rejected and _may_be_limited(ekf):
        limit = gate * math.sqrt(innovation_variance)
        aid.innovation[0] = min(max(aid.innovation[0], -limit), limit)
        aid.innovation_rejected = False


@kernel
def fuse_hagl_rng(ekf, params, update_height, update_terrain):
    """Fuse the judged distance into the terrain, into everything else (height), or both; return whether fused."""
    aid = ekf.aid.rng_hgt
    if aid.innovation_rejected:
        ekf.reject.hagl = True
        return False

    H, K = ekf.scratch.H, ekf.scratch.K
    compute_hagl_h(H)
    compute_kalman_gain(ekf, H, aid.innovation_variance[0])
    k_terrain = K[TERRAIN] if update_terrain else 0.0
    if not update_height:
        K[:] = 0.0
    K[TERRAIN] = k_terrain
    measurement_update(ekf, params, aid.observation_variance[0], aid.innovation[0])

    ekf.reject.hagl = False
    aid.time_last_fuse = ekf.time_delayed_us
    aid.fused = True
    if update_terrain:
        ekf.time_last_terrain_fuse = ekf.time_delayed_us
    return True


@kernel
def reset_terrain_to_rng(ekf, params):
    """Put the whole innovation into the terrain.

    The distance observes the terrain by way of the height, so the terrain must take over the height's uncertainty and
    be correlated with it: an update of a terrain without variance, with a gain of one, does just that.
    """
    aid = ekf.aid.rng_hgt
    reset_covariance_block(ekf, TERRAIN, 1, 0.0)
    old_terrain = ekf.terrain
    H, K = ekf.scratch.H, ekf.scratch.K
    compute_hagl_h(H)
    multiply_covariance(ekf, H)
    K[:] = 0.0
    K[TERRAIN] = 1.0
    measurement_update(ekf, params, aid.observation_variance[0], aid.innovation[0])
    update_terrain_reset_status(ekf, ekf.terrain - old_terrain)
    reset_aid_source_status_zero_innovation(ekf, aid, 1)
