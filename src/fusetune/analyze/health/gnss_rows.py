"""What GNSS reported in flight, against the minima that EKF2 was told, with typical values beside."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.gnss_drift import DRIFT_TIME_CONSTANT_S, drift_at_rest
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import at, share_of, span, time_set
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.flight import TopicTable

GROUP = "GNSS quality"
TOPIC = "vehicle_gps_position"


class Minimum(NamedTuple):
    """One of EKF2's checks: what it looks at, its parameter, its bit in EKF2_GPS_CHECK, and what is typical."""

    name: str
    label: str
    unit: str
    parameter: str
    bit: int | None
    typical: float
    least: bool = False


MINIMA = (
    Minimum("fix_type", "fix type", "", "", None, 4.0, least=True),
    Minimum("satellites", "satellites", "", "EKF2_REQ_NSATS", 0, 14.0, least=True),
    Minimum("pdop", "PDOP", "", "EKF2_REQ_PDOP", 1, 1.0),
    Minimum("eph", "horizontal accuracy", "m", "EKF2_REQ_EPH", 2, 0.8),
    Minimum("epv", "vertical accuracy", "m", "EKF2_REQ_EPV", 3, 1.5),
    Minimum("speed_accuracy", "speed accuracy", "m/s", "EKF2_REQ_SACC", 4, 0.3),
)
"""In the order of the bits; typical values are those of PX4's tuning guide. The fix is checked whatever the bits."""

_LEAST_FIX = 3


class Rest(NamedTuple):
    """One of EKF2's checks of a vehicle that stands: row, parameter, bit, what is typical, and where it is logged."""

    name: str
    label: str
    parameter: str
    bit: int
    typical: float
    field: str


AT_REST = (
    Rest(
        "drift_horizontal", "horizontal drift at rest", "EKF2_REQ_HDRIFT", 5, 0.01, "position_drift_rate_horizontal_m_s"
    ),
    Rest("drift_vertical", "vertical drift at rest", "EKF2_REQ_VDRIFT", 6, 0.02, "position_drift_rate_vertical_m_s"),
    Rest("speed_at_rest", "horizontal speed at rest", "EKF2_REQ_HDRIFT", 7, 0.01, "filtered_horizontal_speed_m_s"),
)
"""The fields are of `estimator_gps_status`, which v1.13 brought; before, nothing logs them."""
_MOVE_ANTENNA = "Give the antenna a free view of the sky, away from cameras, video links and USB 3"


def gnss_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Rows of all minima; of GNSS that is not there or not used one that says so."""
    table = health.topic(TOPIC)
    subject = Subject("gnss", "GNSS", GROUP)
    if table is None:
        yield subject.lacking("fix_type", "no messages in the log")
        return
    rows = inside(table["timestamp"], health.airborne)
    is_used = int(health.parameters["EKF2_GPS_CTRL"]) != 0
    if not rows.any():
        yield subject.lacking("fix_type", "no messages in flight")
    for minimum in MINIMA if rows.any() else ():
        values = _values(minimum.name, table)
        if values is None:
            yield subject.lacking(minimum.name, f"{minimum.label} is not reported")
            continue
        yield _minimum_row(health, subject, minimum, values[rows], table["timestamp"][rows], is_used)
    yield from _rest_rows(health, subject, table, is_used)
    yield from _interference_rows(subject, table, rows)


def _values(name: str, table: TopicTable) -> npt.NDArray[np.float64] | None:
    fields = {"satellites": "satellites_used", "speed_accuracy": "s_variance_m_s"}
    if name == "pdop":
        if "hdop" not in table or "vdop" not in table or not np.any(table["hdop"]):
            return None
        return np.hypot(table["hdop"].astype(np.float64), table["vdop"].astype(np.float64))
    found = table.get(fields.get(name, name))
    return None if found is None else found.astype(np.float64)


def _minimum_row(
    health: JudgedHealth,
    subject: Subject,
    minimum: Minimum,
    values: npt.NDArray[np.float64],
    time: npt.NDArray[np.int64],
    is_used: bool,
) -> HealthRow:
    """The value that all but a few samples keep to, against the limit; a failure where half are beyond."""
    limit = health.parameters[minimum.parameter] if minimum.parameter else float(_LEAST_FIX)
    is_checked = _is_checked(health, minimum.bit)
    known = np.isfinite(values)
    if not known.any():
        return subject.lacking(minimum.name, f"{minimum.label} is not reported")
    values, time = values[known], time[known]
    share = health.limits.gnss_share
    # the value of a sample, so that half a satellite never decides
    figure = float(
        np.quantile(values, share if minimum.least else 1.0 - share, method="lower" if minimum.least else "higher")
    )
    median, beyond = float(np.median(values)), values < limit if minimum.least else values > limit
    fails = is_used and is_checked and (median < limit if minimum.least else median > limit)
    levels = Levels(limit if is_used else (-np.inf if minimum.least else np.inf), limit if fails else np.inf)
    when = time[beyond]
    words = f"{minimum.label} that {100.0 * (1.0 - share):g} % of the samples reach:"
    return subject.judged(
        minimum.name,
        words,
        figure,
        minimum.unit,
        levels,
        least=minimum.least,
        remedy=_MOVE_ANTENNA,
        when=span(when),
        evidence={
            "median": median,
            "worst": float(values.min() if minimum.least else values.max()),
            "beyond_share": float(np.mean(beyond)),
            "limit": limit,
            "typical": minimum.typical,
            "checked": is_checked,
        },
    )


def _is_checked(health: JudgedHealth, bit: int | None) -> bool:
    """Whether EKF2 was told to look at it; what has no bit it always does."""
    return bit is None or bool(int(health.parameters["EKF2_GPS_CHECK"]) >> bit & 1)


def _rest_rows(health: JudgedHealth, subject: Subject, table: TopicTable, is_used: bool) -> Iterator[HealthRow]:
    """EKF2's own drift figures while the vehicle stands, their largest once its filter had time to settle."""
    drift = drift_at_rest(table, _at_rest(health, table["timestamp"]), health.parameters)
    told = health.topic("estimator_gps_status", health.primary)
    for rest in AT_REST:
        time, values = np.zeros(0, np.int64), np.zeros(0)
        is_told = drift is None or not drift.settled.any()
        if drift is not None and not is_told:
            time, values = drift.time[drift.settled], getattr(drift, rest.name)[drift.settled]
        elif told is not None and rest.field in told:
            # the filter goes on saying in the air what it found at rest
            known = np.isfinite(told[rest.field])
            time, values = told["timestamp"][known], told[rest.field][known].astype(np.float64)
        if values.size:
            yield _rest_row(health, subject, rest, time, values, is_used, is_told)
        else:
            short = f"the vehicle stands for less than {DRIFT_TIME_CONSTANT_S:g} s with GNSS"
            yield subject.lacking(rest.name, f"{rest.label}: {short}")


