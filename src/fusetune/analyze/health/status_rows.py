"""What `estimator_status` says itself: test ratios as PX4's scripts take them, and rejections."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import share_of, time_set
from fusetune.analyze.health.ratio_figures import ratio_rows
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.flight import TopicTable

RATIOS = (
    ("status_height", "height", ("hgt_test_ratio",), True),
    ("status_heading", "heading", ("hdg_test_ratio", "mag_test_ratio"), True),
    ("status_velocity", "velocity", ("vel_test_ratio",), False),
    ("status_position", "position", ("pos_test_ratio",), False),
    ("status_airspeed", "airspeed", ("tas_test_ratio",), False),
    ("status_hagl", "height above ground", ("hagl_test_ratio",), False),
)
"""Subject, label, field by releases, and whether it is judged clear of the ground: all as PX4's scripts have it."""

REJECTIONS = (
    ("reject_hor_vel", "horizontal velocity", False),
    ("reject_ver_vel", "vertical velocity", False),
    ("reject_hor_pos", "horizontal position", False),
    ("reject_ver_pos", "vertical position", True),
    ("reject_mag_x", "magnetometer x", True),
    ("reject_mag_y", "magnetometer y", True),
    ("reject_mag_z", "magnetometer z", True),
    ("reject_yaw", "heading", True),
    ("reject_airspeed", "airspeed", False),
    ("reject_sideslip", "sideslip", False),
    ("reject_hagl", "height above ground", False),
    ("reject_optflow_x", "optical flow x", True),
    ("reject_optflow_y", "optical flow y", True),
)
"""Flag of v1.16's layout, what was rejected, and whether it is judged clear of the ground."""

_LOOSE = frozenset({"reject_hagl", "reject_optflow_x", "reject_optflow_y"})
_FILTERED = "{field}: square root of the largest ratio in use, low-pass filtered from v1.15 on"


def status_ratio_rows(health: JudgedHealth, instance: int, *, judged: bool) -> Iterator[HealthRow]:
    """Test ratios of `estimator_status`; judged where the log has too few innovations to make better ones of."""
    table = health.topic("estimator_status", instance)
    for name, label, fields, clear in RATIOS:
        field = next((one for one in fields if table is not None and one in table), None)
        within = health.clear if clear else health.airborne
        subject = Subject(name, health.name_of(f"{label} as the filter sums it up", instance), "status", instance)
        if table is None or field is None:
            continue
        ratio = table[field].astype(np.float64)
        rows = inside(table["timestamp"], within) & np.isfinite(ratio)
        if not ratio[rows].size or not ratio[rows].max() > 0.0:
            yield subject.lacking("raised_share", "nothing of the kind was fused")
            continue
        evidence: dict[str, int | str] = {"ratio": _FILTERED.format(field=field), "samples": int(rows.sum())}
        yield from ratio_rows(health, subject, table["timestamp"][rows], ratio[rows], within, evidence, judged=judged)


def rejection_rows(health: JudgedHealth, instance: int) -> Iterator[HealthRow]:
    """Share of the time that the filter said it rejects something, each kind apart."""
    table = health.topic("estimator_status_flags", instance)
    known = {name for name in table or () if name.startswith("reject_")}
    subject = Subject("rejections", health.name_of("rejected", instance), "status", instance)
    if table is None or not known:
        yield subject.lacking("hor_vel_share", "the log does not tell what was rejected")
        return
    for flag, label, clear in REJECTIONS:
        if flag in known:
            yield _rejection(health, subject, table, flag, label, clear)


def _rejection(
    health: JudgedHealth, subject: Subject, table: TopicTable, flag: str, label: str, clear: bool
) -> HealthRow:
    within = health.clear if clear else health.airborne
    found = time_set(table["timestamp"], table[flag].astype(bool), health.flight.last_timestamp, within)
    limits = health.limits.loose_rejected_share if flag in _LOOSE else health.limits.rejected_share
    return subject.judged(
        f"{flag.removeprefix('reject_')}_share",
        f"{label}, share of the flight",
        share_of(found.value, within),
        "",
        Levels(*limits),
        remedy="See the aid sources that measure it",
        when=found.when,
        evidence={"seconds": round(found.value, 3)},
    )
