"""Can the range finder's sample be used: regular, of good quality, not tilted too far, in range, not stuck, no fog."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import FOG_MEDIAN_WINDOW, dist_bottom
from fusetune.ekf2.filter.common.timing import RNG_MAX_INTERVAL

COS_MAX_TILT = 0.7071
DT_LPF_ALPHA = 0.5 * 0.01
DT_LPF_MAX = 4e6
DT_CONTINUOUS_MAX = 2e6
STUCK_AFTER_INVALID_TIME = 10_000_000
STUCK_THRESHOLD = 0.1
STUCK_MIN_UNSET = 0.1
FOG_FACTOR = 2.0


@kernel
def run_range_sensor_checks(rng, time_us, quality_hysteresis_s, fog_distance):
    """Update the verdict on the range finder's sample.

    Parameters
    ----------
    rng : RANGE_MEMORY record with `cos_tilt` updated
    time_us : fusion time horizon (µs)
    quality_hysteresis_s : time (s) for which the quality must not have been 0
    fog_distance : longest distance (m) at which fog or dirt can block the beam; 0 switches the check off
    """
    rng.dt_data_lpf += DT_LPF_ALPHA * (float(time_us - rng.sample.time_us) - rng.dt_data_lpf)
    rng.dt_data_lpf = min(rng.dt_data_lpf, DT_LPF_MAX)

    is_out_of_date = time_us - rng.sample.time_us > 2 * RNG_MAX_INTERVAL
    if is_out_of_date or not rng.dt_data_lpf < DT_CONTINUOUS_MAX:
        rng.is_sample_valid = False
        rng.is_regularly_sending_data = False
        return
    rng.is_regularly_sending_data = True
    if not rng.is_sample_ready:
        return

    rng.is_sample_valid = False
    if rng.sample.quality == 0:
        rng.time_bad_quality = time_us
    is_quality_ok = time_us - rng.time_bad_quality > int(quality_hysteresis_s * 1e6)
    is_in_range = rng.sensor_min_distance <= rng.sample.range <= rng.sensor_max_distance
    if not is_quality_ok or not rng.cos_tilt > COS_MAX_TILT or not is_in_range:
        return

    update_stuck_check(rng)
    update_fog_check(rng, fog_distance)
    if not rng.is_stuck and not rng.is_blocked:
        rng.is_sample_valid = True
        rng.time_last_valid = rng.sample.time_us


@kernel
def update_stuck_check(rng):
    """After 10 s without a valid sample, the distance must vary by more than 0.1 m before it is trusted again."""
    if rng.sample.time_us - rng.time_last_valid <= STUCK_AFTER_INVALID_TIME:
        return
    if rng.stuck_max - rng.stuck_min > STUCK_THRESHOLD:
        rng.stuck_min = 0.0
        rng.stuck_max = 0.0
        rng.is_stuck = False
        return
    rng.stuck_max = max(rng.stuck_max, rng.sample.range)
    if rng.stuck_min < STUCK_MIN_UNSET or rng.sample.range < rng.stuck_min:
        rng.stuck_min = rng.sample.range
    rng.is_stuck = True


@kernel
def update_fog_check(rng, fog_distance):
    """The beam is blocked when the median of five distances drops by more than twice the fog distance to below it.

    It is free again once the median exceeds twice the fog distance.
    """
    if fog_distance <= 0.0:
        return
    rng.recent_distances[rng.next_recent] = dist_bottom(rng)
    rng.next_recent = (rng.next_recent + 1) % FOG_MEDIAN_WINDOW
    median = _median(rng.recent_distances)
    if not rng.is_blocked:
        drop = rng.median_distance - median
        rng.is_blocked = median < fog_distance and drop > FOG_FACTOR * fog_distance
    elif median > FOG_FACTOR * fog_distance:
        rng.is_blocked = False
    rng.median_distance = median


@kernel
def _median(values):
    """The value of an odd number of them that as many are below as above."""
    half = len(values) // 2
    for candidate in values:
        below, equal = 0, 0
        for value in values:
            below += value < candidate
            equal += value == candidate
        if below <= half < below + equal:
            return candidate
    return math.nan
