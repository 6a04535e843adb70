"""The static pressure depends on the airspeed: the height follows how fast, and which way, the vehicle flies."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

COEFFICIENT_FROM, TOGETHER = 0.17, 11.0
"""Share of the dynamic pressure: 0.2 moves the height by 1 m at 10 m/s. χ² of three
directions is above 11 by chance once in a hundred flights, hardly ever with a coefficient that large."""
RANGE_FROM_M, LEAST_RANGE_M = 0.3, 0.15
"""Less than that no flight suffers from, whatever the coefficient."""
PARAMETERS = {
    "forward": ("EKF2_PCOEF_XP",),
    "backward": ("EKF2_PCOEF_XN",),
    "sideways": ("EKF2_PCOEF_YP", "EKF2_PCOEF_YN"),
}
LARGEST = 0.5
UNCONFIRMED = 0.6
"""As sure at most, where the tuner of the effect does not tell it: a coefficient beyond 0.5 out of a slow flight is
something else that came with the motion."""
FAILS_FROM_M = 5.0


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the dynamic pressure along the axes of the body, with thrust and nearness of the ground taken out."""
    errors = signs.barometer.errors if signs.barometer is not None else None
    if errors is None:
        return None
    effects = list(errors.speed.values())
    # all directions together: holes and boxes disturb the flow from more than one side
    together = sum((one.value / max(one.error, 1e-6)) ** 2 for one in effects if one.range_m > LEAST_RANGE_M)
    if together < TOGETHER:
        return None
    seen: list[tuple[Sign, tuple[str, ...]]] = []
    own: dict[str, float] = {}
    for direction, effect in errors.speed.items():
        size = abs(effect.value)
        if size < COEFFICIENT_FROM + 0.5 * effect.error or effect.range_m < LEAST_RANGE_M:
            continue
        side = "more" if effect.value > 0.0 else "less"
        words = (
            f"flying {direction} the barometer reads up to {effect.range_m:.1f} m {side} (coefficient "
            f"{effect.value:+.2f} ± {2.0 * effect.error:.2f})"
        )
        seen.append((Sign(words, size, COEFFICIENT_FROM, "1", "replay"), PARAMETERS[direction]))
        # EKF2 adds what a positive coefficient says the barometer reads low
        own |= dict.fromkeys(PARAMETERS[direction], round(max(-LARGEST, min(LARGEST, -effect.value)), 3))
    range_m = max(one.range_m for one in effects)
    if not seen or range_m < RANGE_FROM_M:
        return None
    # the tuner's model knows the wind, and what barometer and GNSS wander by: without it there is no warning
    tuned = signs.told_by("static_pressure")
    found: list[Sign] = []
    values: dict[str, float] = {}
    is_confirmed = False
    for sign, names in seen:
        told = [tuned[name] for name in names if name in tuned]
        sure = [one for one in told if not one.lower <= 0.0 <= one.upper]
        if told and not sure:
            continue
        found.append(sign)
        is_confirmed |= bool(sure)
        values |= {name: round(tuned[name].value, 3) if name in tuned else own[name] for name in names}
    if not found:
        return None
    found.sort(key=lambda one: -one.figure)
    return diagnosed(
        signs,
        "static_pressure",
        "The barometer follows the airspeed",
        "note" if not is_confirmed else "fail" if range_m > FAILS_FROM_M else "warning",
        confidence(found[0].figure, COEFFICIENT_FROM, 0.9 if is_confirmed else UNCONFIRMED),
        found,
        touches=("baro", "gnss_hgt", "rng"),
        values=values,
        remedy="Shield the barometer from the airflow (foam, a closed bay). Else fly forward, back, left and right at "
        "speed in still air and set EKF2_PCOEF_*; they act only where wind is estimated (airspeed, sideslip or "
        "drag fusion)",
    )
