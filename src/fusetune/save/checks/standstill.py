"""Values that stand still: what the checks of all sensors share that ask whether one is stuck.

A sensor that is stuck repeats its last value: real ones do not, for noise moves every sample. PX4's own check is of
this kind (`DataValidator`: the same value a hundred times is stale). On the ground a simulation may be without noise,
so the time in the air is judged, or the whole log where that is unknown; a log without flight gets a warning at most.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusetune.check import Check
from fusetune.finding import Finding
from fusetune.px4.flight import Flight, TopicTable
from fusetune.save.checks.judged_flight import IN_THE_AIR, JudgedFlight
from fusetune.save.log_facts import airborne_intervals, is_airborne

STUCK_TOPICS = IN_THE_AIR
"""What is read besides the sensor's own topic."""
STUCK_IMU = ("high_stuck_imu_s", "max_stuck_share")
STUCK_AID = ("high_stuck_aid_s", "max_stuck_share")
"""Thresholds by the kind of sensor."""
FEWEST_STUCK_ROWS = 5
_CHECK_SENSOR = "Check the sensor, its wiring and its driver before the next flight; give a simulated one noise"


class Standstill(NamedTuple):
    """How long a sensor held one value."""

    longest_s: float
    share: float
    """Of the time that was looked at, how much lies in standstills beyond the limit."""
    value: float
    """What the longest one held."""
    start_us: int
    stop_us: int
    """First and last row of the longest one; 0 where there is none."""


def standstill(table: TopicTable, columns: Sequence[str], limit_s: float, flying: np.ndarray) -> Standstill:
    """Times in which some columns together hold one value.

    Parameters
    ----------
    columns
        All of them have to stand still.
    limit_s
        Shorter times are none, and neither are fewer than five rows.
    flying
        (rows - 1,) bool, which steps from row to row count.
    """
    time_s = table["timestamp"].astype(np.int64) * 1e-6
    steps = np.where(flying, np.maximum(np.diff(time_s), 0.0), 0.0)
    same = flying.copy()
    for column in columns:
        same &= table[column][1:] == table[column][:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]])))
    begins, ends = edges[::2], edges[1::2]
    passed = np.append(0.0, np.cumsum(steps))
    lengths = np.where(ends - begins >= FEWEST_STUCK_ROWS - 1, passed[ends] - passed[begins], 0.0)
    if not len(lengths) or not passed[-1]:
        return Standstill(0.0, 0.0, 0.0, 0, 0)
    longest = int(np.argmax(lengths))
    first, last = int(begins[longest]), int(ends[longest])
    share = float(np.sum(lengths[lengths > limit_s]) / passed[-1])
    return Standstill(
        float(lengths[longest]),
        share,
        float(table[columns[0]][first]),
        int(table["timestamp"][first]),
        int(table["timestamp"][last]),
    )


def flying_steps(flight: Flight, table: TopicTable) -> np.ndarray:
    """Which steps from row to row are in the air, (rows - 1,) bool; all where that is unknown or never was."""
    middle = (table["timestamp"][1:] + table["timestamp"][:-1]) // 2
    if not airborne_intervals(flight):
        return np.ones(len(middle), np.bool_)
    return is_airborne(flight, middle)


class Subject(NamedTuple):
    """What must not stand still."""

    what: str
    table: TopicTable
    groups: Sequence[Sequence[str]]
    """Columns that may not all stand still together."""
    limit_s: float


def stuck(asked: Check[JudgedFlight], judged: JudgedFlight, subject: Subject) -> Finding:
    """Whether a sensor stands still: the finding of a check that asks it."""
    flight, limit_s, max_share = judged.flight, subject.limit_s, judged.limits.max_stuck_share
    flying = flying_steps(flight, subject.table)
    found = [standstill(subject.table, group, limit_s, flying) for group in subject.groups]
    worst = max(found, key=lambda one: (one.share, one.longest_s))
    if worst.longest_s <= limit_s:
        return asked.passed(f"{subject.what} never stands still", worst.longest_s, limit_s)
    said = f"{subject.what} holds one value ({worst.value:.7g}) for up to {worst.longest_s:.1f} s"
    if worst.share > max_share and airborne_intervals(flight) != []:
        return asked.failed(
            f"{said}, in {worst.share:.0%} of the time: it is stuck, and the flight says nothing about the filter",
            _CHECK_SENSOR,
            worst.share,
            max_share,
            unit="",
            start_us=worst.start_us,
            stop_us=worst.stop_us,
        )
    return asked.warned(
        f"{said}: it was stuck",
        _CHECK_SENSOR,
        worst.longest_s,
        limit_s,
        start_us=worst.start_us,
        stop_us=worst.stop_us,
        evidence={"share": worst.share},
    )
