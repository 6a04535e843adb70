"""Something in the range finder's beam, or readings that stick."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

SHORT_FROM, CONSTANT_FROM = 0.03, 0.6
REMEDY = (
    "Clear the beam: legs, cables, a payload that swings, a dirty window. In fog or dust the sensor reads its "
    "own range; "
    "EKF2_RNG_FOG tells the filter from how near on"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By readings far below the height that are all alike while the height is not."""
    one = signs.range
    if one is None or one.short_share < SHORT_FROM or one.constant_share < CONSTANT_FROM:
        return None
    words = f"{one.short_share:.0%} of the readings in the air are {one.short_m:.2f} m, whatever the height"
    return diagnosed(
        signs,
        "range_obstruction",
        "Something is in the beam of the range finder",
        "fail" if one.short_share > 0.5 else "warning",
        confidence(one.short_share, SHORT_FROM),
        [Sign(words, one.short_share, SHORT_FROM, "1", "replay")],
        touches=("rng", "optical_flow"),
        remedy=REMEDY,
        when=one.short,
        values={"obstruction_m": round(one.short_m, 3)},
    )
