"""Bounds against scipy's χ² and by simulation; indicators where they must be zero."""

import numpy as np
import pytest
from scipy import stats

from fusetune.analyze.metrics.consistency import c_nis, chi2_quantile, effective_bounds, j_nis, mean_nis, paper_bounds


@pytest.mark.parametrize("dof", [1.0, 3.5, 297.0, 5000.0])
@pytest.mark.parametrize("probability", [0.025, 0.5, 0.975])
def test_quantile_is_scipys(dof: float, probability: float) -> None:
    assert chi2_quantile(probability, dof) == pytest.approx(stats.chi2.ppf(probability, dof), rel=1e-9)


def test_paper_bounds_have_the_papers_degrees_of_freedom() -> None:
    bounds = paper_bounds(np.array(3.0), samples=100, dimension=3, confidence=0.95)
    assert bounds.lower == pytest.approx(stats.chi2.ppf(0.025, 297) / 100)
    assert bounds.upper == pytest.approx(stats.chi2.ppf(0.975, 297) / 100)


def test_mean_nis_by_hand() -> None:
    # two samples of two components: (1/1 + 4/4), (9/1 + 0/4)
    innovation = np.array([[1.0, 3.0], [2.0, 0.0]])
    variance = np.array([[1.0, 1.0], [4.0, 4.0]])
    assert mean_nis(innovation, variance) == 5.5


@pytest.mark.parametrize("dimension", [1, 3])
def test_bounds_hold_a_consistent_filter_at_their_level(dimension: int) -> None:
    generator = np.random.default_rng(1)
    variance = generator.uniform(0.1, 2.0, (dimension, 1, 200))
    innovation = generator.standard_normal((dimension, 2000, 200)) * np.sqrt(variance)
    nis = mean_nis(innovation, np.broadcast_to(variance, innovation.shape))
    # The plain bounds cover 95 %; the paper's subtract dim(S) degrees of freedom, half a percent of a bound here.
    plain = effective_bounds(nis, np.full(nis.shape, 200.0), dimension, 0.95)
    assert np.mean((nis >= plain.lower) & (nis <= plain.upper)) == pytest.approx(0.95, abs=0.012)
    paper = paper_bounds(nis, 200, dimension, 0.95)
    assert np.mean((nis >= paper.lower) & (nis <= paper.upper)) == pytest.approx(0.95, abs=0.02)


def test_effective_bounds_hold_correlated_samples_that_the_plain_ones_reject() -> None:
    generator = np.random.default_rng(2)
    phi, samples, runs = 0.9, 500, 1500
    noise = generator.standard_normal((runs, samples + 200)) * np.sqrt(1.0 - phi**2)
    values = np.zeros_like(noise)
    for k in range(1, noise.shape[1]):
        values[:, k] = phi * values[:, k - 1] + noise[:, k]
    nis = mean_nis(values[None, :, 200:], np.ones((1, runs, samples)))
    independent = np.full(runs, samples * (1 - phi**2) / (1 + phi**2))
    effective = effective_bounds(nis, independent, 1, 0.95)
    covered = np.mean((nis >= effective.lower) & (nis <= effective.upper))
    paper = paper_bounds(nis, samples, 1, 0.95)
    assert covered == pytest.approx(0.95, abs=0.03)
    assert np.mean((nis >= paper.lower) & (nis <= paper.upper)) < 0.6


def test_a_single_sample_accepts_everything_rather_than_dividing_by_zero() -> None:
    bounds = paper_bounds(np.array(1.0), samples=1, dimension=1, confidence=0.95)
    assert bounds.lower == 0.0
    assert bounds.upper == np.inf


def test_j_nis_is_zero_at_the_expectation_and_symmetric() -> None:
    assert j_nis(np.array(3.0), 3) == 0.0
    assert j_nis(np.array(6.0), 3) == pytest.approx(j_nis(np.array(1.5), 3)) == pytest.approx(np.log(2.0))


def test_c_nis_of_a_consistent_filter_is_small_and_of_an_inflated_one_known() -> None:
    innovation = np.random.default_rng(3).standard_normal((2, 200_000))
    assert c_nis(innovation, np.ones_like(innovation)) < 0.03
    # Variance claimed 4 times: mean NIS falls by 4, its variance by 16.
    assert c_nis(innovation, np.full_like(innovation, 4.0)) == pytest.approx(3.0 * np.log(4.0), abs=0.03)
