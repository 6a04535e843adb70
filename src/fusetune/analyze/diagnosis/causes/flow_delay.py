"""PX4 is told another delay of optical flow than it has."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.flow_rotation import not_turned
from fusetune.analyze.diagnosis.causes.told_delay import told_wrong
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.diagnosis.signs import Signs

EARLIEST_MS = -20.0
"""No sensor on board is early."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time by which flow lags behind the motion, where it is not turned."""
    one = signs.flow
    if one is None or not not_turned(one):
        return None
    return told_wrong(
        signs, "flow_delay", "Optical flow", "EKF2_OF_DELAY", one.fit, "optical_flow", earliest_ms=EARLIEST_MS
    )
