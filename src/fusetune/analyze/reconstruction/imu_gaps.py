"""Rows that the logger left out of `sensor_combined`, filled so that neither time nor rotation is lost.

A row holds mean rate and specific force over the `gyro_integral_dt` that end at its time stamp. Where the windows of
two neighbours do not meet, rows are missing between them. They are given back at the interval of the log, with the
mean over each of their windows of the course that joins the neighbours, so that the integral over the gap is that of
the joined course and the integration times add up to the span of the log again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.analyze.reconstruction.gap_values import fill_missing
from fusetune.px4.flight import TopicTable, row_count

MISSING_SHARE = 0.5
"""Windows that miss each other by less than this share of the interval are jitter of the time stamps."""

MEANS = tuple(f"gyro_rad[{axis}]" for axis in range(3)) + tuple(f"accelerometer_m_s2[{axis}]" for axis in range(3))


@dataclass(frozen=True)
class ImuGaps:
    """Where rows are missing; arrays (G,)."""

    row: np.ndarray
    """Row before which the gap lies."""
    start: np.ndarray
    stop: np.ndarray
    """µs: end of the window before, start of the window after."""
    missing: np.ndarray
    """Number of rows that are missing."""

    @property
    def length_us(self) -> np.ndarray:
        return self.stop - self.start


def imu_interval_us(table: TopicTable) -> float:
    """Interval at which the IMU was integrated (µs): the median integration time."""
    return float(np.median(table["gyro_integral_dt"].astype(np.float64)))


def find_imu_gaps(table: TopicTable) -> ImuGaps:
    """Find the gaps between the integration windows of neighbouring rows."""
    time = table["timestamp"].astype(np.int64)
    window = table["gyro_integral_dt"].astype(np.int64)
    if len(time) < 2:
        nothing = np.zeros(0, np.int64)
        return ImuGaps(nothing, nothing, nothing, nothing)
    interval = imu_interval_us(table)
    open_us = (time[1:] - window[1:]) - time[:-1]
    row = np.flatnonzero(open_us > MISSING_SHARE * interval) + 1
    start, stop = time[row - 1], time[row] - window[row]
    missing = np.maximum(np.round((stop - start) / max(interval, 1.0)).astype(np.int64), 1)
    return ImuGaps(row, start, stop, missing)


def fill_imu_gaps(table: TopicTable, max_gap_s: float) -> tuple[TopicTable, np.ndarray]:
    """Fill the gaps of `sensor_combined`.

    Parameters
    ----------
    table : canonical `sensor_combined`
    max_gap_s : gaps that are longer stay as they are

    Returns
    -------
    The table, and for each of its rows whether it was measured. Without gaps the table is the one that was given.
    """
    gaps = find_imu_gaps(table)
    chosen = np.flatnonzero(gaps.length_us <= max_gap_s * 1e6)
    if not len(chosen):
        return table, np.ones(row_count(table), np.bool_)
    number = np.repeat(chosen, gaps.missing[chosen])
    place = np.concatenate([np.arange(1, count + 1) for count in gaps.missing[chosen]])
    step = gaps.length_us[number] / gaps.missing[number]
    start = np.round(gaps.start[number] + (place - 1) * step).astype(np.int64)
    stop = np.round(gaps.start[number] + place * step).astype(np.int64)
    where = gaps.row[number]
    present = np.insert(np.ones(row_count(table), np.bool_), where, False)
    filled = {}
    for name, values in table.items():
        if name == "timestamp":
            added = stop
        elif name in ("gyro_integral_dt", "accelerometer_integral_dt"):
            added = stop - start
        elif name in ("accelerometer_clipping", "gyro_clipping"):
            added = np.zeros(len(where))
        else:
            added = values[where - 1]
        filled[name] = np.insert(values, where, added.astype(values.dtype))
        if name in MEANS:
            filled[name][~present] = _estimated(filled[name].astype(np.float64), present)
    return filled, present


def _estimated(signal: np.ndarray, present: np.ndarray) -> np.ndarray:
    edges = np.diff(np.concatenate([[True], present, [True]]).astype(np.int8))
    first, stop = np.flatnonzero(edges == -1), np.flatnonzero(edges == 1)
    return fill_missing(signal, present, first, stop - first)
