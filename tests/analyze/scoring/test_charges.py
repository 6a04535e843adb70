"""What a set lacks, and what its resets hide, can only cost it; expectations by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusetune.analyze.scoring.charges import EvidenceCost, charged, passed_over

NOWHERE = np.zeros(6, bool)
PRESENT = np.array([1.0, -2.0, 3.0, -4.0, 5.0, 6.0])
OWN = np.array([0.5, 0.5, 0.5, -0.5, 9.0, 0.5])
VARIANCE = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


def flags(*places: int) -> np.ndarray:
    found = NOWHERE.copy()
    found[list(places)] = True
    return found


def test_what_is_there_and_follows_no_reset_stays() -> None:
    counted = charged(OWN, VARIANCE, PRESENT, NOWHERE, NOWHERE, 20.0)
    np.testing.assert_array_equal(counted.error, OWN)
    np.testing.assert_array_equal(counted.variance, VARIANCE)


def test_after_a_reset_the_larger_of_two_errors_counts_with_the_usual_variance() -> None:
    """Of the variances elsewhere, 1, 2, 3 and 6, the lower median is 2."""
    counted = charged(OWN, VARIANCE, PRESENT, NOWHERE, flags(3, 4), 20.0)
    np.testing.assert_array_equal(counted.error, [0.5, 0.5, 0.5, -4.0, 9.0, 0.5])
    np.testing.assert_array_equal(counted.variance, [1.0, 2.0, 3.0, 2.0, 2.0, 6.0])


def test_what_is_lacking_counts_with_the_limit() -> None:
    counted = charged(OWN, VARIANCE, PRESENT, flags(1, 2), NOWHERE, 20.0)
    np.testing.assert_array_equal(counted.error, [0.5, -20.0, 20.0, -0.5, 9.0, 0.5])
    # of 1, 4, 5 and 6
    np.testing.assert_array_equal(counted.variance, [1.0, 4.0, 4.0, 4.0, 5.0, 6.0])


def test_one_that_was_passed_over_counts_with_the_present_error_or_its_own_usual_one() -> None:
    usual = np.sqrt((4 * 0.25 + 81.0) / 5)
    counted = charged(OWN, VARIANCE, PRESENT, flags(2), NOWHERE, 20.0, flags(2))
    assert counted.error[2] == pytest.approx(usual)
    larger = charged(OWN, VARIANCE, np.where(flags(2), 7.0, PRESENT), flags(2), NOWHERE, 20.0, flags(2))
    assert larger.error[2] == 7.0


def test_where_nothing_is_clipped_the_largest_error_of_the_present_set_counts() -> None:
    assert charged(OWN, VARIANCE, PRESENT, flags(0, 1), NOWHERE, np.inf).error[:2].tolist() == [6.0, -6.0]


def test_a_set_that_lacks_all_of_it_has_the_limit_everywhere() -> None:
    counted = charged(OWN, VARIANCE, PRESENT, ~NOWHERE, NOWHERE, 20.0)
    np.testing.assert_array_equal(np.abs(counted.error), 20.0)
    np.testing.assert_array_equal(counted.variance, 1.0)


def test_one_alone_is_passed_over_and_two_are_absent() -> None:
    assert passed_over(flags(0, 2, 4, 5)).tolist() == [True, False, True, False, False, False]
    assert passed_over(np.ones(1, bool)).tolist() == [True]


def test_the_cost_is_a_share_of_the_mask() -> None:
    cost = EvidenceCost(mask=200, lacking=10, after_reset=30)
    assert (cost.lacking_percent, cost.lost_percent) == (5.0, 20.0)
    assert EvidenceCost(0, 0, 0).lost_percent == 0.0


FINITE = st.floats(-100.0, 100.0)


@settings(deadline=None)
@given(
    own=arrays(np.float64, 12, elements=FINITE),
    hidden=arrays(np.float64, 12, elements=st.floats(0.0, 1.0)),
    variance=arrays(np.float64, 12, elements=st.floats(0.1, 10.0)),
    after=arrays(np.bool_, 12),
    present=arrays(np.float64, 12, elements=FINITE),
)
def test_whatever_a_reset_hides_does_not_change_what_counts(
    own: np.ndarray, hidden: np.ndarray, variance: np.ndarray, after: np.ndarray, present: np.ndarray
) -> None:
    """A reset may make an error anything up to the present set's, and a variance anything: the score is the same."""
    nowhere = np.zeros(12, bool)
    one = charged(np.where(after, hidden * present, own), variance, present, nowhere, after, 50.0)
    other = charged(np.where(after, 0.0, own), np.where(after, 1e-3, variance), present, nowhere, after, 50.0)
    np.testing.assert_array_equal(one.error, other.error)
    if not after.all():
        np.testing.assert_array_equal(one.variance, other.variance)


@settings(deadline=None)
@given(
    own=arrays(np.float64, 12, elements=FINITE),
    lacking=arrays(np.bool_, 12),
    after=arrays(np.bool_, 12),
    present=arrays(np.float64, 12, elements=FINITE),
    limit=st.floats(1.0, 200.0),
)
def test_what_is_charged_is_never_less_than_the_present_error_or_the_limit(
    own: np.ndarray, lacking: np.ndarray, after: np.ndarray, present: np.ndarray, limit: float
) -> None:
    after &= ~lacking
    alone = passed_over(lacking)
    counted = charged(own, np.ones(12), present, lacking, after, limit, alone)
    absent = lacking & ~alone
    assert (np.abs(counted.error[absent]) == limit).all()
    assert (np.abs(counted.error)[lacking & ~absent | after] >= np.abs(present)[lacking & ~absent | after]).all()
    assert (np.abs(counted.error)[after] >= np.abs(own)[after]).all()
    untouched = ~lacking & ~after
    np.testing.assert_array_equal(counted.error[untouched], own[untouched])
