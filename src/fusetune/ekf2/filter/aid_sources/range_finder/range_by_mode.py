"""The range finder of v1.13 as the one source of height: always by EKF2_HGT_MODE, or low and slow by EKF2_RNG_AID.

There is no bias: while it aids low and slow, an offset keeps what it measures at the height that was known before.

Mirrors `checkRangeAidSuitability` and the start of `controlFusionModes` of PX4 v1.13 `EKF/control.cpp`, `fuseRngHgt` of
`EKF/height_fusion.cpp`, and `resetHeightToRng` of `EKF/ekf_helper.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_control import (
    START_HYSTERESIS,
    START_TEST_RATIO,
    check_range_sensor,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy
from fusetune.ekf2.filter.common.conditions import get_hagl, is_horizontal_aiding_active, is_terrain_estimate_valid
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to
from fusetune.ekf2.releases.by_release import by_release

LEAST_HEIGHT_VARIANCE = 0.01

RANGE_BY_MODE = np.dtype([("offset", "f8"), ("is_suitable", "?")], align=True)
"""Sub-record `ekf.range_by_mode`: down position (m) that is added to what the source of height measures, which GNSS
shares, too; whether the vehicle flies low and slow enough over steady ground."""


@kernel
def _look_later(ekf, params):
    """Since v1.14 the sensor is looked at where heights are fused."""


@kernel
def _look_at_range(ekf, params):
    if ekf.sensors.range.exists:
        check_range_sensor(ekf, params)


look_at_range_first = by_release(_look_later, "looks_at_range_first", _look_at_range)
"""Run the sensor's checks at the begin of an update."""


@kernel
def may_range_aid(ekf, params):
    """Whether the vehicle flies so low and slow that range is to give the height; to be asked once an update.

    Starting takes 70 % of EKF2_RNG_A_HMAX and EKF2_RNG_A_VMAX, and a test ratio a hundred times smaller. The ratio is
    the terrain's, with the gate EKF2_RNG_A_IGATE.
    """
    memory = ekf.range_by_mode
    memory.is_suitable = (
        ekf.cs.in_air
        and ekf.range.is_sample_valid
        and is_terrain_estimate_valid(ekf)
        and _is_low_and_slow(ekf, params, memory.is_suitable)
    )
    return memory.is_suitable and int(params.EKF2_RNG_AID) == 1


@kernel
def _is_low_and_slow(ekf, params, was_suitable):
    aid, gate = ekf.aid.terrain_range_finder, params.EKF2_RNG_A_IGATE
    scale, ratio_max = START_HYSTERESIS, START_TEST_RATIO
    if was_suitable:
        scale, ratio_max = 1.0, 1.0
    innovation_squared = aid.innovation[0] * aid.innovation[0]
    if not innovation_squared < ratio_max * gate * gate * aid.innovation_variance[0]:
        return False
    if not get_hagl(ekf) < scale * params.EKF2_RNG_A_HMAX:
        return False
    if is_horizontal_aiding_active(ekf):
        return math.hypot(ekf.vel[0], ekf.vel[1]) <= scale * params.EKF2_RNG_A_VMAX
    return True


@kernel
def assume_range_on_ground(ekf, params):
    """On the ground a regular sample that is not usable is taken for EKF2_MIN_RNG."""
    rng = ekf.range
    if not ekf.cs.in_air and not is_data_healthy(rng) and rng.is_regularly_sending_data and rng.is_sample_ready:
        rng.sample.range = params.EKF2_MIN_RNG
        rng.is_sample_valid = True


@kernel
def fuse_range_height(ekf, params):
    """Judge the distance as a height above what `ekf.range_by_mode.offset` says, and fuse it."""
    rng = ekf.range
    scaled = params.EKF2_RNG_SFE * dist_bottom(rng)
    update_vertical_position_aid_status(
        ekf,
        ekf.aid.rng_hgt,
        rng.sample.time_us,
        ekf.range_by_mode.offset - max(dist_bottom(rng), params.EKF2_MIN_RNG),
        max(params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE + scaled * scaled, LEAST_HEIGHT_VARIANCE),
        max(params.EKF2_RNG_GATE, 1.0),
    )
    fuse_vertical_position(ekf, params, ekf.aid.rng_hgt)


@kernel
def reset_height_to_range(ekf, params):
    """Take the height from the distance; on the ground it is EKF2_MIN_RNG."""
    distance = dist_bottom(ekf.range) if ekf.cs.in_air else params.EKF2_MIN_RNG
    ekf.events.reset_hgt_to_rng = True
    variance = params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE
    reset_altitude_to(ekf, params, distance - ekf.range_by_mode.offset, variance)
