"""The front of two aims."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.apply.sensitivity.made_trials import made_trials

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.pareto import pareto_front, two_aims

points = arrays(np.float64, st.tuples(st.integers(1, 25), st.just(2)), elements=st.integers(-4, 4).map(float))


def test_by_hand() -> None:
    values = np.array([[0.0, 3.0], [1.0, 1.0], [2.0, 2.0], [3.0, 0.0], [3.0, 0.0], [0.0, 4.0], [np.nan, -9.0]])
    assert pareto_front(values).tolist() == [True, True, False, True, True, False, False]
    assert pareto_front(np.empty((0, 2))).tolist() == []


@given(points)
def test_it_is_what_nothing_beats(values: np.ndarray) -> None:
    def beats(one: np.ndarray, other: np.ndarray) -> bool:
        return bool(np.all(one <= other) and np.any(one < other))

    expected = [not any(beats(other, one) for other in values) for one in values]
    assert pareto_front(values).tolist() == expected


def test_the_smoothed_velocity_stands_in_where_predictions_have_no_weight() -> None:
    trials = made_trials(np.ones((2, 1)), [lambda at: np.zeros(2)] * 2)
    nan = np.nan
    aims = {
        AIDED: np.array([[0.1, nan], [0.3, nan]]),
        SMOOTHED: np.array([[9.0, 0.2], [9.0, 0.5]]),
        UNAIDED: np.array([[0.4, 0.6], [nan, 0.1]]),
    }
    values, kind = two_aims(type(trials)(*(getattr(trials, name) for name in ("factors", "names", "values", "flights",
                                          "differences")), aims, trials.allowed))  # fmt: skip
    assert kind == "mixed"
    assert values[0] == pytest.approx([0.15, 0.5])
    assert values[1][0] == pytest.approx(0.4)
    assert np.isnan(values[1][1])
