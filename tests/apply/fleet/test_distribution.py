"""Quantiles, histograms and the robust scale of a figure over flights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusetune.apply.fleet.distribution import MOST_BINS, distribution, histogram, robust_scale

VALUES = arrays(np.float64, st.integers(1, 60), elements=st.floats(-1e6, 1e6))


def test_a_distribution_by_hand() -> None:
    """Of 1 … 5: the quantile p lies at 1 + 4p, the variance is 10/4."""
    spread = distribution(np.array([5.0, 1.0, np.nan, 3.0, 2.0, 4.0]))
    assert spread is not None
    assert (spread.n, spread.mean, spread.minimum, spread.median, spread.maximum) == (5, 3.0, 1.0, 3.0, 5.0)
    assert (spread.p25, spread.p75) == (2.0, 4.0)
    assert (spread.p05, spread.p95) == (pytest.approx(1.2), pytest.approx(4.8))
    assert spread.standard_deviation == pytest.approx(np.sqrt(2.5))


def test_of_one_flight_there_is_no_deviation_and_of_none_nothing() -> None:
    one = distribution(np.array([2.0]))
    assert one is not None
    assert one.standard_deviation is None
    assert distribution(np.array([np.nan])) is None
    assert histogram(np.array([np.nan])) is None


def test_one_odd_flight_does_not_flatten_a_histogram() -> None:
    """0 … 99 have the quartiles 24.75 and 74.25; the width of Freedman and Diaconis is 2 · 49.5 / ∛101 = 21.2."""
    found = histogram(np.append(np.arange(100.0), 1e6))
    assert found is not None
    assert (found.below, found.above) == (0, 1)
    assert sum(found.counts) == 100
    # the fence: 75 + 3 · 50
    assert found.edges[-1] == pytest.approx(225.0)
    assert found.edges[1] - found.edges[0] == pytest.approx(225.0 / np.ceil(225.0 / (100.0 * 101 ** (-1 / 3))))


def test_figures_that_are_mostly_zero_have_a_histogram() -> None:
    found = histogram(np.array([0.0] * 10 + [0.4]))
    assert found is not None
    # log₂ 11 is above 3: four bins and one more
    assert len(found.counts) == 5
    assert (found.counts[0], found.counts[-1]) == (10, 1)


@given(VALUES)
def test_every_flight_is_counted_once(values: np.ndarray) -> None:
    found = histogram(values)
    assert found is not None
    assert found.below + sum(found.counts) + found.above == values.size
    assert len(found.counts) <= MOST_BINS
    assert len(found.edges) == len(found.counts) + 1


def naive_qn(values: np.ndarray) -> float:
    """The k-th smallest distance, k = h over 2 of h = n/2 + 1, by its definition."""
    n = len(values)
    distances = sorted(abs(values[i] - values[j]) for i in range(n) for j in range(i))
    half = n // 2 + 1
    return 2.21914 * distances[half * (half - 1) // 2 - 1]


def test_qn_is_the_distance_of_its_definition() -> None:
    values = np.random.default_rng(3).normal(size=11)
    # Croux and Rousseeuw's correction for odd n
    assert robust_scale(values) == pytest.approx(naive_qn(values) * 11 / (11 + 1.4))


@pytest.mark.parametrize("n", [7, 10, 25])
def test_qn_tells_the_standard_deviation_of_normal_values(n: int) -> None:
    draw = np.random.default_rng(n)
    scales = [robust_scale(2.0 * draw.normal(size=n)) for _ in range(2000)]
    assert np.mean(scales) == pytest.approx(2.0, rel=0.03)


@given(VALUES, st.floats(0.1, 10.0), st.floats(-100.0, 100.0))
def test_qn_goes_with_the_scale_and_not_with_the_place(values: np.ndarray, factor: float, offset: float) -> None:
    largest = float(np.max(np.abs(values)))
    expected = factor * robust_scale(values)
    assert robust_scale(factor * values + offset) == pytest.approx(expected, rel=1e-6, abs=1e-6 * (largest + 1.0))


def test_qn_bears_that_nearly_half_of_the_values_are_anything() -> None:
    values = np.random.default_rng(1).normal(size=21)
    spoiled = values.copy()
    spoiled[:9] = 1e9
    assert robust_scale(spoiled) < 5.0 * robust_scale(values)
    assert robust_scale(np.array([1.0])) == 0.0
