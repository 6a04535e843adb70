"""External vision is scaled wrongly, as with one camera."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.diagnosis.vision_signs import LEAST_SPEED_M_S

OFF_FROM, SIGMAS = 0.055, 3.0
ASKED_FROM = 0.02
"""The sign says less than there is by up to a third, and is off by 0.05 where the delay is told wrong: from here on the
tuner is asked, which misses the scale by some thousandths, but follows a frame that is turned, so both must agree."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the way by vision over the way by IMU."""
    one = signs.vision
    if one is None or one.speed < LEAST_SPEED_M_S:
        return None
    if abs(one.scale - 1.0) < ASKED_FROM or one.scale < 0.05:
        return None
    tuned = signs.told_by("vision").get("vision_scale")
    scale, error = (tuned.value, tuned.standard_error) if tuned is not None else (one.scale, one.scale_error)
    off, level = abs(scale - 1.0), OFF_FROM + SIGMAS * error
    if off < level or (scale - 1.0) * (one.scale - 1.0) < 0.0:
        return None
    words = f"vision's way is {scale:.2f} (±{2.0 * error:.2f}) times the vehicle's"
    return diagnosed(
        signs,
        "vision_scale",
        "Vision is scaled wrongly",
        "fail" if off > 0.4 else "warning",
        confidence(off, level, 0.95),
        [Sign(words, off, OFF_FROM, "1", "replay")],
        touches=("ev",),
        values={"vision_scale": round(scale, 3)},
        remedy=f"Give vision its scale (stereo, IMU or a known length), or divide by {scale:.2f} before it is sent",
    )
