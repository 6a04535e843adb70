"""What happened on a flight at a time: resets, rejections begun, failsafes, messages, parameters set."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.replayed_set import RESET_COUNTERS, counter_steps
from fusetune.px4.flight import TopicTable
from fusetune.px4.layouts.estimator_instances import instance_switches
from fusetune.report.flight_data.content import Event
from fusetune.report.flight_data.flag_words import FLAG_WORDS
from fusetune.report.flight_data.logged import Logged
from fusetune.report.flight_data.panel_names import RESET_WORDS

_MOST_OF_A_KIND = 60
_LOUD = ("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING")
_OF_FILTER = ("ekf", "gnss", "gps", "mag", "compass", "baro", "heading", "yaw", "estimat", "position", "velocity")
"""A message that speaks of one of these is told whatever its level."""


def events(logged: Logged, replayed: TopicTable | None, flags: TopicTable | None) -> list[Event]:
    """All that happened, in the order of time.

    Parameters
    ----------
    replayed, flags : local position and status flags of the replay of the present set; None where there is none
    """
    found = [
        *_resets(logged.topic("vehicle_local_position"), "as flown"),
        *_resets(replayed, "in the replay"),
        *_begun(logged.status_flags, "as flown"),
        *_begun(flags, "in the replay"),
        *_failsafes(logged.topic("vehicle_status")),
        *_messages(logged),
        *_parameters(logged),
        *_switches(logged),
    ]
    return sorted(found, key=lambda one: (one.time, one.kind, one.title))


def _resets(position: TopicTable | None, whose: str) -> Iterator[Event]:
    """Of all that were reset at once one event."""
    if position is None:
        return
    kinds: dict[int, list[str]] = {}
    for kind, counter in RESET_COUNTERS.items():
        if counter in position:
            # a counter that jumps by many is told once
            for time in np.unique(counter_steps(position["timestamp"], position[counter])).tolist():
                kinds.setdefault(time, []).append(RESET_WORDS[kind])
    for time in sorted(kinds)[:_MOST_OF_A_KIND]:
        yield Event(time, "reset", f"reset of {', '.join(kinds[time])}; {whose}")


def _begun(flags: TopicTable | None, whose: str) -> Iterator[Event]:
    if flags is None:
        return
    for name in flags:
        if name.startswith("reject_") and name in FLAG_WORDS:
            for time in _rises(flags["timestamp"], flags[name])[:_MOST_OF_A_KIND].tolist():
                yield Event(time, "rejected", f"{FLAG_WORDS[name]}; {whose}")


def _rises(time: npt.NDArray[np.int64], flag: npt.NDArray) -> npt.NDArray[np.int64]:
    return time[np.flatnonzero(np.diff(flag.astype(np.int8), prepend=0) > 0)].astype(np.int64)


def _failsafes(status: TopicTable | None) -> Iterator[Event]:
    if status is not None and "failsafe" in status:
        for time in _rises(status["timestamp"], status["failsafe"])[:_MOST_OF_A_KIND].tolist():
            yield Event(time, "failsafe", "failsafe")


def _messages(logged: Logged) -> Iterator[Event]:
    told = (
        Event(one.timestamp, "message", one.text)
        for one in logged.flight.messages
        if one.level in _LOUD or any(word in one.text.lower() for word in _OF_FILTER)
    )
    yield from islice(told, _MOST_OF_A_KIND)


def _parameters(logged: Logged) -> Iterator[Event]:
    changed = (one for one in logged.flight.parameters.changed if one.name.startswith("EKF2_"))
    for one in islice(changed, _MOST_OF_A_KIND):
        yield Event(one.timestamp, "parameter", f"{one.name} set to {one.value:g}")


def _switches(logged: Logged) -> Iterator[Event]:
    for time in instance_switches(logged.flight)[:_MOST_OF_A_KIND].tolist():
        yield Event(time, "instance", "another estimator took over")
