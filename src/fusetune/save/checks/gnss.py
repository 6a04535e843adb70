"""Checks of GNSS: whether it is logged and taken, has a fix, calls itself accurate, and does not stand still."""

from __future__ import annotations

import numpy as np

from fusetune.check import Check, check
from fusetune.finding import Finding
from fusetune.px4.flight import select_rows
from fusetune.save.checks.given_words import MEND_DRIVER, told
from fusetune.save.checks.judged_flight import FIX_3D, GIVEN, GNSS, JudgedFlight
from fusetune.save.checks.logging_advice import log_more
from fusetune.save.checks.standstill import FEWEST_STUCK_ROWS, STUCK_AID, STUCK_TOPICS, Subject, stuck
from fusetune.save.log_facts import airborne_intervals, rate_hz

_BETTER_SKY = "Wait for a fix before take-off, with a free sky"
_POSITION = ("latitude_deg", "longitude_deg")
_VELOCITY = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")


@check(topics=GIVEN, thresholds=("low_gnss_rate_hz", "low_gnss_fix_share"), unit="Hz")
def gnss(judged: JudgedFlight) -> Finding:
    """Presence and rate of GNSS, and whether the estimator is given it."""
    limits = judged.limits
    if not judged.is_switched_on("gnss"):
        return gnss.does_not_apply("EKF2_GPS_CTRL switches GNSS off")
    rate = rate_hz(judged.flight.topic(GNSS))
    if rate is None:
        why, remedy = judged.why_no_samples(GNSS, "GNSS")
        if not judged.lacks_fields(GNSS):
            return gnss.does_not_apply("the log holds no GNSS samples")
        return gnss.warned(why, remedy, 0.0, limits.low_gnss_rate_hz)
    one = judged.given["gnss"]
    share = 1.0 - max((rows for _, rows in one.refused), default=0) / one.messages
    if share < limits.low_gnss_fix_share:
        found = f"{told(one)}, at {rate:.1f} Hz"
        evidence = {"messages": one.messages, "given": one.given, "rate_hz": rate}
        return gnss.warned(found, MEND_DRIVER, share, limits.low_gnss_fix_share, unit="", evidence=evidence)
    if rate < limits.low_gnss_rate_hz:
        found = f"GNSS is logged at only {rate:.1f} Hz"
        return gnss.warned(found, log_more(judged.flight, GNSS), rate, limits.low_gnss_rate_hz)
    return gnss.passed(f"GNSS is logged at {rate:.1f} Hz", rate, limits.low_gnss_rate_hz)


@check(topics=(GNSS,), thresholds=("low_gnss_fix_share",))
def gnss_fix(judged: JudgedFlight) -> Finding:
    """Share of the GNSS samples that have a 3D fix."""
    threshold, share = judged.limits.low_gnss_fix_share, judged.fix_share
    if not _is_used(judged):
        return gnss_fix.does_not_apply("GNSS is switched off or not logged")
    if share == 0.0:
        found = "GNSS is logged but never has a 3D fix"
        return gnss_fix.warned(found, "Fly where satellites can be received", share, threshold)
    if share < threshold:
        return gnss_fix.warned(f"GNSS has a 3D fix only {share:.0%} of the time", _BETTER_SKY, share, threshold)
    return gnss_fix.passed(f"GNSS has a 3D fix {share:.0%} of the time", share, threshold)


@check(topics=(GNSS,), thresholds=("high_gnss_eph_m",), unit="m")
def gnss_position_accuracy(judged: JudgedFlight) -> Finding:
    """Horizontal accuracy that the receiver reports, median over the samples with a fix."""
    return _accuracy(gnss_position_accuracy, judged, "eph", judged.limits.high_gnss_eph_m, "m horizontally")


@check(topics=(GNSS,), thresholds=("high_gnss_epv_m",), unit="m")
def gnss_height_accuracy(judged: JudgedFlight) -> Finding:
    """Vertical accuracy that the receiver reports, median over the samples with a fix."""
    return _accuracy(gnss_height_accuracy, judged, "epv", judged.limits.high_gnss_epv_m, "m vertically")


@check(topics=(GNSS,), thresholds=("high_gnss_speed_error_m_s",), unit="m/s")
def gnss_speed_accuracy(judged: JudgedFlight) -> Finding:
    """Accuracy of the velocity that the receiver reports, median over the samples with a fix."""
    limit = judged.limits.high_gnss_speed_error_m_s
    return _accuracy(gnss_speed_accuracy, judged, "s_variance_m_s", limit, "m/s")


def _accuracy(asked: Check[JudgedFlight], judged: JudgedFlight, column: str, threshold: float, words: str) -> Finding:
    table = judged.flight.topic(GNSS)
    if table is None or not _is_used(judged) or not judged.fix_share:
        return asked.does_not_apply("no GNSS samples with a fix and an accuracy")
    median = float(np.median(table[column][table["fix_type"] >= FIX_3D]))
    said = f"the GNSS receiver reports an accuracy of {median:.1f} {words}"
    if median > threshold:
        return asked.warned(f"{said} (more than {threshold:g})", _BETTER_SKY, median, threshold)
    return asked.passed(said, median, threshold)


def _is_used(judged: JudgedFlight) -> bool:
    """Whether GNSS is switched on and logged."""
    table = judged.flight.topic(GNSS)
    return judged.is_switched_on("gnss") and table is not None and bool(len(table["timestamp"]))


@check(topics=(GNSS, *STUCK_TOPICS), thresholds=STUCK_AID, unit="s")
def gnss_stuck(judged: JudgedFlight) -> Finding:
    """Whether GNSS position or velocity stands still in flight, while there is a fix."""
    table = judged.flight.topic(GNSS)
    if table is None or "fix_type" not in table or not judged.is_switched_on("gnss"):
        return gnss_stuck.does_not_apply("GNSS is switched off or not logged")
    table = select_rows(table, table["fix_type"] >= FIX_3D)
    groups = [group for group in (_POSITION, _VELOCITY) if all(column in table for column in group)]
    if len(table["timestamp"]) < FEWEST_STUCK_ROWS or not groups:
        return gnss_stuck.does_not_apply("GNSS never has a fix, or lacks position and velocity")
    if airborne_intervals(judged.flight) == []:
        return gnss_stuck.does_not_apply("on the ground a receiver may hold its position")
    return stuck(gnss_stuck, judged, Subject("GNSS", table, groups, judged.limits.high_stuck_aid_s))
