"""When a sensor that runs on its own clock takes its samples."""

from __future__ import annotations

import math

import numpy as np

from fusetune.execute.world.truth import Truth


def sample_times(truth: Truth, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Even sample times (µs since boot, int64) over the flight, with a random phase against the IMU."""
    period_us = 1e6 / rate_hz
    first_us = truth.timestamp_us[0] + rng.uniform(0.0, period_us)
    samples = max(math.floor((truth.timestamp_us[-1] - first_us) / period_us), 0)
    return np.rint(first_us + period_us * np.arange(samples)).astype(np.int64)
