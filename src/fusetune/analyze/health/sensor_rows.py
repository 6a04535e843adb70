"""How often each sensor came, its longest gap in flight, and whether it ever stood still."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import duration, inside
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import longest_between
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.analyze.metrics.grouping import distinct
from fusetune.px4.estimator_samples import taken_times
from fusetune.px4.flight import TopicTable, field_names, row_count, select_rows
from fusetune.px4.layouts.logged_state import MIN_FIX_TYPE
from fusetune.px4.sample_times import measurement_time
from fusetune.save.checks.standstill import standstill

GROUP = "sensor"
IMU = "sensor_combined"


class Aid(NamedTuple):
    """A sensor beside the IMU: its topic, and columns that never all stand still together."""

    name: str
    label: str
    topic: str
    columns: tuple[str, ...]
    gives_height: bool = False


AIDS = (
    Aid("mag", "magnetometer", "vehicle_magnetometer", tuple(f"magnetometer_ga[{axis}]" for axis in range(3))),
    Aid("baro", "barometer", "vehicle_air_data", ("baro_alt_meter",), True),
    Aid(
        "gps",
        "GNSS",
        "vehicle_gps_position",
        ("latitude_deg", "longitude_deg", "altitude_msl_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"),
        True,
    ),
    Aid("range", "range finder", "distance_sensor", ("current_distance",), True),
    Aid("flow", "optical flow", "vehicle_optical_flow", ("pixel_flow[0]", "pixel_flow[1]")),
    Aid("vision", "external vision", "vehicle_visual_odometry", tuple(f"position[{axis}]" for axis in range(3)), True),
    Aid("airspeed", "airspeed", "airspeed", ("true_airspeed_m_s",)),
)
_FEWEST = 5
_CHECK = "Check the sensor, its wiring and its driver before the next flight"
_LOG_ALL = "log every sample (SDLOG_PROFILE = 3) to see"


def imu_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Rate, longest gap and standstill of the IMU that was used, and errors that the drivers counted."""
    table, subject = health.topic(IMU), Subject("imu", "IMU", GROUP)
    if table is None or row_count(table) < _FEWEST:
        yield subject.lacking("rate_hz", "no samples in the log")
        return
    limits, time = health.limits, table["timestamp"].astype(np.int64)
    interval = float(np.median(table.get("gyro_integral_dt", np.diff(time)))) * 1e-6
    yield subject.judged(
        "rate_hz",
        "samples a second, by their integration time:",
        1.0 / interval if interval > 0.0 else np.nan,
        "Hz",
        Levels(limits.min_imu_rate_hz),
        least=True,
        remedy="Set IMU_INTEG_RATE to 200",
    )
    if not health.airborne:
        yield subject.lacking("longest_gap_s", "never in flight")
        return
    gap = longest_between(time, health.airborne)
    usual = float(np.median(np.diff(time))) * 1e-6
    yield subject.judged(
        "longest_gap_s",
        "longest time without a sample in the log, in flight:",
        gap.value,
        "s",
        Levels(max(limits.imu_gap_s, limits.aid_gap_factor * usual)),
        remedy="Use a faster SD card; where the vehicle itself lost them, see time_slip_s",
        when=gap.when,
    )
    covered = float(inside(time, health.airborne).sum()) * interval / (duration(health.airborne) * 1e-6)
    yield subject.told("logged_share", "share of the flight that the logged samples cover:", min(covered, 1.0))
    yield _imu_stuck_row(health, subject, table)
    yield from _error_rows(health)


def _imu_stuck_row(health: JudgedHealth, subject: Subject, table: TopicTable) -> HealthRow:
    flying = _flying_steps(health, table["timestamp"])
    names = [name for vector in ("gyro_rad", "accelerometer_m_s2") for name in field_names(table, vector)]
    if not names or not flying.any():
        return subject.lacking("stuck_s", "no samples in flight")
    found = {name: standstill(table, (name,), health.limits.stuck_imu_s, flying) for name in names}
    worst = max(found, key=lambda name: found[name].longest_s)
    one = found[worst]
    return subject.judged(
        "stuck_s",
        f"longest time that {worst} stands still:",
        one.longest_s,
        "s",
        Levels(health.limits.stuck_imu_s),
        remedy=_CHECK,
        when=(one.start_us, one.stop_us) if one.longest_s else None,
    )


def _error_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    for instance in health.flight.instances("vehicle_imu_status"):
        table = health.topic("vehicle_imu_status", instance)
        rows = inside(table["timestamp"], health.airborne) if table is not None else np.zeros(0, bool)
        if table is None or rows.sum() < 2:
            continue
        subject = Subject("imu", f"IMU {instance}", GROUP, instance)
        for kind, label in (("accel", "accelerometer"), ("gyro", "gyro")):
            counter = table.get(f"{kind}_error_count")
            if counter is not None:
                grown = int(np.maximum(np.diff(counter[rows].astype(np.int64)), 0).sum())
                yield subject.told(f"{kind}_errors", f"errors that the driver of the {label} counted in flight:", grown)
            rate = table.get(f"{kind}_rate_hz")
            if rate is not None and np.median(rate[rows]) > 0:
                yield subject.told(f"{kind}_rate_hz", f"rate of the {label}", float(np.median(rate[rows])), "Hz")


