"""The variance that vision claims is far from its errors."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

SMALL_FROM, LARGE_FROM = 1.6, 12.0
"""White noise over claim, and claim over white noise: vision wanders besides, so a claim of a few times the noise is
sound."""
REMEDY = (
    "Let vision report variances that match its errors, or set EKF2_EV_NOISE_MD 1 and EKF2_EVP_NOISE, EKF2_EVV_NOISE, "
    "EKF2_EVA_NOISE to what it does"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the noise of its readings against what the messages claim."""
    one = signs.vision
    if one is None:
        return None
    found: list[Sign] = []
    values: dict[str, float] = {}
    for label, noise, claimed, unit in (
        ("velocity", one.velocity_noise, one.claimed_velocity, "m/s"),
        ("position", one.position_noise, one.claimed_position, "m"),
    ):
        if not (np.isfinite(noise) and np.isfinite(claimed) and claimed > 0.0):
            continue
        values |= {f"{label}_noise": round(noise, 4), f"{label}_claimed": round(claimed, 4)}
        if noise > SMALL_FROM * claimed:
            found.append(
                Sign(
                    f"{label} scatters by {noise:.3f} {unit}, and claims {claimed:.3f}",
                    noise / claimed,
                    SMALL_FROM,
                    "1",
                )
            )
        elif claimed > LARGE_FROM * noise:
            found.append(
                Sign(
                    f"{label} claims {claimed:.3f} {unit}, and scatters by {noise:.3f}",
                    claimed / noise,
                    LARGE_FROM,
                    "1",
                )
            )
    small = [sign for sign in found if sign.usual == SMALL_FROM]
    if not small and len(found) < 2:
        return None
    worst = max(found, key=lambda sign: sign.figure / sign.usual)
    return diagnosed(
        signs,
        "vision_covariance",
        "Vision claims a variance far from its errors",
        "warning",
        confidence(worst.figure, 0.8 * worst.usual, 0.93),
        found,
        touches=("ev",),
        remedy=REMEDY,
        values=values,
    )
