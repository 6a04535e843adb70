"""The barometer follows the throttle: it sits in the propellers' wash."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

WASH_FROM_M, SIGMAS = 1.2, 2.0
"""For a thrust of the weight; usual are some decimetres."""
FAILS_FROM_M = 8.0
REMEDY = (
    "Move the barometer out of the propellers' wash, close its bay or cover it with open-cell foam. Until then raise "
    "EKF2_BARO_NOISE and let GNSS lead the height (EKF2_HGT_REF 1)"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By what the barometer reads for the thrust, with speed and nearness of the ground taken out."""
    errors = signs.barometer.errors if signs.barometer is not None else None
    if errors is None or signs.motion is None:
        return None
    wash, error = errors.thrust.value, errors.thrust.error
    size = abs(wash)
    if size < WASH_FROM_M + SIGMAS * error or -errors.ground.value > size:
        return None
    words = (
        f"the barometer reads {wash:+.1f} m (±{2.0 * error:.1f}) with the thrust of a hover "
        f"({signs.motion.thrust_source})"
    )
    return diagnosed(
        signs,
        "propeller_wash",
        "The barometer follows the throttle",
        "fail" if size > FAILS_FROM_M else "warning",
        confidence(size, WASH_FROM_M + SIGMAS * error),
        [Sign(words, size, WASH_FROM_M, "m", "replay")],
        touches=("baro", "rng"),
        remedy=REMEDY,
        values={"wash_m": round(wash, 2)},
    )
