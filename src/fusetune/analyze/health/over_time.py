"""Figures of what is logged now and then: how long a flag was set, and the worst stretch of a series."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Cut, Interval, duration

Times = npt.NDArray[np.int64]


class Stretch(NamedTuple):
    """A figure of a part of the flight, and the part, µs; None where there is none."""

    value: float
    when: Interval | None


def at(time: int) -> Interval:
    """A single time, µs, as an interval."""
    return int(time), int(time) + 1


def span(times: Times) -> Interval | None:
    """From the first to the last of some times (N,), µs; None without any."""
    return (int(times[0]), int(times[-1]) + 1) if times.size else None


def time_set(time: Times, values: npt.NDArray[np.bool_], last_time: int, within: Sequence[Interval]) -> Stretch:
    """For how many seconds a flag was set that holds until its next row, and from when to when.

    Parameters
    ----------
    time : (N,) µs, ascending
    values : (N,) bool
    last_time : until when the last one holds, µs
    within : where it counts, µs
    """
    stops = np.r_[time[1:], max(last_time, int(time[-1]))] if time.size else time
    starts, stops = time[values], stops[values]
    total, first, last = 0, None, None
    for begin, end in within:
        overlap = np.minimum(stops, end) - np.maximum(starts, begin)
        met = overlap > 0
        if met.any():
            total += int(overlap[met].sum())
            first = max(int(starts[met][0]), begin) if first is None else first
            last = min(int(stops[met][-1]), end)
    return Stretch(total * 1e-6, None if first is None or last is None else (first, last))


def share_of(seconds: float, within: Sequence[Interval]) -> float:
    """Share of some intervals; no number where they have no length."""
    whole = duration(within) * 1e-6
    return seconds / whole if whole > 0.0 else float("nan")


def worst_mean(time: Times, values: npt.NDArray[np.float64], length_s: float, within: Iterable[Interval]) -> Stretch:
    """Largest mean over stretches of some length; of intervals that are shorter, over the whole of them.

    Parameters
    ----------
    time, values : (N,) µs, ascending, and what is averaged; N > 0
    """
    length = int(length_s * 1e6)
    sums = np.r_[0.0, np.cumsum(values)]
    worst = Stretch(-np.inf, None)
    for begin, end in within:
        first, behind = np.searchsorted(time, (begin, end))
        if behind <= first:
            continue
        starts = time[first:behind]
        starts = starts[starts + length <= max(end, int(starts[0]) + length)]
        begins = np.searchsorted(time, starts)
        ends = np.minimum(np.searchsorted(time, starts + length), behind)
        means = (sums[ends] - sums[begins]) / (ends - begins)
        row = int(np.argmax(means))
        if means[row] > worst.value:
            worst = Stretch(float(means[row]), (int(starts[row]), min(int(starts[row]) + length, end)))
    return worst


def silences(time: Times, between_s: tuple[float, float]) -> tuple[Cut, ...]:
    """Times without any of some events for longer than three times their usual interval.

    Parameters
    ----------
    time : (N,) µs, ascending
    between_s : shortest and longest such time, whatever is usual
    """
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else 0.0
    wide = np.flatnonzero(steps > np.clip(3.0 * usual, between_s[0] * 1e6, between_s[1] * 1e6))
    return tuple(Cut(int(time[row]), int(time[row + 1]), "nothing is logged") for row in wide)


def longest_between(time: Times, within: Iterable[Interval]) -> Stretch:
    """Longest time without an event in some intervals, from their begin and to their end as well, s."""
    longest = Stretch(0.0, None)
    for begin, end in within:
        edges = np.r_[begin, time[(time >= begin) & (time < end)], end]
        steps = np.diff(edges)
        row = int(np.argmax(steps))
        if steps[row] * 1e-6 > longest.value:
            longest = Stretch(float(steps[row]) * 1e-6, (int(edges[row]), int(edges[row + 1])))
    return longest
