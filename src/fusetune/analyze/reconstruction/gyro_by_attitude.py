"""How the vehicle turned while IMU rows are missing, as the logged attitude tells.

The vehicle's own attitude is integrated from every IMU sample, those that the log lacks among them. From one logged
attitude to the next it turns by the integral of the gyro, less the bias, and by the filter's small corrections. What
the two differ by in an interval with a gap, beyond what they differ by in intervals without, was turned in the gap.
"""

from __future__ import annotations

import numpy as np

from fusetune.analyze.reconstruction.attitude import (
    attitude_at,
    conjugate,
    integrated_gyro,
    logged_attitude,
    multiply,
    rotation_vector,
)
from fusetune.px4.flight import TopicTable

BASELINE_INTERVALS = 5
"""Intervals without a gap, on each side, that tell what the gyro and the attitude differ by anyway."""

MIN_INTERVALS = 20
MEDIAN_OF_NORMAL = 0.6745
MAX_INTERVAL_US = 250_000


def correct_gyro(table: TopicTable, present: np.ndarray, attitude: TopicTable | None) -> TopicTable:
    """Correct the rates of filled rows so that the rotation over each gap is that of the logged attitude.

    The correction is weighed by how well the attitude tells it: variance of the differences in intervals with a gap,
    beyond that in intervals without, over the former.

    Parameters
    ----------
    table : `sensor_combined`, its gaps filled
    present : for each row whether it was measured
    attitude : `vehicle_attitude`; without one the table is returned as it is
    """
    if attitude is None or present.all():
        return table
    time = table["timestamp"].astype(np.int64)
    logged_time, logged = logged_attitude(attitude, time)
    if len(logged_time) < MIN_INTERVALS:
        return table
    turned = attitude_at(time, integrated_gyro(table), logged_time)
    difference = rotation_vector(multiply(conjugate(_steps(turned)), _steps(logged)))
    length = np.diff(logged_time)
    window = table["gyro_integral_dt"].astype(np.int64)
    row, interval, overlap = _overlaps(time - window, time, ~present, logged_time)
    missing = np.bincount(interval, overlap, len(length))
    usable = (length <= MAX_INTERVAL_US) & ~_has_reset(attitude, logged_time)
    clean, broken = usable & (missing == 0.0), usable & (missing > 0.0)
    if clean.sum() < MIN_INTERVALS or not broken.any():
        return table
    surplus = difference - _baseline(difference / length[:, None], clean) * length[:, None]
    noise, total = (_robust_variance(surplus[some]) for some in (clean, broken))
    trust = np.clip(1.0 - noise / np.maximum(total, 1e-30), 0.0, 1.0)
    rate = np.where(broken[:, None], trust * surplus / np.maximum(missing, 1.0)[:, None] * 1e6, 0.0)
    corrected = dict(table)
    for axis in range(3):
        name = f"gyro_rad[{axis}]"
        added = np.bincount(row, rate[interval, axis] * overlap, len(time)) / np.maximum(window, 1)
        corrected[name] = (table[name] + added).astype(table[name].dtype)
    return corrected


def _has_reset(attitude: TopicTable, logged_time: np.ndarray) -> np.ndarray:
    """Whether the filter reset its attitude in an interval; releases without the counter do not tell."""
    counter = attitude.get("quat_reset_counter")
    if counter is None:
        return np.zeros(len(logged_time) - 1, np.bool_)
    published = attitude["timestamp"].astype(np.int64)
    at = counter[np.clip(np.searchsorted(published, logged_time), 0, len(counter) - 1)].astype(np.int64)
    return np.diff(at) != 0


def _steps(q: np.ndarray) -> np.ndarray:
    """Rotation from each attitude to the next, in the body frame."""
    return multiply(conjugate(q[:-1]), q[1:])


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
    return np.where(number[:, None] >= 2, local, sums[-1] / max(counts[-1], 1))
