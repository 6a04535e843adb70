"""Which estimator instance flew: shares, changes, and whether the selector went back and forth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import span
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.layouts.estimator_instances import instance_shares, instance_switches, selector_status

_REMEDY = "See which sensors the instances differ in; the rows of each instance tell which of them is worse"


def instance_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Number of instances, share of each as the primary one, changes in flight, most of them within some seconds."""
    subject = Subject("instances", "estimator instances", "filter")
    yield subject.told("count", "in the log:", float(len(health.instances)))
    if selector_status(health.logged) is None:
        yield subject.lacking("switches", "none is selected: there is but one")
        return
    for instance, share in instance_shares(health.logged).items():
        one = Subject("instances", f"estimator {instance}", "filter", instance)
        yield one.told("primary_share", "primary for", share)
    if not health.airborne:
        yield subject.lacking("switches", "never in flight")
        return
    limits, times = health.limits, instance_switches(health.logged)
    times = times[inside(times, health.airborne)]
    yield subject.judged(
        "switches",
        "changes of the primary one in flight:",
        float(times.size),
        "",
        Levels(limits.switches),
        remedy=_REMEDY,
        when=span(times),
    )
    window = int(limits.whipsaw_window_s * 1e6)
    counts = np.searchsorted(times, times + window) - np.arange(times.size)
    row = int(np.argmax(counts)) if times.size else 0
    yield subject.judged(
        "whipsaw",
        f"most changes within {limits.whipsaw_window_s:g} s:",
        float(counts[row]) if times.size else 0.0,
        "",
        Levels(*limits.whipsaw),
        remedy=_REMEDY,
        when=span(times[row : row + counts[row]]) if times.size else None,
    )
