"""Range finder (`distance_sensor`): the distance to flat ground along the body's down axis, and what is in its way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.noise import random_stream
from fusetune.execute.sensors.faults import Fault, RangeObstruction, RangeStep, of_kind
from fusetune.execute.sensors.mounted import distance_to_ground
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import RangeFinder
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

DEVICE_ID = 9764866
LASER, DOWNWARD_FACING = 0, 25
GOOD_QUALITY, NO_ECHO = 100, 0


def distance_sensor(truth: Truth, sensor: RangeFinder, faults: Sequence[Fault], seed: int) -> TopicTable:
    """Range finder samples in the layout of PX4's topic, `timestamp` being the time of publication.

    Beyond the longest distance the sensor has no echo: it reports that distance and a quality of 0.
    """
    rng = random_stream(seed, "range finder")
    sampled_us = sample_times(truth, sensor.rate_hz, rng)
    after_takeoff_s = sampled_us * 1e-6 - truth.events.takeoff_s
    distance, cos_tilt = distance_to_ground(truth, sampled_us, sensor.position_m, sensor.ground_distance_m)
    for step in of_kind(faults, RangeStep):
        distance = distance - step.height_m * step.holds(after_takeoff_s) / np.maximum(cos_tilt, 0.1)
    deviation = np.hypot(sensor.noise_m, sensor.noise_share * np.minimum(distance, sensor.maximum_m))
    reading = distance + deviation * rng.standard_normal(len(sampled_us))
    no_echo = reading > sensor.maximum_m
    for obstruction in of_kind(faults, RangeObstruction):
        hit = random_stream(seed, "range obstruction").random(len(sampled_us)) < obstruction.share
        hit &= obstruction.holds(after_takeoff_s)
        reading = np.where(hit, obstruction.distance_m, reading)
        no_echo &= ~hit
    samples = len(sampled_us)
    nothing = np.zeros(samples, np.float32)
    return {
        "timestamp": (sampled_us + round(sensor.delay_ms * 1e3)).astype(np.int64),
        "device_id": np.full(samples, DEVICE_ID, np.uint32),
        "min_distance": np.full(samples, sensor.minimum_m, np.float32),
        "max_distance": np.full(samples, sensor.maximum_m, np.float32),
        "current_distance": np.clip(reading, sensor.minimum_m, sensor.maximum_m).astype(np.float32),
        "variance": np.full(samples, sensor.noise_m**2, np.float32),
        "h_fov": nothing,
        "v_fov": nothing.copy(),
        **{f"q[{index}]": nothing.copy() for index in range(4)},
        "signal_quality": np.where(no_echo, NO_ECHO, GOOD_QUALITY).astype(np.int8),
        "type": np.full(samples, LASER, np.uint8),
        "orientation": np.full(samples, DOWNWARD_FACING, np.uint8),
        "mode": np.zeros(samples, np.uint8),
    }
