"""The barometer drifts: sunlight, warming, weather."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

DRIFT_FROM_M, SIGMAS = 2.0, 1.5
"""Within minutes; healthy barometers and GNSS heights part by up to 1.8 m in that time."""
AGREES = 0.6
FAILS_FROM_M = 15.0
REMEDY = (
    "Keep sun and airflow off the barometer (cover, foam) and let the autopilot warm up before take-off; on long "
    "flights "
    "let GNSS or a range finder lead the height (EKF2_HGT_REF)"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By how it parts from GNSS height and from the integrated vertical velocity alike."""
    one = signs.barometer
    if one is None or one.drifted is None:
        return None
    drift, inertial = one.drift, one.inertial_drift
    level = DRIFT_FROM_M + SIGMAS * one.drift_error
    if abs(drift) < level or inertial / drift < AGREES:
        return None
    words = f"it parts from GNSS height by {drift:+.1f} m, and from the integrated velocity by {inertial:+.1f} m"
    return diagnosed(
        signs,
        "baro_drift",
        "The barometer drifts",
        "fail" if abs(drift) > FAILS_FROM_M else "warning",
        confidence(abs(drift), level, 0.93),
        [Sign(words, abs(drift), DRIFT_FROM_M, "m", "replay")],
        touches=("baro", "gnss_hgt", "rng"),
        remedy=REMEDY,
        when=one.drifted,
        values={"drift_m": round(drift, 2)},
    )
