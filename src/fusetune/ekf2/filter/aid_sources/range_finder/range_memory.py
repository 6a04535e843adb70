"""What the range finder aid source remembers between updates."""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import RANGE_SAMPLE

FOG_MEDIAN_WINDOW = 5

RANGE_MEMORY = np.dtype(
    [
        # the newest sample that reached the fusion time horizon; its range is corrected in place
        ("sample", RANGE_SAMPLE),
        ("sensor_min_distance", "f8"),
        ("sensor_max_distance", "f8"),
        ("cos_tilt", "f8"),
        # verdict on the sample
        ("is_sample_ready", "?"),
        ("is_sample_valid", "?"),
        ("is_regularly_sending_data", "?"),
        ("time_last_valid", "i8"),
        ("time_bad_quality", "i8"),
        ("dt_data_lpf", "f8"),
        # stuck and fog detectors
        ("is_stuck", "?"),
        ("stuck_min", "f8"),
        ("stuck_max", "f8"),
        ("is_blocked", "?"),
        ("recent_distances", "f8", (FOG_MEDIAN_WINDOW,)),
        ("next_recent", "i8"),
        ("median_distance", "f8"),
        # kinematic consistency
        ("kin_time_last_update", "i8"),
        ("kin_dist_bottom_prev", "f8"),
        ("kin_innovation", "f8"),
        ("kin_innovation_variance", "f8"),
        ("kin_test_ratio", "f8"),
        ("kin_signed_test_ratio_lpf", "f8"),
        ("kin_time_last_inconsistent", "i8"),
        ("kin_time_last_horizontal_motion", "i8"),
        ("is_kinematically_consistent", "?"),
    ],
    align=True,
)
"""Sub-record `ekf.range`: distances m, times µs."""


@kernel
def initialise_range_memory(rng):
    """Forget everything; a range finder is taken to be consistent until it proves otherwise."""
    rng.sample.time_us = 0
    rng.sample.range = 0.0
    rng.sample.quality = 0
    rng.sensor_min_distance = 0.0
    rng.sensor_max_distance = 0.0
    rng.cos_tilt = 1.0
    rng.is_sample_ready = False
    rng.is_sample_valid = False
    rng.is_regularly_sending_data = False
    rng.time_last_valid = 0
    rng.time_bad_quality = 0
    rng.dt_data_lpf = 0.0
    rng.is_stuck = False
    rng.stuck_min = 0.0
    rng.stuck_max = 0.0
    rng.is_blocked = False
    rng.recent_distances[:] = 0.0
    rng.next_recent = 0
    rng.median_distance = 0.0
    rng.kin_time_last_update = 0
    rng.kin_dist_bottom_prev = 0.0
    rng.kin_innovation = 0.0
    rng.kin_innovation_variance = 0.0
    rng.kin_test_ratio = 0.0
    rng.kin_signed_test_ratio_lpf = 0.0
    rng.kin_time_last_inconsistent = 0
    rng.kin_time_last_horizontal_motion = 0
    rng.is_kinematically_consistent = True


@kernel
def update_cos_tilt(rng, R_to_earth, pitch_offset):
    """Cosine of the angle between the beam and down, for a beam turned by `pitch_offset` (rad) about body y."""
    rng.cos_tilt = R_to_earth[2, 0] * math.sin(pitch_offset) + R_to_earth[2, 2] * math.cos(pitch_offset)


@kernel
def dist_bottom(rng):
    """Vertical part (m) of the measured distance."""
    return rng.sample.range * rng.cos_tilt


@kernel
def is_data_healthy(rng):
    """Whether a new sample is at hand and passed the checks."""
    return rng.is_sample_ready and rng.is_sample_valid
