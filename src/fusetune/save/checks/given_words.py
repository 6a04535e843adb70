"""In words, what the estimator is given of a sensor."""

from __future__ import annotations

from fusetune.ekf2.feed.given_samples import GivenSamples

MEND_DRIVER = "Mend what the sensor's driver reports, or switch the sensor off"
_WORDS = {
    "gnss": "GNSS",
    "gnss_yaw": "GNSS's heading",
    "mag": "magnetometer",
    "baro": "barometer",
    "range": "range finder",
    "flow": "optical flow",
    "airspeed": "airspeed",
    "auxvel": "landing target",
    "ev_pos": "external vision's position",
    "ev_vel": "external vision's velocity",
    "ev_yaw": "external vision's heading",
}


def told(one: GivenSamples) -> str:
    """That few of a sensor's samples, or none, reach the estimator."""
    why = one.refusals or "none arrives before the next of its kind"
    return f"the estimator is given {one.given} of {one.messages} samples of {_WORDS[one.sensor]} ({why})"


def counted(one: GivenSamples) -> str:
    """How many of a sensor's samples reach the estimator."""
    why = f" ({one.refusals})" if one.refused else ""
    return f"{one.given} of {one.messages} of {_WORDS[one.sensor]}{why}"
