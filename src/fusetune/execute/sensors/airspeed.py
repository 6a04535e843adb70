"""Airspeed (`airspeed`, `airspeed_validated`): the dynamic pressure in a pitot tube along the body's forward axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.noise import random_stream
from fusetune.execute.sensors.barometer import standard_atmosphere
from fusetune.execute.sensors.faults import AirspeedScale, Fault, of_kind
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import AirspeedSensor
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

SEA_LEVEL_DENSITY_KG_M3 = 1.225
PUBLISHED_AFTER_US = 500
FIRST_SENSOR = 1


def airspeed_topics(
    truth: Truth, sensor: AirspeedSensor, geoid_undulation_m: float, faults: Sequence[Fault], seed: int
) -> dict[str, TopicTable]:
    """Both topics of PX4, the second as its airspeed selector passes the first on.

    A negative pressure gives a negative airspeed, as PX4's conversion does.
    """
    rng = random_stream(seed, "airspeed")
    sampled_us = sample_times(truth, sensor.rate_hz, rng)
    _, _, height = truth.frame.to_geodetic(truth.at(sampled_us, truth.position))
    _, _, density = standard_atmosphere(height - geoid_undulation_m)
    through_air = truth.at(sampled_us, truth.velocity - truth.wind)
    forward = truth.attitude_at(sampled_us).inv().apply(through_air)[:, 0]
    pressure = 0.5 * density * forward * np.abs(forward)
    pressure = pressure + sensor.offset_pa * rng.standard_normal()
    pressure = pressure + sensor.noise_pa * rng.standard_normal(len(sampled_us))
    indicated = np.sign(pressure) * np.sqrt(2.0 * np.abs(pressure) / SEA_LEVEL_DENSITY_KG_M3)
    for scaled in of_kind(faults, AirspeedScale):
        indicated = indicated * scaled.factor
    true = indicated * np.sqrt(SEA_LEVEL_DENSITY_KG_M3 / density)
    sample_us = sampled_us + round(sensor.delay_ms * 1e3)
    samples = len(sample_us)
    speeds = {
        "indicated_airspeed_m_s": indicated.astype(np.float32),
        "true_airspeed_m_s": true.astype(np.float32),
    }
    nan = np.full(samples, np.nan, np.float32)
    return {
        "airspeed": {
            "timestamp": (sample_us + PUBLISHED_AFTER_US).astype(np.int64),
            "timestamp_sample": sample_us.astype(np.int64),
            **speeds,
            "air_temperature_celsius": np.full(samples, 15.0, np.float32),
            "confidence": np.ones(samples, np.float32),
        },
        "airspeed_validated": {
            "timestamp": sample_us.astype(np.int64),
            **{name: values.copy() for name, values in speeds.items()},
            "calibrated_airspeed_m_s": speeds["indicated_airspeed_m_s"].copy(),
            "calibrated_ground_minus_wind_m_s": nan,
            "true_ground_minus_wind_m_s": nan.copy(),
            "airspeed_sensor_measurement_valid": np.ones(samples, np.bool_),
            "selected_airspeed_index": np.full(samples, FIRST_SENSOR, np.int8),
        },
    }
