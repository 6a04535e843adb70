"""Which messages of a log have time stamps that cannot be: damage that ULog, which has no checksums, does not show.

Two rules tell them, both from how a logger works. It writes messages soon after they were published, so no message can
be much younger than the data that follow it in the file. And the messages of one topic come in order, so a single one
that stands out of those before and behind it is wrong. Old messages are no error: when logging starts, the last message
of every slow topic is written, whatever its age. The mission alone keeps the time of the flight that stored it.

The clock of a flight is a topic that is logged often, whose time advances, and which most of the other topics agree
with. Topics without time stamps of their own, with those of another clock, or with one that runs backward, outnumber
the IMU in some logs. They are left out where they stand in the future, or are needed; else they stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import NamedTuple, TypeVar

import numpy as np

_MOST_OUT_OF_LINE_US = 1_000_000
_LATEST_US = 1 << 62
_MOST_AHEAD_US = 5_000_000
_FEWEST_CLOCK_ROWS = 100
"""A topic with fewer messages is no clock for the others, and too few to tell that it has another clock."""
_SMALL_TOPIC_ROWS = 4096
_MOST_CANDIDATES, _MOST_VOTERS, _MOST_ROWS_ASKED = 8, 64, 64
_SMALLEST_FORWARD_SHARE, _SMALLEST_ADVANCING_SHARE = 0.9, 0.5
IMPOSSIBLE, ANOTHER_CLOCK = "impossible time stamp", "time stamps of another clock, or none"
STORED_TOPICS = frozenset({"mission"})
"""Topics that outlive a restart of the autopilot with their time stamps."""

Key = TypeVar("Key", bound=Hashable)


class ImpossibleRows(NamedTuple):
    """Rows of a topic instance whose time cannot be, (rows,) bool, and why."""

    rows: np.ndarray
    reason: str


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


def clock_of(
    timestamps: Mapping[Key, np.ndarray],
    places: Mapping[Key, np.ndarray],
    preferred: Key,
    trusted: Callable[[Key], bool] = lambda _: True,
) -> Key | None:
    """The topic instance by whose time stamps the others are judged; None where none is fit for it.

    Parameters
    ----------
    timestamps, places
        As `impossible_rows`.
    preferred
        The one to take if half of the others agree with it.
    trusted
        Whose agreement counts, where there are any such topics.
    """
    fit = [key for key, values in timestamps.items() if len(values) >= _FEWEST_CLOCK_ROWS and _advances(values)]
    fit.sort(key=lambda key: (key != preferred, -len(timestamps[key])))
    voters = [key for key in fit if trusted(key)][:_MOST_VOTERS] or fit[:_MOST_VOTERS]

    def votes(key: Key) -> int:
        return sum(not _by_another_clock(timestamps, places, one, key) for one in voters)

    if preferred in fit and 2 * votes(preferred) >= len(voters):
        return preferred
    # of equal ones the first, which is logged most often
    return max(fit[:_MOST_CANDIDATES], key=votes, default=None)


def _advances(timestamps: np.ndarray) -> bool:
    """Whether time goes forward all in all, as damage of single messages leaves it."""
    steps = np.diff(np.clip(timestamps, 0, _LATEST_US))
    forward, advancing = float(np.mean(steps >= 0)), float(np.mean(steps > 0))
    return forward >= _SMALLEST_FORWARD_SHARE and advancing >= _SMALLEST_ADVANCING_SHARE


def _by_another_clock(
    timestamps: Mapping[Key, np.ndarray], places: Mapping[Key, np.ndarray], key: Key, clock: Key
) -> bool:
    """Whether most messages of a topic are of another time than what lies beside them in the file."""
    asked = np.unique(np.linspace(0, len(timestamps[key]) - 1, _MOST_ROWS_ASKED).astype(np.int64))
    beside = np.minimum(np.searchsorted(places[clock], places[key][asked]), len(places[clock]) - 1)
    apart = np.abs(np.clip(timestamps[key][asked], 0, _LATEST_US) - np.clip(timestamps[clock][beside], 0, _LATEST_US))
    return bool(np.mean(apart > _MOST_AHEAD_US) > 0.5)


def impossible_rows(
    timestamps: Mapping[Key, np.ndarray],
    places: Mapping[Key, np.ndarray],
    clock: Key | None,
    needed: Callable[[Key], bool] = lambda _: False,
) -> dict[Key, ImpossibleRows]:
    """Rows with impossible time stamps, of each topic instance that has any.

    Parameters
    ----------
    timestamps, places
        Of each topic instance: µs since boot, (rows,) int64, and where in the file each message lies, ascending.
    clock
        As `clock_of` tells.
    needed
        Topics that are of no use with the time stamps of another clock.
    """
    wrong = {key: out_of_line(values) for key, values in timestamps.items()}
    if clock is None:
        return _any_of(wrong, IMPOSSIBLE)
    # behind the last message of the clock nothing follows that would tell; its neighbour does
    wrong[clock][-1] |= timestamps[clock][-1] > timestamps[clock][-2] + _MOST_AHEAD_US
    kept = ~wrong[clock]
    now, now_places = timestamps[clock][kept], places[clock][kept]
    newest = int(now.max()) + _MOST_AHEAD_US
    strangers = {}
    for key, values in timestamps.items():
        if key == clock:
            continue
        is_stranger = len(values) >= _FEWEST_CLOCK_ROWS and _is_stranger(timestamps, places, key, clock)
        if is_stranger and (needed(key) or int(np.median(values)) > newest):
            strangers[key] = np.ones(len(values), np.bool_)
        elif not _in_order(values, newest):
            following = np.minimum(np.searchsorted(now_places, places[key], side="right"), len(now) - 1)
            wrong[key] |= values > now[following] + _MOST_AHEAD_US
    return _any_of(wrong, IMPOSSIBLE) | _any_of(strangers, ANOTHER_CLOCK)


def _is_stranger(timestamps: Mapping[Key, np.ndarray], places: Mapping[Key, np.ndarray], key: Key, clock: Key) -> bool:
    """Whether a topic of many messages does not live by the clock of the flight."""
    values = timestamps[key]
    if values[0] == values[-1] and np.all(values == values[0]):
        first, last = np.searchsorted(places[clock], places[key][[0, -1]])
        passed = timestamps[clock][min(last, len(places[clock]) - 1)] - timestamps[clock][first - (first > 0)]
        if passed > _MOST_OUT_OF_LINE_US:
            return True
    return _by_another_clock(timestamps, places, key, clock)


def _any_of(wrong: Mapping[Key, np.ndarray], reason: str) -> dict[Key, ImpossibleRows]:
    return {key: ImpossibleRows(rows, reason) for key, rows in wrong.items() if rows.any()}


def _in_order(timestamps: np.ndarray, newest: int) -> bool:
    return bool(timestamps[-1] <= newest and np.all(timestamps[1:] >= timestamps[:-1]))


def newest_before(
    query_places: np.ndarray, timestamps: Mapping[Key, np.ndarray], places: Mapping[Key, np.ndarray], start: int
) -> np.ndarray:
    """Newest time stamp of any message that lies before each place of a file; `start` where there is none."""
    result = np.full(len(query_places), start, np.int64)
    if not len(query_places):
        return result
    # small topics are put together, so that thousands of them cost no more than one; large ones would take the memory
    small = [key for key, values in timestamps.items() if len(values) < _SMALL_TOPIC_ROWS]
    parts = [(places[key], values) for key, values in timestamps.items() if len(values) >= _SMALL_TOPIC_ROWS]
    if small:
        together = np.concatenate([places[key] for key in small])
        order = np.argsort(together)
        parts.append((together[order], np.concatenate([timestamps[key] for key in small])[order]))
    for part_places, values in parts:
        rows = np.searchsorted(part_places, query_places) - 1
        reached = rows >= 0
        newest = np.maximum.accumulate(values)
        result[reached] = np.maximum(result[reached], newest[rows[reached]])
    return result
