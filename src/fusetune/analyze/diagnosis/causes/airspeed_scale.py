"""Airspeed is scaled wrongly."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

OFF_FROM, SIGMAS = 0.1, 2.5
"""A pitot tube behind a nose or a propeller is a tenth off."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By airspeed against the velocity over the ground and one wind."""
    one = signs.airspeed
    if one is None:
        return None
    off, level = abs(one.scale - 1.0), OFF_FROM + SIGMAS * one.error
    if off < level:
        return None
    told = signs.parameters.get("ASPD_SCALE_1", 1.0)
    tuned = signs.told_by("airspeed").get("ASPD_SCALE_1")
    mended = tuned.value if tuned is not None else told / one.scale
    words = f"airspeed is {one.scale:.2f} (±{2.0 * one.error:.2f}) times what velocity and wind make"
    return diagnosed(
        signs,
        "airspeed_scale",
        "Airspeed is scaled wrongly",
        "fail" if off > 0.4 else "warning",
        confidence(off, level, 0.95),
        [Sign(words, off, OFF_FROM, "1", "replay")],
        touches=("airspeed",),
        remedy=f"Set ASPD_SCALE_1 to {mended:.2f}; check the tube's place and hoses first",
        values={"ASPD_SCALE_1": round(mended, 3)},
    )
