"""Spreads steadied by the other candidates: by hand, alone, with twins, and how often the intervals hold the truth."""

import math

import numpy as np
import pytest
from scipy import stats

from fusetune.apply.statistics.moderated import moderated


def test_two_candidates_by_hand() -> None:
    """Variances 0.005 and 0.02, mean squares 0.025 and 0.05, so shares 0.2 and 0.4.

    The first is expected to vary by 0.4 · 0.025 = 0.01, which counts as one further flight beside its one degree of
    freedom: (0.01 + 0.005) / 2.
    """
    first, second = moderated(np.array([[-0.1, 0.1], [-0.2, 0.3]]))
    assert first.error == pytest.approx(math.sqrt(0.0075 / 2))
    assert second.error == pytest.approx(math.sqrt((0.2 * 0.05 + 0.02) / 2 / 2))
    assert (first.freedom, second.freedom) == (2.0, 2.0)
    low, high = stats.t.interval(0.95, 2, -0.15, math.sqrt(0.0075 / 2))
    assert first.interval(0.95) == (pytest.approx(low), pytest.approx(high))
    assert first.p_value == pytest.approx(2.0 * stats.t.sf(0.15 / math.sqrt(0.0075 / 2), 2))


def test_a_candidate_without_others_has_students_t() -> None:
    differences = np.random.default_rng(0).normal(-0.1, 0.05, 7)
    for columns in (differences[:, None], np.column_stack([differences, differences, np.zeros(7)])):
        one = moderated(columns)[0]
        assert one.interval(0.9) == pytest.approx(stats.t.interval(0.9, 6, differences.mean(), stats.sem(differences)))
        assert one.p_value == pytest.approx(stats.ttest_1samp(differences, 0.0).pvalue)


def test_what_does_not_vary_stays_unknown() -> None:
    same, equal, _ = moderated(np.array([[-0.1, 0.0, 0.2], [-0.1, 0.0, 0.1]]))
    assert (same.error, same.interval(0.95), same.p_value) == (None, None, None)
    assert (equal.error, equal.p_value) == (None, 1.0)


def test_intervals_of_five_flights_hold_the_truth_and_are_narrower_than_students() -> None:
    """Twenty candidates whose effects vary by half their size."""
    generator = np.random.default_rng(1)
    effects = generator.normal(0.0, 0.2, 20)
    held, widths, plain = [], [], []
    for _ in range(300):
        differences = effects + 0.5 * np.abs(effects) * generator.standard_normal((5, 20))
        for effect, one, column in zip(effects, moderated(differences), differences.T, strict=True):
            low, high = one.interval(0.95) or (math.nan, math.nan)
            held.append(low <= effect <= high)
            widths.append((high - low) / abs(effect))
            plain.append(2.0 * stats.t.ppf(0.975, 4) * stats.sem(column) / abs(effect))
    assert 0.93 <= np.mean(held) <= 0.97
    assert np.mean(widths) < 0.85 * np.mean(plain)
