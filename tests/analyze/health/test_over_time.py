"""Flags and series over time, on cases worked out by hand and by properties."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.analyze.health.over_time import longest_between, share_of, silences, time_set, worst_mean

S = 1_000_000


def test_a_flag_holds_until_its_next_row_and_counts_within_the_intervals():
    time = np.array([0, 2, 5, 6]) * S
    found = time_set(time, np.array([False, True, False, True]), 10 * S, ((1 * S, 4 * S), (7 * S, 9 * S)))
    # from 2 to 4 and from 7 to 9
    assert found == (4.0, (2 * S, 9 * S))
    assert share_of(found.value, ((1 * S, 4 * S), (7 * S, 9 * S))) == pytest.approx(0.8)
    assert time_set(time, np.zeros(4, bool), 10 * S, ((0, 10 * S),)) == (0.0, None)
    assert time_set(time[:0], np.zeros(0, bool), 10 * S, ((0, 10 * S),)).value == 0.0


def test_the_worst_stretch_is_found_where_it_is():
    time, values = np.arange(100) * S, np.zeros(100)
    values[40:50] = 1.0
    worst = worst_mean(time, values, 20.0, ((0, 100 * S),))
    assert worst.value == pytest.approx(0.5)
    assert worst.when == (31 * S, 51 * S) or worst.when == (30 * S, 50 * S)


def test_of_an_interval_shorter_than_the_stretch_the_whole_counts():
    time, values = np.arange(10) * S, np.arange(10.0)
    worst = worst_mean(time, values, 30.0, ((2 * S, 6 * S),))
    assert worst == (3.5, (2 * S, 6 * S))


@given(
    st.lists(st.tuples(st.integers(0, 60), st.floats(0.0, 5.0)), min_size=1, max_size=40),
    st.integers(1, 20),
)
def test_the_worst_stretch_lies_between_the_mean_and_the_largest(rows, length):
    time = np.sort(np.array([one for one, _ in rows])) * S
    values = np.array([one for _, one in rows])
    worst = worst_mean(time, values, float(length), ((0, 61 * S),))
    assert worst.value <= values.max() + 1e-9
    assert worst.when is not None
    assert 0 < worst.when[1] - worst.when[0] <= length * S


def test_the_longest_time_between_counts_the_ends_of_each_interval():
    time = np.array([1, 2, 9, 21]) * S
    assert longest_between(time, ((0, 10 * S),)) == (7.0, (2 * S, 9 * S))
    assert longest_between(time, ((0, 10 * S), (20 * S, 30 * S))) == (9.0, (21 * S, 30 * S))
    assert longest_between(time[:0], ((0, 3 * S),)).value == 3.0


def test_silence_is_told_by_how_often_there_is_something():
    seconds = np.r_[np.arange(0.0, 10.0, 0.5), np.arange(14.0, 20.0, 0.5)]
    (cut,) = silences((seconds * S).astype(np.int64), (1.0, 3.0))
    assert (cut.start, cut.stop) == (int(9.5 * S), 14 * S)
    # twice a second misses two now and then; once in ten seconds is nothing at all
    assert not silences((np.array([0.0, 0.5, 1.0, 2.4]) * S).astype(np.int64), (1.0, 3.0))
    assert len(silences(np.array([0, 10, 20]) * S, (1.0, 3.0))) == 2