def aid_sensor_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Rate, gap and standstill of every other sensor that the log holds, and the best rate of a source of height."""
    heights: dict[str, float] = {}
    for aid in AIDS:
        instances = health.logged.instances(aid.topic) if health.logged.has(aid.topic) else [0]
        tables = [(one, table) for one in instances if (table := health.topic(aid.topic, one)) is not None]
        tables = [(one, table) for one, table in tables if row_count(table) >= _FEWEST]
        if not tables:
            yield Subject(aid.name, aid.label, GROUP).lacking("rate_hz", "not in the log")
            continue
        rate = _rate_row(health, aid, tables[0][1])
        if aid.gives_height and rate.finding.figure is not None:
            heights[aid.label] = rate.finding.figure
        yield rate
        for instance, table in tables:
            subject = Subject(aid.name, aid.label, GROUP, instance if len(tables) > 1 else None)
            yield _gap_row(health, subject, aid, table)
            yield _stuck_row(health, subject, aid, table)
    yield _height_row(health, heights)


def _rate_row(health: JudgedHealth, aid: Aid, table: TopicTable) -> HealthRow:
    """Rate by what the estimator took, logged or not; else of what is logged, which may be thinned."""
    subject = Subject(aid.name, aid.label, GROUP)
    taken = taken_times(health.flight, aid.topic)
    told = taken is not None and taken.size >= _FEWEST
    times = taken if told and taken is not None else distinct(measurement_time(aid.topic, table))
    steps = np.diff(times)
    rate = 1e6 / float(np.median(steps)) if steps.size else np.nan
    least = health.limits.min_mag_rate_hz if aid.name == "mag" else None
    if least is not None and not told and rate < least:
        return subject.lacking("rate_hz", f"the log holds {rate:.3g} samples a second, maybe thinned: {_LOG_ALL}")
    evidence = {"taken_by_estimator": told}
    words = "samples a second:"
    if least is None:
        return subject.told("rate_hz", words, rate, "Hz", evidence=evidence)
    return subject.judged("rate_hz", words, rate, "Hz", Levels(least), least=True, remedy=_CHECK, evidence=evidence)


def _height_row(health: JudgedHealth, rates: dict[str, float]) -> HealthRow:
    subject, least = Subject("height", "height", GROUP), health.limits.min_height_rate_hz
    if not rates:
        return subject.lacking("rate_hz", "no source of height in the log")
    best = max(rates, key=lambda name: rates[name])
    topic = next(aid.topic for aid in AIDS if aid.label == best)
    if rates[best] < least and taken_times(health.flight, topic) is None:
        return subject.lacking("rate_hz", f"the log holds {rates[best]:.3g} samples a second: {_LOG_ALL}")
    return subject.judged(
        "rate_hz",
        f"samples a second of its fastest source ({best}):",
        rates[best],
        "Hz",
        Levels(least),
        least=True,
        remedy=_CHECK,
    )


def _gap_row(health: JudgedHealth, subject: Subject, aid: Aid, table: TopicTable) -> HealthRow:
    time = distinct(measurement_time(aid.topic, table))
    flying = inside(time, health.airborne)
    if flying.sum() < _FEWEST:
        return subject.lacking("longest_gap_s", "not in flight")
    usual = float(np.median(np.diff(time))) * 1e-6
    gap = longest_between(time, health.airborne)
    return subject.judged(
        "longest_gap_s",
        "longest time without a sample in flight:",
        gap.value,
        "s",
        Levels(max(health.limits.aid_gap_s, health.limits.aid_gap_factor * usual)),
        remedy=_CHECK,
        when=gap.when,
        evidence={"usual_interval_s": round(usual, 4)},
    )


def _stuck_row(health: JudgedHealth, subject: Subject, aid: Aid, table: TopicTable) -> HealthRow:
    """Longest standstill in flight, judged where the sensor's own habit of repeating values does not explain it."""
    if "fix_type" in table:
        # without a fix there is nothing to repeat
        table = select_rows(table, table["fix_type"] >= MIN_FIX_TYPE)
    columns = [name for name in aid.columns if name in table and np.isfinite(table[name]).any()]
    flying = _flying_steps(health, table["timestamp"])
    if len(columns) < len(aid.columns) or flying.sum() < _FEWEST:
        return subject.lacking("stuck_s", "not enough in flight")
    warning, fail = health.limits.stuck_aid_s
    found = standstill(table, columns, warning, flying)
    chance = _chance(table, columns, flying, found.start_us, found.stop_us) if found.longest_s else 1.0
    is_stuck = chance < health.limits.stuck_chance
    return subject.judged(
        "stuck_s",
        "longest time that it stands still in flight:",
        found.longest_s,
        "s",
        Levels(warning, fail) if is_stuck else Levels(np.inf),
        remedy=_CHECK,
        when=(found.start_us, found.stop_us) if found.longest_s else None,
        evidence={"chance": float(chance)},
    )


def _chance(table: TopicTable, columns: list[str], flying: npt.NDArray[np.bool_], start_us: int, stop_us: int) -> float:
    """Upper bound of the chance of such a run, if each sample repeated the last as often as outside of it.

    Of n steps each repeating with probability p a run of k somewhere has a probability of at most n pᵏ; p is (r + 1) /
    (m + 2) of the r repeats in m steps outside the run.
    """
    same = flying & np.logical_and.reduce([table[name][1:] == table[name][:-1] for name in columns])
    within = (table["timestamp"][1:] > start_us) & (table["timestamp"][1:] <= stop_us) & flying
    steps, run = int(flying.sum()), int((within & same).sum())
    often = (float((same & ~within).sum()) + 1.0) / (float((flying & ~within).sum()) + 2.0)
    return float(min(steps * often**run, 1.0))


def _flying_steps(health: JudgedHealth, time: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which steps from row to row lie in the air, (rows - 1,)."""
    flying = inside(time, health.airborne)
    return flying[1:] & flying[:-1]
