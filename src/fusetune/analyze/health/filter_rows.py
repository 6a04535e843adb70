"""What happened to the filter: numerical faults, resets, alignment, lost IMU time, errors of its output predictor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import at, time_set
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.flight import TopicTable, field_names

GROUP = "filter"
Flags = Mapping[str, npt.NDArray[Any]]

_FAULTS = Levels(warning=np.inf, fail=0.0)
_NOT_NUMERICAL = {
    "fs_bad_acc_vertical": "bad vertical acceleration: vibration or clipping drove velocity and height apart",
    "fs_bad_acc_clipping": "the accelerometer clipped",
}
_OUTPUT_ERRORS = (("angle_error_rad", "angle", "rad"), ("velocity_error_m_s", "velocity", "m/s"),
                  ("position_error_m", "position", "m"))  # fmt: skip
_LONGEST_DELAY = (
    "Set the delays of sensors that are not there to 0 (from v1.15 on EKF2_DELAY_MAX to the longest that is), then "
    "lower EKF2_TAU_VEL and EKF2_TAU_POS"
)


def fault_row(health: JudgedHealth, flags: Flags | None, instance: int, origin: Origin = "vehicle") -> HealthRow:
    """Whether `filter_fault_flags` was ever set, on the whole log, by which bits and when."""
    subject = Subject("filter", health.name_of("filter", instance), GROUP, instance, origin)
    status = health.topic("estimator_status", instance) if origin == "vehicle" else None
    bits = status.get("filter_fault_flags") if status is not None else None
    named: dict[str, Any] = {}
    times = []
    end = health.flight.last_timestamp
    known = flags or {}
    for name, values in known.items():
        if name.startswith("fs_") and values.any():
            found = time_set(known["timestamp"], values.astype(bool), end, ((0, end + 1),))
            named[name] = round(found.value, 3)
            times += list(found.when or ())
    if bits is None and flags is None:
        return subject.lacking("faults", "the log does not tell its faults")
    if bits is not None and status is not None and bits.any():
        when = status["timestamp"][bits != 0]
        times += [int(when[0]), int(when[-1]) + 1]
    largest = max(float(bits.max()) if bits is not None else 0.0, float(bool(named)))
    words = ", ".join(_NOT_NUMERICAL.get(name, name) for name in named) or "faults"
    return subject.judged(
        "faults",
        f"{words}; largest value of its fault flags" if largest else "largest value of its fault flags",
        largest,
        "",
        _FAULTS,
        remedy="Numerical faults: raise noise parameters again; bad acceleration: mend the vibration",
        when=(min(times), max(times)) if times else None,
        evidence=named,
    )


def alignment_rows(
    health: JudgedHealth, flags: Flags | None, instance: int, origin: Origin = "vehicle"
) -> Iterator[HealthRow]:
    """When the filter knew tilt and heading, seconds from the start of the log; neither should be after take-off."""
    subject = Subject("alignment", health.name_of("alignment", instance), GROUP, instance, origin)
    take_off = health.observed.airborne[0][0] if health.observed.airborne else None
    for kind, label in (("tilt", "tilt"), ("yaw", "heading")):
        values = None if flags is None else flags.get(f"cs_{kind}_align")
        if flags is None or values is None or not values.size:
            yield subject.lacking(f"{kind}_s", f"the log does not tell when the {label} was known")
            continue
        if not values.any():
            end = health.observed.since_start_s(health.flight.last_timestamp)
            yield subject.judged(
                f"{kind}_s",
                f"{label} not known to the end of the log, after",
                end,
                "s",
                Levels(np.inf, 0.0 if take_off is not None else np.inf),
                remedy="Calibrate the sensors, keep the vehicle still after boot",
            )
            continue
        when = int(flags["timestamp"][np.argmax(values)])
        late = take_off is not None and when > take_off and values[0] == 0
        begin = health.observed.since_start_s(when)
        yield subject.judged(
            f"{kind}_s",
            f"{label} known after",
            max(begin, 0.0),
            "s",
            Levels(health.observed.since_start_s(take_off) if late and take_off is not None else np.inf),
            remedy="Wait with take-off until the filter is aligned",
            when=at(when),
        )


def flight_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Take-off, landing and time in the air."""
    subject = Subject("flight", "flight", "flight")
    intervals = health.observed.airborne
    if not intervals:
        yield subject.lacking("airborne_s", "never in the air, as far as the log tells")
        return
    for name, words, when in (
        ("take_off_s", "take-off at", intervals[0][0]),
        ("landing_s", "end at", intervals[-1][1]),
    ):
        seconds = health.observed.since_start_s(when)
        yield subject.told(name, words, max(seconds, 0.0), "s", when=at(when))
    seconds = sum(stop - start for start, stop in intervals) * 1e-6
    yield subject.told(
        "airborne_s",
        "in the air for",
        seconds,
        "s",
        when=(intervals[0][0], intervals[-1][1]),
        evidence={"flights": len(intervals)},
    )


def time_slip_row(health: JudgedHealth, instance: int) -> HealthRow:
    """IMU time that the filter lost against the clock between take-off and landing: samples that did not reach it."""
    subject = Subject("filter", health.name_of("filter", instance), GROUP, instance)
    table = health.topic("estimator_status", instance)
    rows = inside(table["timestamp"], health.airborne) if table is not None else np.zeros(0, bool)
    if table is None or "time_slip" not in table or rows.sum() < 2:
        return subject.lacking("time_slip_s", "the log does not tell lost IMU time in flight")
    slip = table["time_slip"][rows].astype(np.float64)
    return subject.judged(
        "time_slip_s",
        "IMU time lost in flight",
        float(slip.max() - slip.min()),
        "s",
        Levels(health.limits.time_slip_s),
        remedy="The processor is overloaded or the IMU drops samples: see its error counter",
    )


def output_rows(health: JudgedHealth, instance: int) -> Iterator[HealthRow]:
    """Median errors with which the output predictor tracks the filter, clear of the ground."""
    subject = Subject("output_predictor", health.name_of("output predictor", instance), GROUP, instance)
    table = next((one for one in _with_output_errors(health, instance) if one is not None), None)
    rows = inside(table["timestamp"], health.clear) if table is not None else np.zeros(0, bool)
    if table is None or not rows.any():
        yield subject.lacking("angle_error_rad", "its errors in flight are not logged")
        return
    for axis, ((name, label, unit), level) in enumerate(zip(_OUTPUT_ERRORS, health.limits.output_errors, strict=True)):
        values = table[f"output_tracking_error[{axis}]"][rows]
        median = float(np.median(values))
        yield subject.judged(name, f"median error of {label}", median, unit, Levels(level), remedy=_LONGEST_DELAY)


def _with_output_errors(health: JudgedHealth, instance: int) -> Iterator[TopicTable | None]:
    for name in ("estimator_status", "ekf2_innovations"):
        table = health.topic(name, instance)
        whole = table is not None and len(field_names(table, "output_tracking_error")) == len(_OUTPUT_ERRORS)
        yield table if whole else None
