"""PX4 is told another delay of GNSS than the receiver has."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

MATTERS_MS, SIGMAS = 20.0, 4.0
"""EKF2 acts on delays in steps of 10 ms. The errors of the regression are up to twice what it promises."""
CONFIRMED_SIGMAS = 2.0
FAILS_FROM_MS = 150.0


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the velocity's error in proportion to the acceleration; the value is that of the smoothed velocity."""
    motion = signs.gnss_motion
    if motion is None:
        return None
    told = signs.parameters["EKF2_GPS_DELAY"]
    value, error = 1e3 * motion.fit.delay_s, 1e3 * motion.fit.delay_error_s
    off = value - told
    if abs(off) < MATTERS_MS + SIGMAS * error:
        return None
    words = f"velocity lags behind the motion by {value:.0f} ms (±{SIGMAS * error:.0f}), PX4 is told {told:.0f}"
    found = [Sign(words, abs(off), MATTERS_MS + SIGMAS * error, "ms", "replay")]
    place = signs.gnss_place
    if place is not None:
        # the estimate that is told of the flight elsewhere, too; the regression above is what it costs to ask whether
        again, spread = 1e3 * place.lag.delay_s, 1e3 * place.lag.standard_error_s
        if (again - told) * off <= 0.0 or abs(again - told) < 0.5 * MATTERS_MS + CONFIRMED_SIGMAS * spread:
            return None
        words = f"the smoothed velocity says {again:.0f} ms (±{2.0 * spread:.0f})"
        found.insert(0, Sign(words, abs(again - told), MATTERS_MS, "ms", "replay"))
        value = again
    limit = PARAMETERS["EKF2_GPS_DELAY"]
    mended = min(max(10.0 * round(value / 10.0), limit.minimum or 0.0), limit.maximum or 300.0)
    return diagnosed(
        signs,
        "gnss_delay",
        f"GNSS is {value:.0f} ms late, and PX4 is told {told:.0f}",
        "fail" if abs(off) > FAILS_FROM_MS else "warning",
        confidence(abs(off), MATTERS_MS + SIGMAS * error, 0.95 if place is not None else 0.8),
        found,
        touches=("gnss_vel", "gnss_pos"),
        values={"EKF2_GPS_DELAY": mended},
        remedy=f"Set EKF2_GPS_DELAY to {mended:.0f} ms, after other flights that accelerate and stop agree",
    )
