"""Likelihoods against scipy's densities; the properties that make them scores."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, stats

from fusetune.analyze.metrics.likelihood import gaussian_nll, profile_nll, student_t_nll, winsor_limit, winsorised


@pytest.fixture
def samples() -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(5)
    variance = generator.uniform(0.2, 3.0, 500)
    return generator.standard_normal(500) * np.sqrt(variance), variance


def test_gaussian_nll_is_the_normal_density(samples: tuple[np.ndarray, np.ndarray]) -> None:
    innovation, variance = samples
    np.testing.assert_allclose(
        gaussian_nll(innovation, variance), -stats.norm.logpdf(innovation, scale=np.sqrt(variance))
    )


def test_student_nll_is_the_t_density_with_that_variance(samples: tuple[np.ndarray, np.ndarray]) -> None:
    innovation, variance = samples
    density = stats.t(df=5.0, scale=np.sqrt(variance * 3.0 / 5.0))
    np.testing.assert_allclose(student_t_nll(innovation, variance, 5.0), -density.logpdf(innovation))
    np.testing.assert_allclose(density.var(), variance)


def test_nll_is_least_at_the_true_variance() -> None:
    innovation = 0.7 * np.random.default_rng(6).standard_normal(200_000)
    found = optimize.minimize_scalar(
        lambda log_variance: np.mean(gaussian_nll(innovation, np.full_like(innovation, np.exp(log_variance)))),
        bounds=(-4.0, 3.0),
        method="bounded",
    )
    assert np.exp(found.x) == pytest.approx(0.49, rel=0.01)


def test_nll_punishes_inflation_that_mean_nis_rewards() -> None:
    innovation = np.random.default_rng(7).standard_normal(20_000)
    right, inflated = np.ones_like(innovation), np.full_like(innovation, 16.0)
    assert np.mean(innovation**2 / inflated) < np.mean(innovation**2 / right)
    assert np.mean(gaussian_nll(innovation, inflated)) > np.mean(gaussian_nll(innovation, right))


def test_profile_is_the_nll_at_the_best_scale(samples: tuple[np.ndarray, np.ndarray]) -> None:
    innovation, variance = samples
    found = optimize.minimize_scalar(
        lambda log_scale: np.mean(gaussian_nll(innovation, np.exp(log_scale) * variance)),
        bounds=(-5, 5),
        method="bounded",
    )
    profile = profile_nll(np.mean(innovation**2 / variance), np.mean(np.log(variance)))
    assert profile + 0.5 + 0.5 * np.log(2.0 * np.pi) == pytest.approx(found.fun, abs=1e-9)


@given(scale=st.floats(1e-6, 1e6), seed=st.integers(0, 1000))
def test_profile_does_not_see_the_scale_of_the_variance(scale: float, seed: int) -> None:
    generator = np.random.default_rng(seed)
    innovation, variance = generator.standard_normal(50), generator.uniform(0.1, 5.0, 50)

    def profile(claimed: np.ndarray) -> float:
        return float(profile_nll(np.mean(innovation**2 / claimed), np.mean(np.log(claimed))))

    assert profile(scale * variance) == pytest.approx(profile(variance), abs=1e-9)


@given(factor=st.floats(0.1, 10.0))
def test_profile_falls_by_the_logarithm_of_smaller_errors(factor: float) -> None:
    innovation, variance = np.random.default_rng(8).standard_normal(100), np.full(100, 2.0)
    whole = profile_nll(np.mean(innovation**2 / variance), np.mean(np.log(variance)))
    scaled = profile_nll(np.mean((factor * innovation) ** 2 / variance), np.mean(np.log(variance)))
    assert scaled - whole == pytest.approx(np.log(factor), abs=1e-9)


def test_an_outlier_costs_student_its_logarithm_and_gauss_its_square() -> None:
    variance = np.ones(1)
    gauss = gaussian_nll(np.array([100.0]), variance) - gaussian_nll(np.array([10.0]), variance)
    student = student_t_nll(np.array([100.0]), variance) - student_t_nll(np.array([10.0]), variance)
    assert gauss[0] == pytest.approx(0.5 * (1e4 - 1e2))
    # ½ (dof + 1) ln(100² / 10²) for large deviations
    assert student[0] == pytest.approx(3.0 * np.log(100.0), rel=0.02)


def test_winsor_limit_is_five_robust_standard_deviations_and_no_matter_of_the_claimed_variance() -> None:
    innovation = 0.2 * np.random.default_rng(9).standard_normal(100_000)
    innovation[:100] = 1e6
    assert winsor_limit(innovation) == pytest.approx(1.0, rel=0.02)
    clipped = winsorised(innovation, winsor_limit(innovation))
    assert np.max(np.abs(clipped)) == winsor_limit(innovation)
    # A smaller claimed variance must never win by itself.
    claims = [np.mean(gaussian_nll(clipped, np.full_like(clipped, variance))) for variance in (1e-6, 0.04, 1e3)]
    assert np.argmin(claims) == 1


def test_winsor_limit_of_silence_is_none() -> None:
    assert winsor_limit(np.zeros(10)) == np.inf
