"""What a logged motion tells of the rows that are missing between two of its samples.

A motion that the vehicle integrated from every IMU sample changes, from one logged value to the next, by what the IMU
rows of the log integrate to, and by the filter's corrections. What the two differ by in an interval with a gap, beyond
what they differ by in the intervals around it without one, happened in the gap, or is a correction that came just then:
how far to believe it follows from how wrong filled rows are, and how much corrections scatter at the time.
"""

from __future__ import annotations

import numpy as np

BASELINE_INTERVALS = 3
"""Intervals on each side that tell what the two differ by anyway: corrections take tenths of a second."""

SCATTER_INTERVALS = 6
"""Intervals on each side that tell how much this scatters: a manoeuvre, or a reset, brings larger corrections."""

MIN_INTERVALS = 20


def surplus_rate(
    difference: np.ndarray,
    edges: np.ndarray,
    usable: np.ndarray,
    window: tuple[np.ndarray, np.ndarray],
    filled: np.ndarray,
    fill_variance: np.ndarray,
) -> np.ndarray | None:
    """Mean rate by which the logged motion exceeds the integrated one in each filled row.

    It is weighed by how well it is told (Wiener): variance of the filled rows' error over the sum of that and of the
    scatter of the differences in the intervals around without a gap.

    Parameters
    ----------
    difference : (K, 3) logged less integrated change over each interval
    edges : (K + 1,) µs, times of the logged values
    usable : (K,) intervals that tell anything
    window : start and stop (N,) µs of the rows
    filled : (N,) whether a row was missing
    fill_variance : (3,) variance of the change in the filled rows, per second of gap

    Returns
    -------
    (N, 3) per second, zero in measured rows; None where the log tells too little.
    """
    length = np.diff(edges).astype(np.float64)
    row, interval, overlap = _overlaps(*window, filled, edges)
    missing = np.bincount(interval, overlap, len(length))
    clean, broken = usable & (missing == 0.0), usable & (missing > 0.0)
    if clean.sum() < MIN_INTERVALS or not broken.any():
        return None
    surplus = difference - _baseline(difference, length, clean) * length[:, None]
    expected = fill_variance * missing[:, None] * 1e-6
    trust = expected / np.maximum(expected + _scatter(surplus, clean), 1e-30)
    rate = np.where(broken[:, None], trust * surplus / np.maximum(missing, 1.0)[:, None] * 1e6, 0.0)
    lasting = np.maximum(window[1] - window[0], 1)
    columns = [np.bincount(row, rate[interval, axis] * overlap, len(lasting)) / lasting for axis in range(3)]
    return np.stack(columns, axis=1)


def _overlaps(
    start: np.ndarray, stop: np.ndarray, filled: np.ndarray, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Filled row, interval between two logged attitudes, and how long (µs) they overlap; a row meets two at most."""
    rows = np.flatnonzero(filled)
    first = np.searchsorted(edges, start[rows], side="right") - 1
    pairs = [(rows, first), (rows, first + 1)]
    row, interval = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    inside = (interval >= 0) & (interval < len(edges) - 1)
    row, interval = row[inside], interval[inside]
    overlap = np.minimum(stop[row], edges[interval + 1]) - np.maximum(start[row], edges[interval])
    return row[overlap > 0], interval[overlap > 0], overlap[overlap > 0].astype(np.float64)


def _baseline(difference: np.ndarray, length: np.ndarray, clean: np.ndarray) -> np.ndarray:
    """Mean rate (K, 3) at which the two differ in the clean intervals around each interval, itself left out."""
    lasting = np.where(clean, length, 0.0)
    change = np.where(clean[:, None], difference, 0.0)
    total = _sum_around(lasting[:, None], BASELINE_INTERVALS) - lasting[:, None]
    around = (_sum_around(change, BASELINE_INTERVALS) - change) / np.maximum(total, 1.0)
    return np.where(total > 0.0, around, change.sum(axis=0) / lasting.sum())


def _scatter(surplus: np.ndarray, clean: np.ndarray) -> np.ndarray:
    """Mean square (K, 3) of the surplus in clean intervals around; the mean of all counts as one interval more."""
    squares = np.where(clean[:, None], surplus**2, 0.0)
    mean = squares.sum(axis=0) / clean.sum()
    count = _sum_around(clean.astype(np.float64)[:, None], SCATTER_INTERVALS)
    return (_sum_around(squares, SCATTER_INTERVALS) + mean) / (count + 1.0)


def _sum_around(values: np.ndarray, reach: int) -> np.ndarray:
    """Sum (K, D) over each interval and `reach` of its neighbours on each side."""
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    position = np.arange(len(values))
    return sums[np.minimum(position + reach + 1, len(values))] - sums[np.maximum(position - reach, 0)]
