"""Intervals of time, and where flags hold."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.analyze.flight.intervals import stretches


@pytest.mark.parametrize(
    ("flags", "expected"),
    [([], []), ([0, 0], []), ([1], [(0, 1)]), ([1, 1, 0, 1], [(0, 2), (3, 4)]), ([0, 1, 1, 0], [(1, 3)])],
)
def test_stretches_are_from_the_first_to_one_past_the_last(flags: list[int], expected: list[tuple[int, int]]) -> None:
    assert stretches(np.array(flags, np.bool_)) == expected
