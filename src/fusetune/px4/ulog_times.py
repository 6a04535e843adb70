"""Which messages of a log have time stamps that cannot be: damage that ULog, which has no checksums, does not show.

Two rules tell them, both from how a logger works. It writes messages soon after they were published, so no message can
be much younger than the data that follow it in the file. And the messages of one topic come in order, so a single one
that stands out of those before and behind it is wrong. Old messages are no error: when logging starts, the last message
of every slow topic is written, whatever its age. The mission alone keeps the time of the flight that stored it.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeVar

import numpy as np

_MOST_OUT_OF_LINE_US = 1_000_000
_LATEST_US = 1 << 62
_MOST_AHEAD_US = 5_000_000
_FEWEST_CLOCK_ROWS = 100
"""A topic with fewer messages is no clock for the others."""
STORED_TOPICS = frozenset({"mission"})
"""Topics that outlive a restart of the autopilot with their time stamps."""

Key = TypeVar("Key", bound=Hashable)


def out_of_line(timestamps: np.ndarray) -> np.ndarray:
    """Single rows that stand ahead of, or behind, both their neighbours while these are in order, (rows,) bool.

    Parameters
    ----------
    timestamps
        (rows,) int64, µs, of one topic in the order of the file.
    """
    if not len(timestamps) or (timestamps[0] >= 0 and _in_order(timestamps, _LATEST_US)):
        return np.zeros(len(timestamps), np.bool_)
    wrong = (timestamps < 0) | (timestamps > _LATEST_US)
    timestamps = np.clip(timestamps, 0, _LATEST_US)
    if len(timestamps) < 3:
        return wrong
    before, here, after = timestamps[:-2], timestamps[1:-1], timestamps[2:]
    margin = _MOST_OUT_OF_LINE_US
    ahead, behind = here > after + margin, here < before - margin
    wrong[1:-1] |= (ahead | behind) & (after >= before)
    wrong[0] |= timestamps[0] > timestamps[1] + margin and timestamps[2] >= timestamps[1]
    wrong[-1] |= timestamps[-1] < timestamps[-2] - margin and not wrong[-2]
    return wrong


def impossible_rows(timestamps: Mapping[Key, np.ndarray], places: Mapping[Key, np.ndarray]) -> dict[Key, np.ndarray]:
    """Rows with impossible time stamps, of each topic instance that has any.

    Parameters
    ----------
    timestamps, places
        Of each topic instance: µs since boot, (rows,) int64, and where in the file each message lies, ascending.
    """
    if not timestamps:
        return {}
    wrong = {key: out_of_line(values) for key, values in timestamps.items()}
    reference = max(timestamps, key=lambda key: len(timestamps[key]))
    # behind the last message of the fastest topic nothing follows that would tell; its neighbour does
    if len(timestamps[reference]) > 1:
        wrong[reference][-1] |= timestamps[reference][-1] > timestamps[reference][-2] + _MOST_AHEAD_US
    kept = ~wrong[reference]
    clock, clock_places = timestamps[reference][kept], places[reference][kept]
    if len(clock) < _FEWEST_CLOCK_ROWS:
        return {key: rows for key, rows in wrong.items() if rows.any()}
    newest = int(clock.max()) + _MOST_AHEAD_US
    for key, values in timestamps.items():
        if key == reference or _in_order(values, newest):
            continue
        following = np.minimum(np.searchsorted(clock_places, places[key], side="right"), len(clock) - 1)
        wrong[key] |= values > clock[following] + _MOST_AHEAD_US
    return {key: rows for key, rows in wrong.items() if rows.any()}


def _in_order(timestamps: np.ndarray, newest: int) -> bool:
    return bool(timestamps[-1] <= newest and np.all(timestamps[1:] >= timestamps[:-1]))


def newest_before(
    query_places: np.ndarray, timestamps: Mapping[Key, np.ndarray], places: Mapping[Key, np.ndarray], start: int
) -> np.ndarray:
    """Newest time stamp of any message that lies before each place of a file; `start` where there is none."""
    result = np.full(len(query_places), start, np.int64)
    if not len(query_places):
        return result
    for key, values in timestamps.items():
        rows = np.searchsorted(places[key], query_places) - 1
        reached = rows >= 0
        newest = np.maximum.accumulate(values)
        result[reached] = np.maximum(result[reached], newest[rows[reached]])
    return result
