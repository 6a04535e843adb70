"""What of a long line is drawn."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fusetune.report.figures.drawing import drawn_rows


@given(st.integers(0, 30_000), st.integers(0, 29_999), st.integers(0, 29_999))
def test_a_spike_of_one_sample_is_drawn_however_long_the_line(size: int, up: int, down: int) -> None:
    values = np.zeros(size, np.float32)
    if up < size and down < size:
        values[up], values[down] = 3.0, -2.0
    rows = drawn_rows(values)
    assert rows.size <= 4004
    assert np.all(np.diff(rows) > 0)
    if size:
        assert (rows[0], rows[-1]) == (0, size - 1)
        assert (values[rows].max(), values[rows].min()) == (values.max(), values.min())


def test_a_gap_hides_no_spike() -> None:
    values = np.full(20_000, np.nan)
    values[5000:15_000] = 1.0
    values[7777] = 9.0
    assert np.nanmax(values[drawn_rows(values)]) == 9.0
