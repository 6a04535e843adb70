"""Sums of squared differences to the smoothed velocity, by hand."""

import numpy as np
import pytest

from fusetune.analyze.replaying.replayed_set import FilterStates
from fusetune.analyze.scoring.smoothed_scores import SMOOTHED_SCHEMA, SmoothedMask, smoothed_rows, velocity_differences
from fusetune.analyze.smoothing.error_model import ErrorModel
from fusetune.analyze.smoothing.smoothed_velocity import SmoothedVelocity

WHITE = ErrorModel(0.1, 0.0, 0.0, 0.01)
TIME = np.arange(0, 1000, 50, dtype=np.int64)


def reference(velocity: np.ndarray) -> SmoothedVelocity:
    return SmoothedVelocity("gnss_vel", TIME, velocity, WHITE, WHITE)


def states(time: np.ndarray, velocity: np.ndarray) -> FilterStates:
    ones = np.ones((time.size, 3))
    return FilterStates(time, np.ones((time.size, 4)), velocity, ones, ones, ones)


def rows_of(mask: SmoothedMask, name: str, other: FilterStates, edges: list[int]) -> dict[tuple[int, int], dict]:
    differences = velocity_differences(mask.reference, other)
    (table,) = smoothed_rows("f", {name: differences}, mask, np.array(edges))
    assert table.schema == SMOOTHED_SCHEMA
    found = {(row["axis"], row["block"]): row for row in table.to_pylist()}
    assert len(found) == table.num_rows
    assert {(row["flight"], row["set"], row["source"]) for row in found.values()} == {("f", name, "gnss_vel")}
    return found


def mask_of(velocity: np.ndarray, present: FilterStates) -> SmoothedMask:
    made = reference(velocity)
    return SmoothedMask(made, velocity_differences(made, present))


def test_sums_over_two_blocks() -> None:
    """One set, the present one, is off by (1, 2, 3) m/s, the other by 2 everywhere; blocks of 12 and 8 times."""
    truth = np.column_stack([TIME * 1e-3, 1.0 - TIME * 2e-3, 0.0 * TIME])
    # at other times than the reference's, between which the velocity is a straight line
    coarse = np.array([0, 1000])
    line = np.column_stack([coarse * 1e-3, 1.0 - coarse * 2e-3, 0.0 * coarse])
    one, other = states(coarse, line + [1.0, 2.0, 3.0]), states(coarse, line + 2.0)
    mask = mask_of(truth, one)
    found, beside = (rows_of(mask, name, of, [0, 600, 1000]) for name, of in (("one", one), ("other", other)))
    assert len(found) == 6
    for block, n in ((0, 12), (1, 8)):
        for axis, off in enumerate((1.0, 2.0, 3.0)):
            assert found[axis, block]["n"] == n
            assert found[axis, block]["sum_squares"] == pytest.approx(n * off**2, rel=1e-5)
            assert beside[axis, block]["sum_squares"] == pytest.approx(n * 4.0, rel=1e-5)
            assert found[axis, block]["sum_squares_winsorised"] == pytest.approx(n * off**2, rel=1e-5)


def test_what_is_far_off_is_clipped_at_the_present_sets_limit() -> None:
    """All differences are ±1 but one of 100: the limit is 5 · 1.4826 times the median, 1, of the present set's."""
    signs = np.where(np.arange(TIME.size) % 2, 1.0, -1.0)[:, None] * np.ones(3)
    spoiled = signs.copy()
    spoiled[7] = 100.0
    mask = mask_of(np.zeros((TIME.size, 3)), states(TIME, signs))
    plain, off = (rows_of(mask, "s", states(TIME, one), [0, 1000]) for one in (signs, spoiled))
    for axis in range(3):
        assert plain[axis, 0]["sum_squares_winsorised"] == pytest.approx(20.0)
        assert off[axis, 0]["sum_squares_winsorised"] == pytest.approx(19.0 + (5.0 * 1.4826) ** 2, rel=1e-6)