def _rest_row(
    health: JudgedHealth,
    subject: Subject,
    rest: Rest,
    time: npt.NDArray[np.int64],
    values: npt.NDArray[np.float64],
    is_used: bool,
    is_told: bool,
) -> HealthRow:
    row = int(np.argmax(values))
    return subject.judged(
        rest.name,
        rest.label,
        float(values[row]),
        "m/s",
        Levels(health.parameters[rest.parameter] if is_used else np.inf),
        remedy=_MOVE_ANTENNA,
        when=at(time[row]),
        evidence={
            "median": float(np.median(values)),
            "limit": health.parameters[rest.parameter],
            "typical": rest.typical,
            "checked": _is_checked(health, rest.bit),
            "told_by_filter": is_told,
        },
    )


def _at_rest(health: JudgedHealth, time: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Whether the filter takes the vehicle to stand on the ground, at some times (N,), µs."""
    flags, landed = health.topic("estimator_status_flags", health.primary), health.topic("vehicle_land_detected")
    tells = flags is not None and {"cs_vehicle_at_rest", "cs_in_air"} <= set(flags)
    table = flags if flags is not None and tells and flags["cs_vehicle_at_rest"].any() else landed
    if table is None:
        return np.zeros(time.shape, bool)
    if table is flags:
        values = flags["cs_vehicle_at_rest"].astype(bool) & ~flags["cs_in_air"].astype(bool)
    elif "landed" in table:
        values = table["landed"].astype(bool) & table["at_rest"].astype(bool)
    else:
        return np.zeros(time.shape, bool)
    newest = np.searchsorted(table["timestamp"], time, side="right") - 1
    return np.where(newest >= 0, values[np.maximum(newest, 0)], False)


def _interference_rows(subject: Subject, table: TopicTable, rows: npt.NDArray[np.bool_]) -> Iterator[HealthRow]:
    """What receivers tell of jamming and spoofing; a state of 1 is none, 2 and 3 are warnings of the receiver's own."""
    for name, field, label in (
        ("noise_per_ms", "noise_per_ms", "median noise"),
        ("jamming_indicator", "jamming_indicator", "median jamming indicator (0 to 255)"),
    ):
        if rows.any() and field in table and table[field][rows].any():
            yield subject.told(name, label, float(np.median(table[field][rows])), evidence={
                "largest": float(table[field][rows].max())
            })  # fmt: skip
    for name, label in (("jamming_state", "jamming"), ("spoofing_state", "spoofing")):
        if not rows.any() or name not in table or not table[name][rows].any():
            yield subject.lacking(name, f"the receiver does not tell of {label}")
            continue
        states, time = table[name][rows], table["timestamp"][rows]
        when = time[states > 1]
        yield subject.judged(
            name,
            f"{label} as the receiver sees it (1 none, 2 warning, 3 critical), largest",
            float(states.max()),
            "",
            Levels(1.0, 2.0),
            remedy="Find the source of interference, or fly elsewhere",
            when=span(when),
        )


def check_row(health: JudgedHealth, instance: int) -> HealthRow:
    """Share of the flight in which the filter's own checks of GNSS failed, those that are enabled."""
    subject = Subject("gnss", health.name_of("GNSS", instance), GROUP, instance)
    table = health.topic("estimator_status", instance)
    if table is None or "gps_check_fail_flags" not in table or health.topic(TOPIC) is None:
        return subject.lacking("checks_failed_share", "the log does not tell whether EKF2's checks passed")
    # the lowest bit is the fix; the others are those of EKF2_GPS_CHECK, one higher
    mask = int(health.parameters["EKF2_GPS_CHECK"]) << 1 | 1
    failed = (table["gps_check_fail_flags"].astype(np.int64) & mask) != 0
    found = time_set(table["timestamp"], failed, health.flight.last_timestamp, health.airborne)
    is_used = int(health.parameters["EKF2_GPS_CTRL"]) != 0
    return subject.judged(
        "checks_failed_share",
        "EKF2's checks failed for",
        share_of(found.value, health.airborne),
        "",
        Levels(*health.limits.unchecked_share) if is_used else Levels(np.inf),
        remedy=_MOVE_ANTENNA,
        when=found.when,
    )
