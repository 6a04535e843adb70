"""Ratios of rates: Clopper–Pearson bounds of the conditional binomial by hand."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from fusetune.apply.statistics.rates import rate_ratio


def test_six_against_four_and_eleven_against_four_are_not_more_beyond_doubt() -> None:
    """P(X ≥ 6 of 10) = 386/1024 and P(X ≥ 11 of 15) = 1941/32768 under equal rates: both above 2.5 %."""
    assert not rate_ratio(6, 1.0, 4, 1.0, 0.95).is_larger
    assert not rate_ratio(11, 1.0, 4, 1.0, 0.95).is_larger


def test_none_against_five_is_not_and_against_six_is_fewer_beyond_doubt() -> None:
    """With k of k the lower bound of p is 0.025^(1/k): 0.478 for 5, 0.541 for 6."""
    five, six = rate_ratio(5, 1.0, 0, 1.0, 0.95), rate_ratio(6, 1.0, 0, 1.0, 0.95)
    assert (five.is_larger, six.is_larger) == (False, True)
    share = 0.025 ** (1 / 6)
    assert six.lower == pytest.approx(share / (1 - share))
    assert six.upper == math.inf


def test_the_time_over_which_was_counted_counts() -> None:
    """As many events in half the time are twice the rate."""
    one, half = rate_ratio(30, 100.0, 30, 100.0, 0.95), rate_ratio(30, 50.0, 30, 100.0, 0.95)
    assert (half.lower, half.upper) == pytest.approx((2 * one.lower, 2 * one.upper))
    assert (one.is_larger, half.is_larger) == (False, True)


def test_without_events_nothing_is_known() -> None:
    assert not rate_ratio(0, 1.0, 0, 1.0, 0.95).is_larger


@settings(deadline=None)
@given(st.integers(0, 60), st.integers(0, 60), st.sampled_from([0.9, 0.95, 0.99]))
def test_larger_beyond_doubt_is_what_the_exact_binomial_test_rejects(count: int, base: int, confidence: float) -> None:
    if count + base == 0:
        return
    p_value = binomtest(count, count + base, 0.5, alternative="greater").pvalue
    assert rate_ratio(count, 7.0, base, 7.0, confidence).is_larger == (p_value < (1 - confidence) / 2)
