"""Two GNSS receivers: whether they are alike enough to be blended, and how far apart they put the vehicle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.flight import TopicTable, row_count
from fusetune.px4.layouts.logged_state import METRES_PER_DEGREE, MIN_FIX_TYPE
from fusetune.px4.layouts.sensor_layouts import vehicle_gps_position

_TOPICS = ("sensor_gps", "vehicle_gps_position")
"""Each receiver's own messages: from v1.12 on, and before."""


def receiver_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """How many receivers there are and, of two, their rates, accuracies and distance in flight."""
    subject = Subject("receivers", "GNSS receivers", "GNSS quality")
    receivers = _receivers(health)
    yield subject.told("count", "in the log:", float(len(receivers)))
    if len(receivers) < 2:
        yield subject.lacking("accuracy_ratio", "fewer than two")
        return
    first, second = (
        {name: values[inside(table["timestamp"], health.airborne)] for name, values in table.items()}
        for table in receivers[:2]
    )
    if min(row_count(first), row_count(second)) < 2:
        yield subject.lacking("accuracy_ratio", "fewer than two in flight")
        return
    mask = health.logged.parameters.initial.get("SENS_GPS_MASK", 0)
    accuracies = [float(np.median(one["eph"])) for one in (first, second)]
    rates = [1e6 / float(np.median(np.diff(one["timestamp"]))) for one in (first, second)]
    yield subject.judged(
        "accuracy_ratio",
        "the horizontal accuracies that they report differ by a factor of",
        max(accuracies) / min(accuracies) if min(accuracies) > 0.0 else np.nan,
        "",
        Levels(health.limits.receivers_apart if mask else np.inf),
        remedy="Set SENS_GPS_MASK to 0: blending pays where accuracies are comparable",
        evidence={"SENS_GPS_MASK": int(mask), "eph_0": accuracies[0], "eph_1": accuracies[1]},
    )
    yield subject.told(
        "slower_rate_hz", "the slower one, which sets the pace of a blend, logged at", min(rates), "Hz",
        evidence={"rate_0_hz": rates[0], "rate_1_hz": rates[1]},
    )  # fmt: skip
    apart = _apart_m(first, second)
    if apart.size:
        yield subject.told("apart_m", "median distance between their positions", float(np.median(apart)), "m",
                           evidence={"largest": float(apart.max())})  # fmt: skip


def _receivers(health: JudgedHealth) -> list[TopicTable]:
    for topic in _TOPICS:
        found = (health.logged.topics[topic, one] for one in health.logged.instances(topic))
        tables = [
            vehicle_gps_position(table) for table in found if row_count(table) and {"eph", "fix_type"} <= set(table)
        ]
        if tables:
            return tables
    return []


def _apart_m(first: TopicTable, second: TopicTable) -> npt.NDArray[np.float64]:
    """Horizontal distance at the first one's times, both with a fix, m."""
    fixes = [{name: values[one["fix_type"] >= MIN_FIX_TYPE] for name, values in one.items()} for one in (first, second)]
    if min(row_count(one) for one in fixes) < 2 or any("latitude_deg" not in one for one in fixes):
        return np.zeros(0)
    here, there = fixes
    north, east = (
        here[name] - np.interp(here["timestamp"], there["timestamp"], there[name])
        for name in ("latitude_deg", "longitude_deg")
    )
    return METRES_PER_DEGREE * np.hypot(north, east * np.cos(np.radians(here["latitude_deg"])))
