"""In words, what the estimator is given of a sensor."""

from __future__ import annotations

from fusetune.ekf2.feed.given_samples import GivenSamples
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS

MEND_DRIVER = "Mend what the sensor's driver reports, or switch the sensor off"


def _words(part: str) -> str:
    """What samples are called, by the name of their sensor or part of it."""
    if part in SENSORS:
        return SENSORS[part].label
    return f"{SENSORS[AID_SOURCES[part].sensor].label}'s {AID_SOURCES[part].quantity}"


def told(one: GivenSamples) -> str:
    """That few of a sensor's samples, or none, reach the estimator."""
    why = one.refusals or "none arrives before the next of its kind"
    return f"the estimator is given {one.given} of {one.messages} samples of {_words(one.sensor)} ({why})"


def counted(one: GivenSamples) -> str:
    """How many of a sensor's samples reach the estimator."""
    why = f" ({one.refusals})" if one.refused else ""
    return f"{one.given} of {one.messages} of {_words(one.sensor)}{why}"
