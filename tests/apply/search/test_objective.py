"""What is made small."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.objective import objective

NAN = np.nan


def compared(
    differences: list[list[float]], aided: list[list[float]], unaided: list[list[float]], **more
) -> Comparison:
    aims = {AIDED: np.array(aided), UNAIDED: np.array(unaided), SMOOTHED: np.full(np.shape(aided), NAN)}
    return Comparison(np.array(differences), aims, more.get("objections", ((),) * len(differences)))


def test_it_is_the_mean_score_of_the_flights_that_say_anything() -> None:
    one = compared([[-0.2, -0.4, NAN]], [[-0.2, -0.4, NAN]], [[-0.2, -0.4, NAN]])
    assert objective(one) == pytest.approx([-0.3])


def test_what_one_aim_loses_counts_once_more() -> None:
    # the score −0.1 is the mean of −0.3 aided and +0.1 unaided: −0.1 + 0.1
    one = compared([[-0.1, -0.1]], [[-0.3, -0.3]], [[0.1, 0.1]])
    assert objective(one) == pytest.approx([0.0])


def test_a_set_that_would_be_ruled_out_is_never_better_than_the_base() -> None:
    one = compared([[-0.5], [0.2]], [[-0.5], [0.2]], [[-0.5], [0.0]], objections=(("resets",), ("resets",)))
    assert objective(one) == pytest.approx([0.1, 0.5])


def test_a_set_without_a_score_on_a_flight_counts_as_bad() -> None:
    one = compared([[-0.5, NAN], [-0.1, -0.1]], [[-0.5, NAN], [-0.1, -0.1]], [[-0.5, NAN], [-0.1, -0.1]])
    assert objective(one) == pytest.approx([1.0, -0.1])


def test_nothing_asked_is_nothing() -> None:
    assert (
        objective(compared(np.zeros((0, 3)).tolist() or np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))).size == 0
    )
