"""What is made small."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.objective import objective

NAN = np.nan


def compared(differences: ArrayLike, aided: ArrayLike, unaided: ArrayLike, **more: Any) -> Comparison:
    smoothed = np.array(more.get("smoothed", np.full(np.shape(aided), NAN)))
    aims = {AIDED: np.array(aided), UNAIDED: np.array(unaided), SMOOTHED: smoothed}
    return Comparison(np.array(differences), aims, more.get("objections", ((),) * len(np.array(differences))))


def test_it_is_the_mean_score_of_the_flights_that_say_anything() -> None:
    one = compared([[-0.2, -0.4, NAN]], [[-0.2, -0.4, NAN]], [[-0.2, -0.4, NAN]])
    assert objective(one, "all") == pytest.approx([-0.3])


def test_what_one_aim_loses_counts_once_more() -> None:
    # the score −0.1 is the mean of −0.3 aided and +0.1 unaided: −0.1 + 0.1
    one = compared([[-0.1, -0.1]], [[-0.3, -0.3]], [[0.1, 0.1]])
    assert objective(one, "all") == pytest.approx([0.0])


def test_a_set_that_would_be_ruled_out_is_never_better_than_the_base() -> None:
    one = compared([[-0.5], [0.2]], [[-0.5], [0.2]], [[-0.5], [0.0]], objections=(("resets",), ("resets",)))
    assert objective(one, "all") == pytest.approx([0.1, 0.5])


def test_a_set_without_a_score_on_a_flight_counts_as_bad() -> None:
    one = compared([[-0.5, NAN], [-0.1, -0.1]], [[-0.5, NAN], [-0.1, -0.1]], [[-0.5, NAN], [-0.1, -0.1]])
    assert objective(one, "all") == pytest.approx([1.0, -0.1])


def test_nothing_asked_is_nothing() -> None:
    none = np.zeros((0, 3))
    assert objective(compared(none, none, none), "all").size == 0


def test_a_fifth_of_what_the_smoothed_velocity_says_is_added_but_not_of_delays() -> None:
    one = compared([[-0.1, -0.1]], [[-0.1, -0.1]], [[-0.1, -0.1]], smoothed=[[-0.3, -0.5]])
    assert objective(one, "all") == pytest.approx([-0.1 - 0.2 * 0.4])
    assert objective(one, "delays") == objective(one, "delays again") == pytest.approx([-0.1])
