"""Resets of the filter's state in flight: how many of each kind, when, and to what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import span
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.analyze.replaying.replayed_set import RESET_COUNTERS, counter_steps

Times = npt.NDArray[np.int64]

_TOLD_TIMES = 20
_STATUS_COUNTERS = {
    "horizontal_position": "reset_count_pos_ne",
    "height": "reset_count_pod_d",
    "horizontal_velocity": "reset_count_vel_ne",
    "vertical_velocity": "reset_count_vel_d",
    "heading": "reset_count_quat",
}
"""Counters of each instance, in `estimator_status` from v1.12 on; `reset_count_pod_d` is PX4's own spelling."""


def reset_rows(health: JudgedHealth, instance: int) -> Iterator[HealthRow]:
    """Resets of one instance by its own counters, which v1.12 brought."""
    table = health.topic("estimator_status", instance)
    counters = {kind: name for kind, name in _STATUS_COUNTERS.items() if table is not None and name in table}
    if table is None or not counters:
        subject = Subject("resets", health.name_of("resets", instance), "filter", instance)
        yield subject.lacking("height", "this release does not count them for each estimator")
        return
    times = {kind: counter_steps(table["timestamp"], table[name]) for kind, name in counters.items()}
    yield from rows_of_resets(health, times, instance, "vehicle", _events(health, instance))


def rows_of_resets(
    health: JudgedHealth,
    times: Mapping[str, Times],
    instance: int | None,
    origin: Origin,
    events: Mapping[str, int] | None = None,
) -> Iterator[HealthRow]:
    """A row of each kind; resets near the ground, at take-off and landing, are told and not judged."""
    name = "resets" if instance is not None else "local_position_resets"
    label = "resets" if instance is not None else "resets of the position in use"
    subject = Subject(name, health.name_of(label, instance), "filter", instance, origin)
    for kind, all_times in times.items():
        in_flight = all_times[inside(all_times, health.airborne)]
        limit = health.limits.heading_resets if kind == "heading" else health.limits.resets
        # by what the flight begins with EKF2 aligns heading and height once more: within the first seconds
        settled = in_flight[inside(in_flight, health.clear)]
        yield subject.judged(
            kind,
            f"{kind.replace('_', ' ')}, clear of the ground:",
            float(settled.size) if health.airborne else np.nan,
            "",
            Levels(limit),
            remedy="See which source was rejected or lost before",
            when=span(settled),
            evidence={
                "in_flight": int(in_flight.size),
                "in_log": int(all_times.size),
                "at_s": _times_in_words(health, in_flight),
                **(events or {}),
            },
        )


def _times_in_words(health: JudgedHealth, times: Times) -> str:
    return " ".join(f"{health.observed.since_start_s(int(one)):.2f}" for one in times[:_TOLD_TIMES])


def _events(health: JudgedHealth, instance: int) -> dict[str, int]:
    """Kinds of resets that the filter announced in flight, each with how often."""
    table = health.topic("estimator_event_flags", instance)
    if table is None:
        return {}
    rows = inside(table["timestamp"], health.airborne)
    names = (name for name in table if name.startswith(("reset_", "yaw_aligned")))
    counts = {name: int(np.count_nonzero(table[name][rows])) for name in names}
    return {name: count for name, count in counts.items() if count}


def local_position_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Resets of the position that the vehicle flew by, of all instances together: a change of instance counts, too."""
    table = health.topic("vehicle_local_position")
    counters = {kind: name for kind, name in RESET_COUNTERS.items() if table is not None and name in table}
    if table is None or not counters:
        subject = Subject("local_position_resets", "resets of the position in use", "filter")
        yield subject.lacking("height", "no local position in the log")
        return
    times = {kind: counter_steps(table["timestamp"], table[name]) for kind, name in counters.items()}
    yield from rows_of_resets(health, times, None, "vehicle")
