"""What a logged motion tells of the rows that are missing between two of its samples.

A motion that the vehicle integrated from every IMU sample changes, from one logged value to the next, by what the IMU
rows of the log integrate to, and by the filter's small corrections. What the two differ by in an interval with a gap,
beyond what they differ by in the intervals around it without one, happened in the gap.
"""

from __future__ import annotations

import numpy as np

BASELINE_INTERVALS = 5
"""Intervals on each side that tell what the two differ by anyway."""

MIN_INTERVALS = 20
MIN_BASELINE = 2
MEDIAN_OF_NORMAL = 0.6745


def surplus_rate(
    difference: np.ndarray,
    edges: np.ndarray,
    usable: np.ndarray,
    window: tuple[np.ndarray, np.ndarray],
    filled: np.ndarray,
) -> np.ndarray | None:
    """Mean rate by which the logged motion exceeds the integrated one in each filled row.

    It is weighed by how well it is told: variance of the differences in intervals with a gap, beyond that in intervals
    without, over the former.

    Parameters
    ----------
    difference : (K, 3) logged less integrated change over each interval
    edges : (K + 1,) µs, times of the logged values
    usable : (K,) intervals that tell anything
    window : start and stop (N,) µs of the rows
    filled : (N,) whether a row was missing

    Returns
    -------
    (N, 3) per second, zero in measured rows; None where the log tells too little.
    """
    length = np.diff(edges)
    row, interval, overlap = _overlaps(*window, filled, edges)
    missing = np.bincount(interval, overlap, len(length))
    clean, broken = usable & (missing == 0.0), usable & (missing > 0.0)
    if clean.sum() < MIN_INTERVALS or not broken.any():
        return None
    surplus = difference - _baseline(difference / length[:, None], clean) * length[:, None]
    noise, total = (_robust_variance(surplus[some]) for some in (clean, broken))
    trust = np.clip(1.0 - noise / np.maximum(total, 1e-30), 0.0, 1.0)
    rate = np.where(broken[:, None], trust * surplus / np.maximum(missing, 1.0)[:, None] * 1e6, 0.0)
    lasting = np.maximum(window[1] - window[0], 1)
    columns = [np.bincount(row, rate[interval, axis] * overlap, len(lasting)) / lasting for axis in range(3)]
    return np.stack(columns, axis=1)


def _robust_variance(values: np.ndarray) -> np.ndarray:
    """Variance (3,) from the median absolute value, which single jumps do not move."""
    return (np.median(np.abs(values), axis=0) / MEDIAN_OF_NORMAL) ** 2


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


def _baseline(rate: np.ndarray, clean: np.ndarray) -> np.ndarray:
    """Mean rate (N, 3) at which gyro and attitude differ in the clean intervals around each interval."""
    sums = np.vstack([np.zeros(3), np.cumsum(np.where(clean[:, None], rate, 0.0), axis=0)])
    counts = np.concatenate([[0], np.cumsum(clean)])
    position = np.arange(len(rate))
    low = np.maximum(position - BASELINE_INTERVALS, 0)
    high = np.minimum(position + BASELINE_INTERVALS + 1, len(rate))
    number = counts[high] - counts[low]
    local = (sums[high] - sums[low]) / np.maximum(number, 1)[:, None]
    return np.where(number[:, None] >= MIN_BASELINE, local, sums[-1] / max(counts[-1], 1))
