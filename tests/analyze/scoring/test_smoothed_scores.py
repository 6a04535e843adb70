"""Sums of squared differences to the smoothed velocity, by hand."""

import numpy as np
import pytest

from fusetune.analyze.replaying.replayed_set import FilterStates
from fusetune.analyze.scoring.smoothed_scores import SMOOTHED_SCHEMA, SmoothedScores
from fusetune.analyze.smoothing.error_model import ErrorModel
from fusetune.analyze.smoothing.smoothed_velocity import SmoothedVelocity

WHITE = ErrorModel(0.1, 0.0, 0.0, 0.01)
TIME = np.arange(0, 1000, 50, dtype=np.int64)


def reference(velocity: np.ndarray) -> SmoothedVelocity:
    return SmoothedVelocity("gnss_vel", TIME, velocity, WHITE, WHITE)


def states(time: np.ndarray, velocity: np.ndarray) -> FilterStates:
    ones = np.ones((time.size, 3))
    return FilterStates(time, np.ones((time.size, 4)), velocity, ones, ones, ones)


def test_sums_of_two_sets_over_two_blocks() -> None:
    """One is off by (1, 2, 3) m/s, the other by 2 everywhere; blocks of 12 and 8 times."""
    truth = np.column_stack([TIME * 1e-3, 1.0 - TIME * 2e-3, 0.0 * TIME])
    scores = SmoothedScores(reference(truth))
    # at other times than the reference's, between which the velocity is a straight line
    coarse = np.array([0, 1000])
    line = np.column_stack([coarse * 1e-3, 1.0 - coarse * 2e-3, 0.0 * coarse])
    scores.add("one", states(coarse, line + [1.0, 2.0, 3.0]))
    scores.add("other", states(coarse, line + 2.0))
    table = scores.rows("f", np.array([0, 600, 1000]))
    assert table.schema == SMOOTHED_SCHEMA
    found = {(row["set"], row["axis"], row["block"]): row for row in table.to_pylist()}
    assert len(found) == table.num_rows == 12
    assert {(row["flight"], row["source"]) for row in found.values()} == {("f", "gnss_vel")}
    for block, n in ((0, 12), (1, 8)):
        for axis, off in enumerate((1.0, 2.0, 3.0)):
            assert found["one", axis, block]["n"] == n
            assert found["one", axis, block]["sum_squares"] == pytest.approx(n * off**2, rel=1e-5)
            assert found["other", axis, block]["sum_squares"] == pytest.approx(n * 4.0, rel=1e-5)
            assert found["one", axis, block]["sum_squares_winsorised"] == pytest.approx(n * off**2, rel=1e-5)


def test_what_is_far_off_is_clipped_alike_for_all_sets() -> None:
    """All differences are ±1 but one of 100: the limit is 5 · 1.4826 times the median, 1, of both sets together."""
    signs = np.where(np.arange(TIME.size) % 2, 1.0, -1.0)[:, None] * np.ones(3)
    spoiled = signs.copy()
    spoiled[7] = 100.0
    scores = SmoothedScores(reference(np.zeros((TIME.size, 3))))
    scores.add("plain", states(TIME, signs))
    scores.add("spoiled", states(TIME, spoiled))
    rows = scores.rows("f", np.array([0, 1000])).to_pylist()
    sums = {(row["set"], row["axis"]): row["sum_squares_winsorised"] for row in rows}
    for axis in range(3):
        assert sums["plain", axis] == pytest.approx(20.0)
        assert sums["spoiled", axis] == pytest.approx(19.0 + (5.0 * 1.4826) ** 2, rel=1e-6)


def test_without_a_reference_there_are_no_rows() -> None:
    scores = SmoothedScores(None)
    scores.add("one", states(TIME, np.zeros((TIME.size, 3))))
    assert scores.rows("f", np.array([0, 1000])).num_rows == 0
