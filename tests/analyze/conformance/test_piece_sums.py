"""Sums of stretches are, bit for bit, NumPy's sums of the rows alone; ascending times lie where each of them lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.analyze.conformance.flight_pieces import FlightPieces
from fusetune.analyze.conformance.piece_sums import Stretches


@pytest.mark.parametrize("is_shuffled", [False, True])
def test_each_sum_is_that_of_its_rows_alone(is_shuffled: bool) -> None:
    generator = np.random.default_rng(4)
    count = np.array([1, 7, 200, 1000, 33])
    one, other = np.repeat([0, 0, 1, 1, 2], count), np.repeat([-1, 3, -1, 3, 3], count)
    values = generator.standard_normal(count.sum())
    if is_shuffled:
        order = generator.permutation(values.size)
        one, other, values = one[order], other[order], values[order]
    rows = Stretches.of(one, other).only(np.array([False, True, True, True, True]))
    sums = rows.sums(np.exp(rows.laid_out(values, 0.0)))
    expected = [np.exp(values[(one == a) & (other == b)]).sum() for a, b in ((0, 3), (1, -1), (1, 3), (2, 3))]
    assert sums.tolist() == expected
    assert rows.count.tolist() == [7, 200, 1000, 33]
    assert one[rows.first].tolist() == [0, 1, 1, 2]


@settings(max_examples=60, deadline=None)
@given(
    times=st.lists(st.lists(st.integers(0, 60), min_size=1, max_size=30).map(sorted), max_size=4),
    edges=st.lists(st.integers(0, 60), min_size=0, max_size=6, unique=True).map(sorted),
)
def test_ascending_times_are_in_the_pieces_that_each_is_in(times: list[list[int]], edges: list[int]) -> None:
    starts, stops = np.array(edges[: len(edges) // 2 * 2 : 2], np.int64), np.array(edges[1::2], np.int64)
    pieces = FlightPieces("", starts, stops, ("hover",) * starts.size, np.full(starts.size, -1))
    time = np.array([one for part in times for one in part], np.int64)
    bounds = list(zip(starts, stops, strict=True))
    expected = [next((i for i, (a, b) in enumerate(bounds) if a <= one < b), -1) for one in time.tolist()]
    assert pieces.at_ascending(time).tolist() == pieces.at(time).tolist() == expected
