"""Values once each, and the rows of each: the expected ones are those of sets and of comparisons."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fusetune.analyze.metrics.grouping import distinct, rows_of

NUMBERS = st.lists(st.integers(-5, 5), max_size=30).map(lambda values: np.array(values, np.int64))


@given(NUMBERS)
def test_each_value_is_there_once_in_order(values: np.ndarray) -> None:
    assert distinct(values).tolist() == sorted({*values.tolist()})


@given(NUMBERS, NUMBERS)
def test_rows_are_those_that_hold_a_number(number: np.ndarray, wanted: np.ndarray) -> None:
    expected = [np.flatnonzero(number == one).tolist() for one in wanted]
    assert [own.tolist() for own in rows_of(number, wanted)] == expected
