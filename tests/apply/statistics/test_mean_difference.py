"""Mean differences against Student's own interval."""

import math

import numpy as np
import pytest

from fusetune.apply.statistics.mean_difference import MeanDifference, mean_difference


def test_mean_difference_of_three_flights() -> None:
    """Differences 1, 2 and 3: their standard error is 1/√3, and Student's t with 2 degrees of freedom 4.303 at 97.5 %.

    Redrawn means that are all the same show no spread, and so no interval.
    """
    differences = np.array([1.0, 2.0, 3.0])
    assert mean_difference(np.full(8, 2.0), differences, 3, 0.95) == MeanDifference(2.0, None, None, 3)
    found = mean_difference(np.array([1.0, 2.0, 3.0]), differences, 3, 0.95)
    assert (found.difference, found.flights) == (2.0, 3)
    assert found.lower == pytest.approx(2.0 - 4.302653 / math.sqrt(3.0), rel=1e-6)
    assert found.upper == pytest.approx(2.0 + 4.302653 / math.sqrt(3.0), rel=1e-6)


@pytest.mark.parametrize(
    ("lower", "upper", "is_certain", "is_worse"),
    [(0.1, 0.3, True, True), (-0.3, -0.1, True, False), (-0.1, 0.3, False, False), (None, None, False, False)],
)
def test_what_an_interval_proves(lower: float | None, upper: float | None, is_certain: bool, is_worse: bool) -> None:
    found = MeanDifference(0.1, lower, upper, 5)
    assert (found.is_certain, found.is_worse) == (is_certain, is_worse)
