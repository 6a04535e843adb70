"""PX4 is told another delay of optical flow than it has."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.flow_rotation import not_turned
from fusetune.analyze.diagnosis.causes.told_delay import told_wrong
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.diagnosis.signs import Signs

EARLIEST_MS = -20.0
"""No sensor on board is early."""
ASKED_FROM_S = 0.015
"""The sign misses the lag by 9 ms in the median and by 86 at most: from there on the tuner is asked, which misses it by
6 and 57."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time by which flow lags behind the motion, where it is not turned."""
    one = signs.flow
    if one is None or not not_turned(one):
        return None
    told_s = 1e-3 * signs.parameters["EKF2_OF_DELAY"]
    lag = one.fit.delay_s, one.fit.delay_error_s
    if abs(lag[0] - told_s) > ASKED_FROM_S:
        tuned = signs.told_by("flow").get("EKF2_OF_DELAY")
        if tuned is not None and 1e-3 * tuned.standard_error < lag[1]:
            lag = 1e-3 * tuned.value, 1e-3 * tuned.standard_error
    return told_wrong(
        signs, "flow_delay", "Optical flow", "EKF2_OF_DELAY", lag, "optical_flow", earliest_ms=EARLIEST_MS
    )
