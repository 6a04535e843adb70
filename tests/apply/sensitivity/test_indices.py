"""Sobol indices against those of functions whose are known."""

import numpy as np
import pytest
from tests.apply.sensitivity.made_trials import drawn, made_trials

from fusetune.apply.sensitivity.sensitivity import sensitivity


def test_of_a_quadratic_in_uniform_coordinates() -> None:
    """Of a x + b x² + c x y + d z on -1 … 1: variances a²/3 + 4 b²/45, c²/9 and d²/3 (moments of the uniform)."""
    a, b, c, d = 0.02, 0.03, 0.04, 0.01

    def score(at: np.ndarray) -> np.ndarray:
        x, y, z = at.T
        return a * x + b * x**2 + c * x * y + d * z

    trials = made_trials(drawn(60, 3, reach=1.0), [score] * 4)
    edges = np.array(
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
    )
    trials = made_trials(np.vstack([trials.coordinates, edges]), [score] * 4)
    found = sensitivity(trials)
    alone, both, third = a**2 / 3.0 + 4.0 * b**2 / 45.0, c**2 / 9.0, d**2 / 3.0
    variance = alone + both + third
    assert found.spread == pytest.approx(np.sqrt(variance), rel=0.03)
    assert [one.first for one in found.parameters] == pytest.approx(np.array([alone, 0.0, third]) / variance, abs=0.03)
    total = np.array([alone + both, both, third]) / variance
    assert [one.total for one in found.parameters] == pytest.approx(total, abs=0.03)
    # flights that agree leave nothing to chance
    assert [one.total_interval for one in found.parameters] == [
        pytest.approx((share, share), abs=0.03) for share in total
    ]


def test_the_interval_comes_from_what_flights_differ_by() -> None:
    """On half of the flights the first parameter does all, on the others the second."""
    flights = [lambda at: 0.05 * at[:, 0]] * 3 + [lambda at: 0.05 * at[:, 1]] * 3
    one, other = sensitivity(made_trials(drawn(40, 2), flights)).parameters
    assert one.total == pytest.approx(0.5, abs=0.05)
    for found in (one, other):
        assert found.total_interval is not None
        assert found.total_interval[0] < 0.2
        assert found.total_interval[1] > 0.8
