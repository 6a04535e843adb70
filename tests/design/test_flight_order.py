"""The order of flights: every set in every block, every set after every other one."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.design.flight_order import flight_order, williams_rows


def test_the_square_of_four_is_that_of_the_literature() -> None:
    """Williams 1949: 0 1 3 2 and its shifts."""
    assert williams_rows(4) == [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]


@pytest.mark.parametrize("count", range(2, 10))
def test_every_set_follows_every_other_equally_often_and_stands_everywhere(count: int) -> None:
    rows = williams_rows(count)
    follows = Counter(pair for row in rows for pair in pairwise(row))
    often = 1 if count % 2 == 0 else 2
    assert len(rows) == often * count
    assert follows == {(a, b): often for a in range(count) for b in range(count) if a != b}
    for place in range(count):
        assert Counter(row[place] for row in rows) == dict.fromkeys(range(count), often)


@given(st.integers(2, 8), st.integers(1, 30), st.integers(0, 99))
def test_each_block_holds_each_set_once_and_more_blocks_leave_the_first(count: int, blocks: int, seed: int) -> None:
    sets = [f"set{index}" for index in range(count)]
    order = flight_order(sets, blocks, seed)
    assert all(sorted(block) == sets for block in order)
    assert flight_order(sets, blocks + 5, seed)[:blocks] == order


def test_another_seed_is_another_order() -> None:
    assert flight_order("abcdef", 6, 1) != flight_order("abcdef", 6, 2)
