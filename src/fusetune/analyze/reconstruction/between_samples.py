"""Rows placed evenly between those of a topic table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusetune.px4.flight import TopicTable, row_count

NewRows = tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]
"""Sample times (M,) µs of new rows, the row before which each is to stand (M,), and their values by column."""

RATE_SEARCH, RATE_STEPS = 0.2, 401
MIN_AGREEMENT, SAME_AGREEMENT, MIN_PHASES, MAX_PHASE_S = 0.9, 0.005, 16, 1.0


def logged_rate_hz(table: TopicTable | None) -> float | None:
    """Mean rate at which a topic was logged, None with fewer than two rows."""
    if table is None or row_count(table) < 2:
        return None
    span_s = float(table["timestamp"][-1] - table["timestamp"][0]) * 1e-6
    return (row_count(table) - 1) / span_s if span_s > 0.0 else None


def sensor_rate_hz(table: TopicTable, nominal_hz: float) -> float:
    """Rate at which a sensor was sampled, of which a thinned log holds some samples.

    The times between logged samples are multiples of the sensor's interval: of the rates within a fifth of the nominal
    one in which their phases agree best, the nearest to it is taken. Where they do not agree well in any, it is the
    nominal rate.
    """
    between_s = np.diff(table["timestamp_sample"].astype(np.float64)) * 1e-6
    between_s = between_s[(between_s > 1.5 / nominal_hz) & (between_s < MAX_PHASE_S)]
    if len(between_s) < MIN_PHASES:
        return nominal_hz
    rates = np.linspace((1.0 - RATE_SEARCH) * nominal_hz, (1.0 + RATE_SEARCH) * nominal_hz, RATE_STEPS)
    agreement = np.cos(2.0 * np.pi * rates[:, None] * between_s).mean(axis=1)
    if agreement.max() < MIN_AGREEMENT:
        return nominal_hz
    best = rates[agreement >= agreement.max() - SAME_AGREEMENT]
    return float(best[np.argmin(np.abs(best - nominal_hz))])


def interpolate(
    table: TopicTable,
    rate_hz: float,
    max_bridge_s: float,
    rows_at: Callable[[np.ndarray, np.ndarray, np.ndarray], NewRows],
) -> tuple[TopicTable, np.ndarray]:
    """Bring a topic to a higher rate.

    Parameters
    ----------
    rate_hz : samples are placed evenly between two measured ones, this many a second at most
    max_bridge_s : measured samples that are further apart stay as they are
    rows_at : makes the new rows, or those of them that can be known, of the sample times (N,) µs of the table, and the
        times and places of the new rows

    Returns
    -------
    The table, and for each of its rows whether it was measured.
    """
    time, place = insertion_times(table, rate_hz, max_bridge_s)
    if not len(time):
        return table, np.ones(row_count(table), np.bool_)
    return insert_rows(table, *rows_at(table["timestamp_sample"].astype(np.int64), time, place))


def share_of_way(sampled: np.ndarray, time: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Where new rows lie (M,) between the measured ones on either side: 0 at the row before, 1 at the row after."""
    return np.asarray((time - sampled[place - 1]) / (sampled[place] - sampled[place - 1]))


def insertion_times(table: TopicTable, rate_hz: float, max_bridge_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Sample times of new rows (M,) µs, and the row before which each is to stand (M,).

    Measured rows stay where they are, so that nothing is invented closer to them than the wanted interval.
    """
    sampled = table["timestamp_sample"].astype(np.int64)
    interval = np.diff(sampled)
    pieces = np.round(interval * 1e-6 * rate_hz).astype(np.int64)
    pieces[(interval > max_bridge_s * 1e6) | (interval <= 0)] = 1
    count = np.maximum(pieces - 1, 0)
    row = np.repeat(np.arange(1, len(sampled)), count)
    if not len(row):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    number = np.concatenate([np.arange(1, n + 1) for n in count if n > 0])
    time = sampled[row - 1] + number * (interval[row - 1] / pieces[row - 1])
    return np.round(time).astype(np.int64), row


def insert_rows(
    table: TopicTable, time: np.ndarray, place: np.ndarray, values: dict[str, np.ndarray]
) -> tuple[TopicTable, np.ndarray]:
    """Insert rows before the rows `place`: `values` where given, else what stands in the row before.

    A new row arrives as long after its sample time as its neighbours do on average.

    Returns
    -------
    The table, and for each of its rows whether it was measured.
    """
    published, sampled = table["timestamp"].astype(np.int64), table["timestamp_sample"].astype(np.int64)
    latency = published - sampled
    delay = (latency[place - 1] + latency[place]) // 2
    new = {"timestamp": time + delay, "timestamp_sample": time, **values}
    filled = {
        name: np.insert(column, place, (new[name] if name in new else column[place - 1]).astype(column.dtype))
        for name, column in table.items()
    }
    return filled, np.insert(np.ones(len(published), np.bool_), place, False)
