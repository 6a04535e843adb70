"""A thinned series keeps its peaks, its ends, its gaps and what is flagged, whatever the series."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusetune.report.flight_data.thinning import kept_rows

FIGURES = st.floats(width=32, allow_infinity=False) | st.just(float("nan"))
SERIES = arrays(np.float32, st.integers(1, 300), elements=FIGURES)


@settings(max_examples=150, deadline=None)
@given(SERIES, st.integers(2, 40))
def test_no_peak_is_lost(values: np.ndarray, buckets: int) -> None:
    """Every stretch of ⌈N / buckets⌉ samples keeps its smallest and its largest, so no zoom level lacks one."""
    rows = kept_rows(values, buckets)
    assert np.all(np.diff(rows) > 0)
    assert rows[0] == 0
    assert rows[-1] == len(values) - 1
    size = -(-len(values) // buckets)
    for start in range(0, len(values), size):
        part = values[start : start + size]
        kept = values[rows[(rows >= start) & (rows < start + size)]]
        if np.isnan(part).all():
            assert len(values) <= 2 * buckets or kept.size
            continue
        assert np.nanmin(kept) == np.nanmin(part)
        assert np.nanmax(kept) == np.nanmax(part)


@settings(max_examples=150, deadline=None)
@given(SERIES, st.integers(2, 40))
def test_few_samples_stay_and_all_where_there_are_few(values: np.ndarray, buckets: int) -> None:
    rows = kept_rows(values, buckets)
    if len(values) <= 2 * buckets:
        assert rows.tolist() == list(range(len(values)))
    # two of each bucket, two ends, and two at each side of what is NaN
    assert len(rows) <= 2 * buckets + 2 + 2 * buckets


@settings(max_examples=150, deadline=None)
@given(
    st.integers(100, 300), st.lists(st.tuples(st.integers(0, 299), st.integers(1, 30)), max_size=4), st.integers(8, 40)
)
def test_a_gap_stays_a_gap(count: int, gaps: list[tuple[int, int]], buckets: int) -> None:
    """Between samples that had NaN between them there is NaN, and a line goes up to the gap's edges."""
    values = np.sin(np.arange(float(count)))
    for start, length in gaps:
        values[start : start + length] = np.nan
    rows = kept_rows(values, buckets)
    known = rows[np.isfinite(values[rows])]
    for left, right in itertools.pairwise(known):
        had_gap = bool(np.isnan(values[left : right + 1]).any())
        assert had_gap == bool(np.isnan(values[rows[(rows > left) & (rows < right)]]).any())
    edges = np.flatnonzero(np.diff(np.isnan(values)))
    assert set(edges) | set(edges + 1) <= set(rows)


@settings(max_examples=100, deadline=None)
@given(arrays(np.float64, 200, elements=st.floats(-1e3, 1e3)), st.sets(st.integers(0, 199), max_size=60))
def test_what_was_rejected_stays_up_to_a_limit(values: np.ndarray, rejected: set[int]) -> None:
    flags = np.isin(np.arange(200), list(rejected))
    rows = kept_rows(values, 20, flagged=flags)
    if len(rejected) <= 40:
        assert rejected <= set(rows.tolist())
    else:
        kept = values[[row for row in rows if flags[row]]]
        assert kept.min() == values[flags].min()
        assert kept.max() == values[flags].max()


def test_the_largest_of_another_column_stays_too() -> None:
    """A test ratio has its peak where the variance is small, not where the innovation is large."""
    innovation = np.tile([0.1, -0.1], 100)
    ratio = np.zeros(200)
    ratio[77] = 4.0
    assert 77 not in kept_rows(innovation, 5)
    assert 77 in kept_rows(innovation, 5, peaks=(ratio,))
