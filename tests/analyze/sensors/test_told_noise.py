"""What the estimator is told of a source's noise, on samples of which it is known."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.sensors.told_noise import FEWEST_SAMPLES, told_noise

STEP_US = 200_000


def samples(told: np.ndarray, predicted: float) -> AxisSamples:
    count = told.size
    return AxisSamples(
        timestamp_sample=np.arange(count, dtype=np.int64) * STEP_US,
        observation_variance=told,
        innovation=np.zeros(count),
        innovation_variance=told + predicted,
        test_ratio=np.zeros(count),
        rejected=np.zeros(count, np.bool_),
        fused=np.ones(count, np.bool_),
    )


def test_variances_are_averaged_where_the_flight_is_scored() -> None:
    # R of 0.09 and 0.25 in turn: the mean is 0.17; outside of the interval it is 100
    told = np.where(np.arange(40) % 2, 0.25, 0.09)
    told[20:] = 100.0
    found = told_noise(samples(told, 0.04), [(0, 20 * STEP_US)])
    assert found is not None
    assert found.noise == pytest.approx(np.sqrt(0.17))
    assert found.predicted == pytest.approx(0.2)
    assert found.samples == 20


def test_few_samples_and_variances_that_are_not_known_tell_nothing() -> None:
    whole = [(0, 10**9)]
    assert told_noise(samples(np.full(FEWEST_SAMPLES - 1, 0.1), 0.1), whole) is None
    assert told_noise(samples(np.full(50, np.nan), 0.1), whole) is None
    assert told_noise(samples(np.full(FEWEST_SAMPLES, 0.1), 0.1), whole) is not None
