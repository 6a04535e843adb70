"""Checks of the barometer, the usual reference of the height."""

from __future__ import annotations

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.save.checks.judged_flight import BARO, GIVEN, JudgedFlight
from fusetune.save.checks.logging_advice import log_more, slowness
from fusetune.save.checks.standstill import FEWEST_STUCK_ROWS, STUCK_AID, STUCK_TOPICS, Subject, stuck
from fusetune.save.log_facts import rate_hz

_HEIGHTS = tuple(one for one in AID_SOURCES.values() if one.sensor and one.quantity == "height")


@check(topics=GIVEN, thresholds=("low_barometer_rate_hz",), unit="Hz")
def barometer(judged: JudgedFlight) -> Finding:
    """Whether the height has a reference: the barometer, or another source that takes its place."""
    threshold = judged.limits.low_barometer_rate_hz
    rate = rate_hz(judged.flight.topic(BARO))
    if rate is not None and rate >= threshold:
        return barometer.passed(f"the barometer is logged at {rate:.1f} Hz", rate, threshold)
    if rate is not None:
        found = slowness(judged.flight, BARO, "barometer", rate)
        return barometer.warned(found, log_more(judged.flight, BARO), rate, threshold)
    others = judged.from_sensors(one for one in _HEIGHTS if one.sensor != "baro")
    why, remedy = judged.why_no_samples(BARO, "barometer")
    if not others:
        said = "nothing in the log measures the height"
        found = f"{said} ({why})" if judged.lacks_fields(BARO) else said
        return barometer.failed(found, remedy, 0.0, threshold)
    if not judged.is_switched_on("baro"):
        return barometer.does_not_apply("EKF2_BARO_CTRL switches the barometer off")
    return barometer.warned(f"{why}; height from {', '.join(others)}", remedy, 0.0, threshold)


@check(topics=(BARO, *STUCK_TOPICS), thresholds=STUCK_AID, unit="s")
def barometer_stuck(judged: JudgedFlight) -> Finding:
    """Whether the barometer stands still."""
    table = judged.flight.topic(BARO)
    if table is None or len(table["timestamp"]) < FEWEST_STUCK_ROWS or not judged.is_switched_on("baro"):
        return barometer_stuck.does_not_apply("the barometer is switched off or not logged")
    subject = Subject("the barometer", table, [["baro_alt_meter"]], judged.limits.high_stuck_aid_s)
    return stuck(barometer_stuck, judged, subject)
