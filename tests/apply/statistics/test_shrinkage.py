"""Expected differences: by hand, and that they are nearer to the truth than what was measured."""

import numpy as np
import pytest

from fusetune.apply.statistics.shrinkage import expected_differences


def test_two_candidates_by_hand() -> None:
    """Mean of 0.09 − 0.01 and 0.01 − 0.01 is 0.04 = σ²; factors 0.04/0.05 each."""
    assert expected_differences([-0.3, 0.1], [0.1, 0.1]) == pytest.approx([-0.24, 0.08])


def test_the_surer_of_two_equal_ones_is_worth_more() -> None:
    sure, unsure, unknown = expected_differences([-0.1, -0.1, -0.1], [0.01, 0.06, None])
    assert sure < unsure
    assert unknown == -0.1


def test_what_is_no_larger_than_its_error_is_worth_nothing() -> None:
    assert expected_differences([-0.1, 0.1], [0.1, 0.1]) == [0.0, 0.0]
    assert expected_differences([-0.1], [None]) == [-0.1]
    assert expected_differences([], []) == []


def test_it_comes_nearer_to_the_truth() -> None:
    generator = np.random.default_rng(0)
    errors = generator.uniform(0.02, 0.2, 4000)
    truth = generator.normal(0.0, 0.1, 4000)
    measured = truth + errors * generator.standard_normal(4000)
    found = np.array(expected_differences(measured.tolist(), errors.tolist()))
    best = measured * 0.01 / (0.01 + errors**2)
    assert np.mean((found - truth) ** 2) < 0.7 * np.mean((measured - truth) ** 2)
    assert np.mean((found - truth) ** 2) == pytest.approx(np.mean((best - truth) ** 2), rel=0.02)
