"""PX4 is told another delay of external vision than it has."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.diagnosis.vision_signs import LEAST_SPEED_M_S

MATTERS_MS, SIGMAS = 20.0, 2.5
SCALE_OFF = 0.2


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time by which vision lags behind the motion; a wrong scale looks like one, so there is none beside it."""
    one = signs.vision
    if one is None or one.speed < LEAST_SPEED_M_S or abs(one.scale - 1.0) > SCALE_OFF:
        return None
    told = signs.parameters["EKF2_EV_DELAY"]
    value, error = 1e3 * one.fit.delay_s, 1e3 * one.fit.delay_error_s
    off, level = abs(value - told), MATTERS_MS + SIGMAS * error
    if off < level:
        return None
    mended = max(0.0, round(value, -1))
    words = f"vision lags behind the motion by {value:.0f} ms (±{2.0 * error:.0f}), PX4 is told {told:.0f}"
    return diagnosed(
        signs,
        "vision_delay",
        f"Vision is {value:.0f} ms late, and PX4 is told {told:.0f}",
        "warning",
        confidence(off, level, 0.95),
        [Sign(words, off, level, "ms", "replay")],
        touches=("ev",),
        remedy=f"Synchronise the clocks of camera and autopilot, or set EKF2_EV_DELAY to {mended:.0f} ms",
        values={"EKF2_EV_DELAY": mended},
    )
