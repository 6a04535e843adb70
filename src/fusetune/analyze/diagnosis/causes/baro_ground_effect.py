"""The barometer dips near the ground, where the rotors' wash comes back."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.effects.ground_effect import MARGIN

DIP_FROM_M, USUAL_M = 1.2, 0.9
"""Usual dips are below 0.9 m, and EKF2_GND_EFF_DZ of 4 m takes them; what is more shows in the height all the same. The
sign misses the dip by 0.3 m, so the tuner is asked from below the level on, which misses it by 0.12 m where it is sure;
where it is not, its whole interval has to lie above what is usual."""
SIGN_FROM_M, SIGMAS = 1.3, 1.5
"""Of the sign alone, where the tuner does not tell."""
FAILS_FROM_M = 8.0


def diagnose(signs: Signs) -> Diagnosis | None:
    """By what the barometer reads less the nearer the ground is, with thrust and speed taken out."""
    errors = signs.barometer.errors if signs.barometer is not None else None
    if errors is None:
        return None
    dip, error = -errors.ground.value, errors.ground.error
    if dip < USUAL_M or abs(errors.thrust.value) > dip:
        return None
    told = signs.told_by("ground_effect").get("EKF2_GND_EFF_DZ")
    if told is not None:
        dip, error = told.value / MARGIN, told.standard_error / MARGIN
    level = max(DIP_FROM_M, USUAL_M + 2.0 * error) if told is not None else SIGN_FROM_M + SIGMAS * error
    if dip < level:
        return None
    zone = round(MARGIN * dip, 1)
    words = f"near the ground the barometer reads {dip:.1f} m (±{2.0 * error:.1f}) less"
    return diagnosed(
        signs,
        "baro_ground_effect",
        "The barometer dips near the ground",
        "fail" if dip > FAILS_FROM_M else "warning",
        confidence(dip, level),
        [Sign(words, dip, DIP_FROM_M, "m", "replay")],
        touches=("baro", "rng"),
        remedy=f"Set EKF2_GND_EFF_DZ to {min(zone, 10.0):.1f} m, and EKF2_GND_MAX_HGT where a range finder is fitted; "
        "better, cover the barometer with open-cell foam or move it",
        values={"EKF2_GND_EFF_DZ": min(zone, 10.0)},
    )
