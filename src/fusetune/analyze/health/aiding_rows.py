"""Time in flight without any horizontal aiding, and how much of it the filter did not say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.health.aid_source_rows import Samples, told_windows
from fusetune.analyze.health.filter_rows import Flags
from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import time_set
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.analyze.metrics.grouping import distinct
from fusetune.px4.aid_sources import HORIZONTAL_AIDING
from fusetune.px4.flight import TopicTable

_SAYS_SO = (
    "cs_inertial_dead_reckoning",
    "cs_wind_dead_reckoning",
    "cs_fake_pos",
    "cs_constant_pos",
    "cs_valid_fake_pos",
)
_SPARSE_S = 1.0
"""Innovations that are logged less often do not tell gaps of a second."""
_REMEDY = "See why the sources of position and velocity were rejected, or did not come"


def aiding_rows(
    health: JudgedHealth, samples: Samples, flags: Flags | None, instance: int, origin: Origin
) -> Iterator[HealthRow]:
    """The longest time without a fused sample of any source that stops the drift, and what the flags leave of it."""
    subject = Subject("aiding", health.name_of("horizontal aiding", instance), "filter", instance, origin)
    fused = [samples[name, 0] for name in HORIZONTAL_AIDING if (name, 0) in samples]
    fused = [one for one in fused if one.fused.any()]
    if not fused or not health.airborne:
        yield subject.lacking("longest_unaided_s", "no source of velocity or position was fused in flight")
        return
    time = distinct(np.concatenate([one.timestamp_sample[one.fused] for one in fused]))
    every = distinct(np.concatenate([one.timestamp_sample for one in fused]))
    within = tuple(
        (max(start, int(time[0])), stop) for start, stop in told_windows(health, samples, origin) if stop > time[0]
    )
    usual = float(np.median(np.diff(every))) * 1e-6 if every.size > 1 else np.inf
    if usual > _SPARSE_S or not within:
        yield subject.lacking("longest_unaided_s", "innovations are logged too seldom to tell")
        return
    # a thinned log tells the ends of a gap no better than its interval
    gaps = _gaps(time, within, health.limits.unaided_s[0] + 2.0 * usual)
    longest = max(gaps, key=lambda one: one[1] - one[0], default=None)
    yield subject.judged(
        "longest_unaided_s",
        "longest time in flight without any",
        0.0 if longest is None else (longest[1] - longest[0]) * 1e-6,
        "s",
        Levels(*(one + 2.0 * usual for one in health.limits.unaided_s)),
        remedy=_REMEDY,
        when=longest,
        evidence={"logged_every_s": round(usual, 3)},
    )
    own = health.topic("vehicle_local_position") if origin == "vehicle" and instance == health.primary else None
    silent = [(_unsaid(health, flags, own, gap, usual), gap) for gap in gaps]
    worst = max(silent, key=lambda one: one[0], default=(0.0, None))
    yield subject.judged(
        "unflagged_loss_s",
        "longest loss of it that the filter does not say",
        worst[0],
        "s",
        Levels(*health.limits.unflagged_loss_s),
        remedy=_REMEDY,
        when=worst[1],
    )


def _gaps(time: np.ndarray, within: tuple[Interval, ...], longer_than_s: float) -> list[Interval]:
    """Times without an event in the intervals, µs; one before an interval ends it sooner."""
    found = []
    for start, stop in within:
        before = time[time <= start]
        edges = np.r_[before[-1:], time[(time > start) & (time < stop)], stop]
        wide = np.flatnonzero(np.diff(edges) > longer_than_s * 1e6)
        found += [(max(int(edges[row]), start), int(edges[row + 1])) for row in wide]
    return found


def _unsaid(
    health: JudgedHealth, flags: Flags | None, local: TopicTable | None, gap: Interval, usual_s: float
) -> float:
    """Seconds of a gap in which neither a flag nor the filter's local position says that nothing aids it."""
    # EKF2 says so after a second itself
    start = gap[0] + int((health.limits.unaided_s[0] + usual_s) * 1e6)
    if start >= gap[1]:
        return 0.0
    told = 0.0
    end = health.flight.last_timestamp
    known = [flags[name].astype(bool) for name in _SAYS_SO if name in flags] if flags is not None else []
    if known and flags is not None:
        told = time_set(flags["timestamp"], np.logical_or.reduce(known), end, ((start, gap[1]),)).value
    if local is not None and "xy_valid" in local:
        invalid = ~local["xy_valid"].astype(bool)
        if "dead_reckoning" in local:
            invalid |= local["dead_reckoning"].astype(bool)
        told = max(told, time_set(local["timestamp"], invalid, end, ((start, gap[1]),)).value)
    return max((gap[1] - start) * 1e-6 - told, 0.0)
