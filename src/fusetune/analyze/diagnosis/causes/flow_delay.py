"""PX4 is told another delay of optical flow than it has."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.causes.flow_rotation import not_turned
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

MATTERS_MS, SIGMAS = 20.0, 2.5


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time by which flow lags behind the motion."""
    one = signs.flow
    if one is None or not not_turned(one):
        return None
    told = signs.parameters["EKF2_OF_DELAY"]
    value, error = 1e3 * one.fit.delay_s, 1e3 * one.fit.delay_error_s
    off, level = abs(value - told), MATTERS_MS + SIGMAS * error
    if off < level:
        return None
    mended = max(0.0, round(value, -1))
    words = f"flow lags behind the motion by {value:.0f} ms (±{2.0 * error:.0f}), PX4 is told {told:.0f}"
    return diagnosed(
        signs,
        "flow_delay",
        f"Optical flow is {value:.0f} ms late, and PX4 is told {told:.0f}",
        "warning",
        confidence(off, level, 0.93),
        [Sign(words, off, level, "ms", "replay")],
        touches=("optical_flow",),
        remedy=f"Set EKF2_OF_DELAY to {mended:.0f} ms",
        values={"EKF2_OF_DELAY": mended},
    )
