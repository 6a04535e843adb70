"""PX4 is told another delay of external vision than it has."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.told_delay import told_wrong
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.diagnosis.vision_signs import LEAST_SPEED_M_S

SCALE_OFF = 0.2
EARLIEST_MS = -200.0
"""Clocks that are not synchronised may make vision early, but not by more."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time by which vision lags behind the motion; a wrong scale looks like one, so there is none beside it."""
    one = signs.vision
    if one is None or one.speed < LEAST_SPEED_M_S or abs(one.scale - 1.0) > SCALE_OFF:
        return None
    return told_wrong(
        signs,
        "vision_delay",
        "Vision",
        "EKF2_EV_DELAY",
        (one.fit.delay_s, one.fit.delay_error_s),
        "ev",
        earliest_ms=EARLIEST_MS,
        first="Synchronise the clocks of camera and autopilot; else ",
    )
