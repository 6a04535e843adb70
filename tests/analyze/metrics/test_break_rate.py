"""Intervals against scipy's exact binomial interval."""

import numpy as np
import pytest
from scipy import stats

from fusetune.analyze.metrics.break_rate import beyond_gate, beyond_standard_deviations, break_rate, clopper_pearson


@pytest.mark.parametrize(("breaks", "samples"), [(0, 50), (1, 50), (7, 131), (50, 50)])
def test_interval_is_scipys_exact_one(breaks: int, samples: int) -> None:
    bounds = clopper_pearson(breaks, samples, 0.95)
    exact = stats.binomtest(breaks, samples).proportion_ci(0.95, method="exact")
    assert bounds.value == breaks / samples
    assert float(bounds.lower) == pytest.approx(exact.low, abs=1e-12)
    assert float(bounds.upper) == pytest.approx(exact.high, abs=1e-12)


def test_a_break_is_beyond_the_limit_in_standard_deviations() -> None:
    innovation = np.array([1.4, -1.6, 0.0])
    broken = beyond_standard_deviations(innovation, np.full(3, 0.25), 3.0)
    np.testing.assert_array_equal(broken, [False, True, False])


def test_where_the_gate_is_unknown_a_rejected_sample_is_a_break() -> None:
    broken = beyond_gate(np.array([0.5, 1.5, np.nan, np.nan]), np.array([True, False, True, False]))
    np.testing.assert_array_equal(broken, [False, True, True, False])


def test_rate_counts_along_the_last_axis() -> None:
    flags = np.array([[True, False, False, False], [False, False, False, False]])
    np.testing.assert_allclose(break_rate(flags, 0.95).value, [0.25, 0.0])


def test_white_normal_innovations_break_three_sigma_as_often_as_the_normal_law_says() -> None:
    innovation = np.random.default_rng(4).standard_normal(400_000)
    bounds = break_rate(beyond_standard_deviations(innovation, np.ones_like(innovation), 3.0), 0.999)
    assert bounds.lower < 2.0 * stats.norm.sf(3.0) < bounds.upper
