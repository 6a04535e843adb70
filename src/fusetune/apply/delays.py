"""Delays of sensors that PX4 is told wrong, as findings: told first, for other sets are worth little beside them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from fusetune.analyze.delays.wrong_delays import STEP_MS, TRIED_SENSORS, JoinedDelay
from fusetune.apply.choice import Choice
from fusetune.apply.ranking import RankedSet
from fusetune.design.tunable_parameters import DELAY_LIMIT
from fusetune.finding import Finding
from fusetune.px4.aid_sources import SENSORS
from fusetune.set_names import DELAY_MENDED

WRONG, UNCONFIRMED = "sensor_delay_wrong", "sensor_delay_not_confirmed"
SINGLE, UNTRIED = "sensor_delay_of_one_flight", "sensor_delay_to_be_checked"


def delay_findings(delays: Iterable[JoinedDelay]) -> tuple[Finding, ...]:
    """Findings about delays: warnings where one is proved wrong, notes where a single flight says so, or estimates that
    have not been held against the truth.
    """
    found = []
    for one in delays:
        if one.mended_ms is not None:
            found.append(_wrong(one))
        elif len(one.flights) == 1 and _off_ms(one) > STEP_MS:
            found.append(_of_one_flight(one))
        elif one.sensor not in TRIED_SENSORS and _off_ms(one) > STEP_MS:
            found.append(_untried(one))
    return tuple(found)


def delay_sentences(findings: Sequence[Finding]) -> str:
    """What the paragraph of the decision begins with; empty where no delay is proved wrong."""
    wrong = [one for one in findings if one.id in (WRONG, UNCONFIRMED)]
    return " ".join(f"{one.found}: {one.remedy[0].lower()}{one.remedy[1:]}." for one in wrong)


def confirmed(findings: Sequence[Finding], choice: Choice, ranked: Sequence[RankedSet]) -> tuple[Finding, ...]:
    """The findings, with no advice to set a delay that the predictions with it mended speak against.

    Parameters
    ----------
    choice, ranked : the decision with the delays mended among its sets
    """
    mended = next((one for one in ranked if one.name == DELAY_MENDED), None)
    if choice.mends_delays or mended is None:
        return tuple(findings)
    return tuple(_unconfirmed(one, mended) if one.id == WRONG else one for one in findings)


def _unconfirmed(one: Finding, mended: RankedSet) -> Finding:
    value = f"{one.evidence['parameter']} = {one.evidence['mended_ms']:g}"
    against = f"ruled out with it ({mended.reasons[0]})" if mended.reasons else "no better with it"
    if mended.worse_aims:
        against = "worse with it beyond doubt in one way of predicting"
    return replace(
        one,
        id=UNCONFIRMED,
        severity="note",
        remedy=f"Not set, as the present parameters are {against}: compare {value} with values between in a study, on "
        "logs that hold every GNSS sample",
    )


def _wrong(one: JoinedDelay) -> Finding:
    assert one.mended_ms is not None
    remedy = f"Set {one.parameter} to {one.mended_ms:g}"
    if one.needed_ms is not None:
        remedy += f", and {DELAY_LIMIT}, now {one.reach_ms:g}, to {one.needed_ms:g}, as EKF2 reaches no further back"
    return Finding(
        id=WRONG,
        severity="warning",
        found=_measured(one),
        remedy=remedy,
        figure=one.value_ms,
        threshold=one.told_ms,
        unit="ms",
        evidence={**_evidence(one), "mended_ms": one.mended_ms, "set": DELAY_MENDED},
    )


def _of_one_flight(one: JoinedDelay) -> Finding:
    return Finding(
        id=SINGLE,
        severity="note",
        found=f"{_measured(one)}, as far as one flight can tell",
        remedy="Fly and add another flight with brisk accelerations",
        figure=one.value_ms,
        threshold=one.told_ms,
        unit="ms",
        evidence=_evidence(one),
    )


def _untried(one: JoinedDelay) -> Finding:
    return Finding(
        id=UNTRIED,
        severity="note",
        found=f"{_measured(one)}, by an estimate that has not been held against known delays of this sensor",
        remedy=f"Compare sets with other values of {one.parameter} in a study before it is changed",
        figure=one.value_ms,
        threshold=one.told_ms,
        unit="ms",
        evidence=_evidence(one),
    )


def _measured(one: JoinedDelay) -> str:
    label = SENSORS[one.sensor].label
    label = label[0].upper() + label[1:]
    span = f"{one.lower_ms:.0f} to {one.upper_ms:.0f}".replace("-", "−")
    return (
        f"{label} arrives {one.value_ms:.0f} ms after its measurement (95 % interval {span} ms), "
        f"and PX4 is told {one.parameter} = {one.told_ms:g}"
    ).replace("-", "−")


def _evidence(one: JoinedDelay) -> dict[str, bool | int | float | str]:
    return {
        "sensor": one.sensor, "parameter": one.parameter, "told_ms": one.told_ms, "lower_ms": one.lower_ms,
        "upper_ms": one.upper_ms, "flights": len(one.flights),
    }  # fmt: skip


def _off_ms(one: JoinedDelay) -> float:
    """By how much the told delay lies outside the interval."""
    return max(one.lower_ms - one.told_ms, one.told_ms - one.upper_ms)
