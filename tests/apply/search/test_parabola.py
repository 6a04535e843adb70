"""The lowest point of delays and lever arms."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.apply.search.parabola import lowest_point, propose_on_parabola
from fusetune.apply.search.space import Space
from fusetune.design.factors import factors_around

ARMS = {"EKF2_GPS_POS_X": 0.0, "EKF2_GPS_POS_Y": 0.0, "EKF2_GPS_POS_Z": 0.0}
SPACE = Space(factors_around(ARMS, tuple(ARMS)))
RIGHT = np.array([-0.4, 0.14, -0.38])
"""In half ranges of 0.5 m."""


def score(points: np.ndarray) -> np.ndarray:
    """A bowl with an axis askew, that is a cone far off."""
    off = points - RIGHT
    square = 0.4 * off[:, 0] ** 2 + 0.3 * off[:, 1] ** 2 + 0.1 * off[:, 2] ** 2 + 0.1 * off[:, 0] * off[:, 1]
    return np.where(square > 0.15, np.sqrt(0.15 * square), square)


def star() -> np.ndarray:
    return np.vstack([np.zeros(3), *(side * share * np.eye(3) for side in (-1, 1) for share in (1 / 3, 1))])


def test_it_is_found_from_a_star_and_three_generations_to_three_centimetres() -> None:
    points = star()
    for generation in range(3):
        new = propose_on_parabola(SPACE, points, score(points), generation)
        assert len(new) <= 4
        points = np.vstack([points, [SPACE.point(one) for one in new]])
    assert 0.5 * points[np.argmin(score(points))] == pytest.approx(0.5 * RIGHT, abs=0.031)


def test_it_lies_inside_the_bounds_though_the_parabola_is_lower_beyond() -> None:
    points = star()
    found = lowest_point(points, points @ np.array([1.0, 0.5, 0.0]), SPACE.bounds)
    assert found[:2] == pytest.approx([-1.0, -1.0])
    assert (np.abs(found) <= 1.0).all()
