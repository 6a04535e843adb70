"""Vibration metrics, coning and clipping of each IMU, in rad/s and m/s² whatever the release logs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import at, span
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.flight import TopicTable, field_names
from fusetune.px4.layouts.vibration_metrics import Vibration, vibrations

_ISOLATE = "Isolate the autopilot from the frame, balance motors and propellers"
_CLIPPING = "Mend the mounting: no parameter helps against clipping"


def vibration_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Peak and mean of each metric, clear of the ground, of every IMU that logs them."""
    found = vibrations(health.logged)
    if not found:
        yield Subject("vibration", "vibration", "IMU").lacking("accel_mean", "no metrics in the log")
    for one in found:
        yield from _rows_of(health, one)


def _rows_of(health: JudgedHealth, vibration: Vibration) -> Iterator[HealthRow]:
    limits, rows = health.limits, inside(vibration.time, health.clear)
    instance = None if vibration.imu is None else vibration.imu
    subject = Subject("vibration", f"IMU {instance}" if instance is not None else "IMU in use", "IMU", instance)
    evidence = {"interval_s": vibration.interval_s, "per_interval": vibration.was_per_interval}
    metrics = [
        ("accel", "high-frequency acceleration", vibration.accel, "m/s²", limits.accel_vibration),
        ("gyro", "high-frequency angular rate", vibration.gyro, "rad/s", limits.gyro_vibration),
    ]
    # from v1.13 on coning is an average of corrections, which nobody has limits for
    judged = vibration.is_old_coning
    metrics.append(("coning", "coning", vibration.coning, "rad²", limits.coning if judged else (np.inf, np.inf)))
    for name, label, values, unit, (mean, peak) in metrics:
        if values is None or not rows.any():
            yield subject.lacking(f"{name}_mean", f"no {label} in flight in the log")
            continue
        here, time = values[rows].astype(np.float64), vibration.time[rows]
        yield subject.judged(
            f"{name}_mean",
            f"mean {label}",
            float(np.mean(here)),
            unit,
            Levels(mean),
            remedy=_ISOLATE,
            evidence=evidence,
        )
        row = int(np.argmax(here))
        words = f"largest {label}"
        yield subject.judged(
            f"{name}_peak",
            words,
            float(here[row]),
            unit,
            Levels(peak),
            remedy=_ISOLATE,
            evidence=evidence,
            when=at(time[row]),
        )


def clipping_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Clipped samples in flight, clear of the ground, by each IMU's counters, else of the samples that were used."""
    tables = [(one, health.topic("vehicle_imu_status", one)) for one in health.flight.instances("vehicle_imu_status")]
    counted = False
    for instance, table in tables:
        for kind, label in (("accel", "accelerometer"), ("gyro", "gyro")):
            names = field_names(table, f"{kind}_clipping") if table is not None else []
            if table is not None and names:
                counted = True
                yield _counter_row(health, table, names, instance, kind, label)
    if not counted:
        yield _flagged_row(health)


def _counter_row(
    health: JudgedHealth, table: TopicTable, names: list[str], instance: int, kind: str, label: str
) -> HealthRow:
    subject = Subject("clipping", f"IMU {instance}", "IMU", instance)
    time = table["timestamp"]
    grown = np.sum([_grown(table[name], time, health.clear) for name in names], axis=0)
    rows = np.flatnonzero(grown)
    within = np.sum([_grown(table[name], time, health.airborne) for name in names])
    return subject.judged(
        kind,
        f"{label} samples clipped clear of the ground:",
        float(grown.sum()) if health.clear else np.nan,
        "",
        Levels(*health.limits.clipped),
        remedy=_CLIPPING,
        when=(int(time[max(rows[0] - 1, 0)]), int(time[rows[-1]]) + 1) if rows.size else None,
        evidence={
            "in_flight": int(within),
            **{f"axis_{axis}": int(_grown(table[name], time, health.clear).sum()) for axis, name in enumerate(names)},
        },
    )


def _grown(counter: np.ndarray, time: np.ndarray, within: tuple[Interval, ...]) -> np.ndarray:
    """By how much a counter grew at each row whose step lies in the intervals, (rows,)."""
    steps = np.r_[0, np.diff(counter.astype(np.int64))]
    before = np.r_[time[:1], time[:-1]]
    return np.where(inside(time, within) & inside(before, within), np.maximum(steps, 0), 0)


def _flagged_row(health: JudgedHealth) -> HealthRow:
    subject = Subject("clipping", "IMU in use", "IMU")
    table = health.topic("sensor_combined")
    rows = inside(table["timestamp"], health.clear) if table is not None else np.zeros(0, bool)
    has_clipping = health.logged.has("sensor_combined") and "accelerometer_clipping" in (
        health.logged.topic("sensor_combined") or {}
    )
    if table is None or not rows.any() or not has_clipping:
        return subject.lacking("accel", "clipping in flight is not logged")
    clipped = (table["accelerometer_clipping"] != 0) & rows
    when = table["timestamp"][clipped]
    return subject.judged(
        "accel",
        "accelerometer samples clipped clear of the ground:",
        float(clipped.sum()),
        "",
        Levels(*health.limits.clipped),
        remedy=_CLIPPING,
        when=span(when),
    )
