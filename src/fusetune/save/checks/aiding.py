"""Checks of all sensors together: whether any of them holds the position, and what the estimator is given of each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS
from fusetune.px4.flight import Flight
from fusetune.save.checks.given_words import MEND_DRIVER, counted, told
from fusetune.save.checks.judged_flight import GIVEN, GNSS, JudgedFlight
from fusetune.save.checks.logging_advice import log_more

_HORIZONTAL_AIDS = tuple(one for one in AID_SOURCES.values() if one.stops_drift and one.flags)
"""Auxiliary velocity, which has no flag, is fused only beside another of them."""

_ONBOARD_FLAGS = "estimator_status_flags"
_ONBOARD_AIDS = {flag: SENSORS[one.sensor].label for one in _HORIZONTAL_AIDS for flag in one.flags}
"""Control flags of the vehicle's own estimator that stand for horizontal aiding."""


@check(topics=(*GIVEN, _ONBOARD_FLAGS))
def horizontal_aid(judged: JudgedFlight) -> Finding:
    """Whether anything that the estimator is given can hold the horizontal position or velocity.

    A flight that was meant to be aided by GNSS and never got a fix is refused; one that flew unaided, or whose aiding
    the log does not hold, still has heights, heading and tilt to judge.
    """
    aids = judged.from_sensors(_HORIZONTAL_AIDS)
    if aids:
        return horizontal_aid.passed(f"horizontal aiding by {', '.join(aids)}", float(len(aids)), 1.0)
    onboard = _onboard_aids(judged.flight)
    flown = f"the vehicle was aided by {', '.join(onboard)}" if onboard else ""
    never_fixed = (
        any(one.sensor == "gnss" and judged.may_fuse(one) for one in _HORIZONTAL_AIDS)
        and judged.flight.topic(GNSS) is not None
        and not judged.fix_share
    )
    unusable = list(_unusable_aids(judged))
    if never_fixed and not onboard:
        found = "not replayable with GNSS: it never has a 3D fix, and nothing else aids the horizontal position"
        others = "; ".join(why for sensor, why, _ in unusable if sensor != "gnss")
        found = f"{found} ({others})" if others else found
        return horizontal_aid.failed(found, "Fly where satellites can be received, or log the other aid", 0.0, 1.0)
    if unusable:
        found = f"no horizontal aiding: {'; '.join(why for _, why, _ in unusable)}{f'; {flown}' if flown else ''}"
        return horizontal_aid.warned(found, unusable[0][2], 0.0, 1.0)
    if onboard:
        found = f"{flown}, whose samples the log lacks: no horizontal aiding"
        return horizontal_aid.warned(found, log_more(judged.flight, ""), 0.0, 1.0)
    found = "nothing in the log aids the horizontal position: only height, heading and tilt can be judged"
    return horizontal_aid.warned(found, "Log GNSS, optical flow or external vision", 0.0, 1.0)


def _unusable_aids(judged: JudgedFlight) -> Iterator[tuple[str, str, str]]:
    """Horizontal aids that are switched on and logged, but not given to the estimator; why not, and the remedy."""
    named = set()
    switched_on = {one.part or one.sensor: SENSORS[one.sensor] for one in _HORIZONTAL_AIDS if judged.may_fuse(one)}
    for part, sensor in switched_on.items():
        topic = sensor.topics[0].name
        if judged.lacks_fields(topic) and topic not in named:
            named.add(topic)
            yield part, *judged.why_no_samples(topic, sensor.label)
        elif part in judged.given and judged.given[part].is_withheld:
            yield part, told(judged.given[part]), MEND_DRIVER


def _onboard_aids(flight: Flight) -> list[str]:
    found: list[str] = []
    for instance in flight.instances(_ONBOARD_FLAGS):
        table = flight.topics[_ONBOARD_FLAGS, instance]
        found += [aid for flag, aid in _ONBOARD_AIDS.items() if flag in table and np.any(table[flag])]
    return list(dict.fromkeys(found))


@check(topics=GIVEN)
def samples_given(judged: JudgedFlight) -> Finding:
    """How many samples of each sensor in use the estimator is given, and why not the others."""
    used = [one for sensor, one in judged.given.items() if judged.is_switched_on(sensor)]
    if not used:
        return samples_given.does_not_apply("the log holds no messages of a sensor in use")
    withheld = [one for one in used if one.is_withheld and one.sensor != "gnss"]
    if withheld:
        return samples_given.warned("; ".join(map(told, withheld)), MEND_DRIVER, float(len(withheld)), 0.0)
    return samples_given.passed(f"the estimator is given {', '.join(map(counted, used))}", 0.0, 0.0)
