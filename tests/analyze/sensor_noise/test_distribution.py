from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.analyze.sensor_noise.distribution import Distribution, deviations, distributions, outlying
from fusetune.analyze.sensor_noise.sensor_series import SENSORS, SensorSeries


def series(values: np.ndarray, step_us: int = 5000) -> SensorSeries:
    values = values.reshape(len(values), -1)
    time = np.arange(len(values), dtype=np.int64) * step_us
    return SensorSeries(SENSORS["gyro"], "sensor_combined", time, values, step_us * 1e-6, 0.0, 0)


def distribution(values: np.ndarray) -> Distribution:
    (found,) = distributions(series(values), [(0, 10**12)])
    return found


def test_deviation_is_from_the_median_of_four_neighbours() -> None:
    # neighbours of 10: 1, 2, 4, 8 → median 3; (10 - 3) / √1.29824
    found = deviations(np.array([[1.0], [8.0], [10.0], [2.0], [4.0]]))
    assert found[2, 0] == pytest.approx(7.0 / np.sqrt(1.29824))
    assert np.isnan(found[[0, 1, 3, 4], 0]).all()


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.integers(0, 2**32 - 1))
def test_steady_change_cancels(slope: float, offset: float, seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal((60, 1))
    ramp = slope * np.arange(60.0)[:, None] + offset
    assert np.nanmax(np.abs(deviations(ramp))) < 1e-9 * (1.0 + abs(slope) * 60.0 + abs(offset))
    assert np.isfinite(deviations(noise + ramp)[2:-2]).all()


def test_white_noise_is_normal() -> None:
    found = distribution(0.3 * np.random.default_rng(1).standard_normal(100_000))
    assert found.spread == pytest.approx(0.3, rel=0.02)
    assert found.outliers == 0
    assert found.tail_factor == pytest.approx(1.0, abs=0.25)
    assert found.kurtosis == pytest.approx(0.0, abs=0.06)
    assert sum(found.histogram) == found.samples
    assert found.step == 0.0


def test_outliers_are_counted_and_marked_once_each() -> None:
    values = np.random.default_rng(2).standard_normal(5000)
    wrong = np.array([700, 1900, 4200])
    values[wrong] += [20.0, -15.0, 30.0]
    assert distribution(values).outliers == 3
    assert np.flatnonzero(outlying(deviations(values[:, None]))[:, 0]).tolist() == wrong.tolist()


def test_heavy_tails_are_told() -> None:
    # Student's t with 4 degrees of freedom has far more beyond three standard deviations than a normal variable
    found = distribution(np.random.default_rng(3).standard_t(4, 50_000))
    assert found.tail_factor > 3.0
    assert found.kurtosis > 0.5


def test_steps_of_a_coarse_sensor_are_told() -> None:
    values = np.round(np.random.default_rng(4).standard_normal(5000) / 0.25) * 0.25
    found = distribution(values)
    assert found.step == pytest.approx(0.25)
    # the share of neighbours in one step of 0.25 σ: ∫ φ(x) of a difference with √2 σ within ± half a step, about 0.0704
    assert found.repeated == pytest.approx(0.0704, abs=0.015)


def test_too_few_samples_have_no_distribution() -> None:
    assert distributions(series(np.random.default_rng(5).standard_normal(20)), [(0, 10**12)]) == ()


def test_document_gives_the_distribution_back() -> None:
    found = distribution(np.random.default_rng(6).standard_normal(1000))
    assert Distribution.from_document(found.document()) == found
