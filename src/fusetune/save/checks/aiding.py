"""Checks of all sensors together: whether any of them holds the position, and what the estimator is given of each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.flight import Flight
from fusetune.save.checks.given_words import MEND_DRIVER, counted, told
from fusetune.save.checks.judged_flight import (
    ALTITUDE,
    FLOW,
    GIVEN,
    GNSS,
    HORIZONTAL,
    POSITION,
    VELOCITY,
    VISION,
    YAW,
    JudgedFlight,
)
from fusetune.save.checks.logging_advice import log_more

_AUXILIARY_POSITION = "aux_global_position"
_ONBOARD_FLAGS = "estimator_status_flags"
_ONBOARD_AIDS = {
    "cs_gnss_pos": "GNSS",
    "cs_ev_pos": "external vision",
    "cs_ev_vel": "external vision",
    "cs_opt_flow": "optical flow",
    "cs_aux_gpos": "an auxiliary position",
}
"""Control flags of the vehicle's own estimator that stand for horizontal aiding."""


@check(topics=(*GIVEN, _AUXILIARY_POSITION, _ONBOARD_FLAGS))
def horizontal_aid(judged: JudgedFlight) -> Finding:
    """Whether anything that the estimator is given can hold the horizontal position or velocity.

    A flight that was meant to be aided by GNSS and never got a fix is refused; one that flew unaided, or whose aiding
    the log does not hold, still has heights, heading and tilt to judge.
    """
    aids = _horizontal_aids(judged)
    if aids:
        return horizontal_aid.passed(f"horizontal aiding by {', '.join(aids)}", float(len(aids)), 1.0)
    onboard = _onboard_aids(judged.flight)
    flown = f"the vehicle was aided by {', '.join(onboard)}" if onboard else ""
    never_fixed = (
        judged.uses("EKF2_GPS_CTRL", HORIZONTAL) and judged.flight.topic(GNSS) is not None and not judged.fix_share
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


def _horizontal_aids(judged: JudgedFlight) -> list[str]:
    found = []
    if judged.uses("EKF2_GPS_CTRL", HORIZONTAL) and judged.usable_fixes:
        found.append("GNSS")
    vision = (("ev_pos", POSITION), ("ev_vel", VELOCITY))
    if any(judged.uses("EKF2_EV_CTRL", bit) and judged.is_given(sensor) for sensor, bit in vision):
        found.append("external vision")
    if judged.parameters["EKF2_OF_CTRL"] and judged.is_given("flow"):
        found.append("optical flow")
    if judged.uses("EKF2_AGP_CTRL") and judged.flight.topic(_AUXILIARY_POSITION) is not None:
        found.append("an auxiliary position")
    return found


def _unusable_aids(judged: JudgedFlight) -> Iterator[tuple[str, str, str]]:
    """Horizontal aids that are switched on and logged, but not given to the estimator; why not, and the remedy."""
    switched_on = {
        "gnss": judged.uses("EKF2_GPS_CTRL", HORIZONTAL),
        "ev_pos": judged.uses("EKF2_EV_CTRL", POSITION),
        "ev_vel": judged.uses("EKF2_EV_CTRL", VELOCITY),
        "flow": bool(judged.parameters["EKF2_OF_CTRL"]),
    }
    topics = {"gnss": ("GNSS", GNSS), "flow": ("optical flow", FLOW)}
    named = set()
    for sensor in (sensor for sensor, is_on in switched_on.items() if is_on):
        words, topic = topics.get(sensor, ("external vision", VISION))
        if judged.lacks_fields(topic) and topic not in named:
            named.add(topic)
            yield sensor, *judged.why_no_samples(topic, words)
        elif sensor in judged.given and judged.given[sensor].is_withheld:
            yield sensor, told(judged.given[sensor]), MEND_DRIVER


def _onboard_aids(flight: Flight) -> list[str]:
    found: list[str] = []
    for instance in flight.instances(_ONBOARD_FLAGS):
        table = flight.topics[_ONBOARD_FLAGS, instance]
        found += [aid for flag, aid in _ONBOARD_AIDS.items() if flag in table and np.any(table[flag])]
    return list(dict.fromkeys(found))


@check(topics=GIVEN)
def samples_given(judged: JudgedFlight) -> Finding:
    """How many samples of each sensor in use the estimator is given, and why not the others."""
    parameters = judged.parameters
    switched_on = {
        "gnss": judged.uses("EKF2_GPS_CTRL"),
        "gnss_yaw": judged.uses("EKF2_GPS_CTRL", YAW),
        "mag": judged.uses_magnetometer,
        "baro": bool(parameters["EKF2_BARO_CTRL"]),
        "range": parameters["EKF2_RNG_CTRL"] > 0,
        "flow": bool(parameters["EKF2_OF_CTRL"]),
        "airspeed": parameters["EKF2_ARSP_THR"] > 0.0,
        "auxvel": True,
        "ev_pos": judged.uses("EKF2_EV_CTRL", POSITION | ALTITUDE),
        "ev_vel": judged.uses("EKF2_EV_CTRL", VELOCITY),
        "ev_yaw": judged.uses("EKF2_EV_CTRL", YAW),
    }
    used = [one for sensor, one in judged.given.items() if switched_on[sensor]]
    if not used:
        return samples_given.does_not_apply("the log holds no messages of a sensor in use")
    withheld = [one for one in used if one.is_withheld and one.sensor != "gnss"]
    if withheld:
        return samples_given.warned("; ".join(map(told, withheld)), MEND_DRIVER, float(len(withheld)), 0.0)
    return samples_given.passed(f"the estimator is given {', '.join(map(counted, used))}", 0.0, 0.0)
