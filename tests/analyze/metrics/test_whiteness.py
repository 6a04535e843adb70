"""Against a slow and obvious form, the theory of AR(1), and the level under whiteness."""

import numpy as np
import pytest

from fusetune.analyze.metrics.whiteness import autocorrelation, effective_samples, lag_limit, ljung_box


def naive_autocorrelation(values: np.ndarray, lag: int) -> float:
    mean = sum(values) / len(values)
    above = sum((values[k] - mean) * (values[k - lag] - mean) for k in range(lag, len(values)))
    return above / sum((value - mean) ** 2 for value in values)


def ar1(phi: float, samples: int, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(samples)
    values = np.zeros(samples)
    for k in range(1, samples):
        values[k] = phi * values[k - 1] + noise[k]
    return values


def test_autocorrelation_is_the_obvious_one() -> None:
    values = np.random.default_rng(1).standard_normal(60)
    expected = [naive_autocorrelation(values, lag) for lag in range(1, 8)]
    np.testing.assert_allclose(autocorrelation(values, 7), expected, atol=1e-14)


def test_autocorrelation_of_a_constant_is_zero() -> None:
    np.testing.assert_array_equal(autocorrelation(np.full((2, 20), 3.0), 5), np.zeros((2, 5)))


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_effective_samples_of_ar1(phi: float) -> None:
    values = ar1(phi, 100_000, 2)
    # 1 + 2 Σ φ^2k = (1 + φ²) / (1 − φ²)
    expected = 100_000 * (1.0 - phi**2) / (1.0 + phi**2)
    assert effective_samples(autocorrelation(values, 50), 100_000) == pytest.approx(expected, rel=0.05)


def test_effective_samples_stay_between_one_and_all() -> None:
    assert effective_samples(np.zeros(10), 40) == 40.0
    assert effective_samples(np.ones(50), 4) == 1.0


def test_ljung_box_by_its_formula() -> None:
    values = np.random.default_rng(3).standard_normal(80)
    rho = [naive_autocorrelation(values, lag) for lag in range(1, 11)]
    expected = 80 * 82 * sum(r**2 / (80 - k) for k, r in enumerate(rho, start=1))
    statistic, _ = ljung_box(autocorrelation(values, 20), 80)
    assert statistic == pytest.approx(expected)


def test_ljung_box_rejects_white_noise_at_its_level_and_coloured_noise_always() -> None:
    white = np.random.default_rng(4).standard_normal((4000, 300))
    _, p = ljung_box(autocorrelation(white, 10), 300)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.015)
    _, coloured = ljung_box(autocorrelation(ar1(0.6, 300, 5), 10), 300)
    assert coloured < 1e-6


def test_lags_are_a_quarter_of_the_samples_at_most_fifty() -> None:
    assert [lag_limit(n) for n in (3, 40, 10_000)] == [0, 10, 50]
