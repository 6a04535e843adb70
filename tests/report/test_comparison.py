"""Figures of the comparison by hand."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.report.comparison import percent_change, robust_reach
from fusetune.report.figures.difference_figures import shortened


def test_a_difference_of_logarithms_is_a_percentage() -> None:
    # exp(ln 1.25) - 1 = 25 %, exp(ln 0.8) - 1 = -20 %
    np.testing.assert_allclose(percent_change(np.log([1.25, 0.8, 1.0])), [25.0, -20.0, 0.0], atol=1e-12)


def test_one_hopeless_set_does_not_squeeze_the_others() -> None:
    low, high = [-3.0, -2.0, -1.0, 1.0, 400.0], [1.0, 2.0, 3.0, 5.0, 600.0]
    left, right = robust_reach(low, high, [True] * 5)
    # What is usual reaches to 5 %; what begins at 400 % is outside.
    assert -4.0 < left < -3.0
    assert 5.0 < right < 10.0


def test_a_hopeless_set_that_is_vetoed_does_not_either() -> None:
    left, right = robust_reach([-3.0, -90.0], [1.0, 900.0], [True, False])
    assert left > -5.0
    # Its interval, which begins among the others, is cut at what is never hopeless or four times the usual.
    assert 12.0 <= right < 13.5


def test_a_small_difference_is_never_hopeless() -> None:
    # 5 % is many times 0.5 %, and yet nothing to hide.
    assert robust_reach([-0.5, 3.0], [0.5, 5.0], [True, True])[1] > 5.0


def test_a_wide_interval_that_begins_among_the_others_is_cut_not_left_out() -> None:
    # The usual reach is 20 %, four times that is 80 %.
    right = robust_reach([-20.0, -5.0, 60.0], [10.0, 20.0, 300.0], [True] * 3)[1]
    assert 80.0 < right < 90.0


def test_without_any_set_the_limits_are_still_limits() -> None:
    assert robust_reach([], [], []) == (-1.0, 1.0)
    assert robust_reach([np.nan], [np.nan], [True]) == (-1.0, 1.0)


intervals = st.lists(st.tuples(st.floats(-99.0, 1000.0), st.floats(0.0, 500.0), st.booleans()), min_size=1, max_size=20)


@settings(deadline=None)
@given(intervals)
def test_the_limits_hold_zero_and_all_that_speaks_for_an_eligible_set(found: list[tuple[float, float, bool]]) -> None:
    low = np.array([one[0] for one in found])
    able = np.array([one[2] for one in found])
    left, right = robust_reach(low, low + [one[1] for one in found], able)
    assert left < 0.0 < right
    assert (low[able] >= left).all()


def test_a_long_name_keeps_its_beginning_and_its_end() -> None:
    name = shortened("beginning_" + 40 * "x" + "_end")
    assert len(name) == 30
    assert name.startswith("beginning")
    assert name.endswith("_end")
