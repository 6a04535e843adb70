"""Checks of the magnetometer: whether it is logged, whether it stands still, and whether its field is the earth's.

How it is mounted is checked in `fusetune.save.checks.magnetometer_mounting`.
"""

from __future__ import annotations

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.flight import field_names, stacked
from fusetune.save.checks.judged_flight import IS_COMPLETE, MAG, JudgedFlight
from fusetune.save.checks.logging_advice import log_more, slowness
from fusetune.save.checks.standstill import FEWEST_STUCK_ROWS, STUCK_AID, STUCK_TOPICS, Subject, stuck
from fusetune.save.log_facts import rate_hz

_OFF = "the magnetometer is switched off or not logged"


@check(topics=(MAG, *IS_COMPLETE), thresholds=("low_magnetometer_rate_hz",), unit="Hz")
def magnetometer(judged: JudgedFlight) -> Finding:
    """Whether the heading has its usual reference."""
    threshold = judged.limits.low_magnetometer_rate_hz
    if not judged.is_switched_on("mag"):
        return magnetometer.does_not_apply("EKF2_MAG_TYPE switches the magnetometer off")
    rate = rate_hz(judged.flight.topic(MAG))
    if rate is None:
        why, remedy = judged.why_no_samples(MAG, "magnetometer")
        return magnetometer.warned(f"{why}: the heading comes from other sources only", remedy, 0.0, threshold)
    if rate < threshold:
        found = slowness(judged.flight, MAG, "magnetometer", rate)
        return magnetometer.warned(found, log_more(judged.flight, MAG), rate, threshold)
    return magnetometer.passed(f"the magnetometer is logged at {rate:.1f} Hz", rate, threshold)


@check(topics=(MAG, *STUCK_TOPICS), thresholds=STUCK_AID, unit="s")
def magnetometer_stuck(judged: JudgedFlight) -> Finding:
    """Whether an axis of the magnetometer stands still."""
    table = judged.flight.topic(MAG)
    if table is None or len(table["timestamp"]) < FEWEST_STUCK_ROWS or not judged.is_switched_on("mag"):
        return magnetometer_stuck.does_not_apply(_OFF)
    axes = [[column] for column in field_names(table, "magnetometer_ga")]
    return stuck(magnetometer_stuck, judged, Subject("the magnetometer", table, axes, judged.limits.high_stuck_aid_s))


@check(topics=(MAG,), thresholds=("low_field_strength_ga", "high_field_strength_ga"), unit="Gs")
def magnetometer_strength(judged: JudgedFlight) -> Finding:
    """Median strength of the measured field, which the earth's bounds."""
    table = judged.flight.topic(MAG)
    if table is None or not len(table["timestamp"]) or not judged.is_switched_on("mag"):
        return magnetometer_strength.does_not_apply(_OFF)
    strength = float(np.median(np.linalg.norm(stacked(table, "magnetometer_ga"), axis=1)))
    said = f"the magnetometer measures a field of {strength:.3g} Gs"
    low, high = judged.limits.low_field_strength_ga, judged.limits.high_field_strength_ga
    if not low <= strength <= high:
        remedy = "Calibrate the magnetometer away from steel and currents; check that its driver gives Gauss"
        found = f"{said}; the earth's field has 0.2 to 0.7"
        return magnetometer_strength.warned(found, remedy, strength, low if strength < low else high)
    return magnetometer_strength.passed(said, strength, low)
