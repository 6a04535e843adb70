"""The static pressure depends on the airspeed: the height follows how fast, and which way, the vehicle flies."""

from __future__ import annotations

import math

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.height_errors import Effect
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.effects.estimate import Estimate

COEFFICIENT_FROM, TOGETHER = 0.12, 11.0
"""Share of the dynamic pressure: half of 0.24, which moves the height by 0.8 m at 8 m/s. χ² of three directions is
above 11 by chance once in a hundred flights, hardly ever with a coefficient that large."""
LARGEST_SHARE = 1.2
"""No hole feels more than the dynamic pressure: what is beyond is something else that came with the motion."""
RANGE_FROM_M, LEAST_RANGE_M = 0.2, 0.12
"""Less than that no flight suffers from, whatever the coefficient."""
PARAMETERS = {
    "forward": ("EKF2_PCOEF_XP",),
    "backward": ("EKF2_PCOEF_XN",),
    "sideways": ("EKF2_PCOEF_YP", "EKF2_PCOEF_YN"),
}
LEVEL = tuple(name for names in PARAMETERS.values() for name in names)
CONFIRMED = 9.49
"""χ² of the tuner's four coefficients that is above by chance once in twenty flights that the rest points at."""
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
    effects = [one for one in errors.speed.values() if abs(one.value) < LARGEST_SHARE and one.range_m > LEAST_RANGE_M]
    # all directions together: holes and boxes disturb the flow from more than one side
    if sum((one.value / max(one.error, 1e-6)) ** 2 for one in effects) < TOGETHER:
        return None
    seen: list[tuple[Sign, Effect, tuple[str, ...]]] = []
    own: dict[str, float] = {}
    for direction, effect in errors.speed.items():
        size = abs(effect.value)
        if effect not in effects or size < COEFFICIENT_FROM + 0.5 * effect.error:
            continue
        side = "more" if effect.value > 0.0 else "less"
        words = (
            f"flying {direction} the barometer reads up to {effect.range_m:.1f} m {side} (coefficient "
            f"{effect.value:+.2f} ± {2.0 * effect.error:.2f})"
        )
        seen.append((Sign(words, size, COEFFICIENT_FROM, "1", "replay"), effect, PARAMETERS[direction]))
        # EKF2 adds what a positive coefficient says the barometer reads low
        own |= dict.fromkeys(PARAMETERS[direction], round(max(-LARGEST, min(LARGEST, -effect.value)), 3))
    range_m = max(one.range_m for one in effects)
    if not seen or range_m < RANGE_FROM_M:
        return None
    # the tuner's model knows what barometer and GNSS wander by: without it there is no warning
    tuned = signs.told_by("static_pressure")
    found: list[Sign] = []
    values: dict[str, float] = {}
    for sign, effect, names in seen:
        told = [tuned[name] for name in names if name in tuned]
        if told and all(_contradicts(one, effect) for one in told):
            continue
        found.append(sign)
        values |= {name: round(tuned[name].value, 3) if name in tuned else own[name] for name in names}
    level = [one for name, one in tuned.items() if name in LEVEL]
    is_confirmed = any(not one.lower <= 0.0 <= one.upper for one in level) or (
        sum((one.value / one.standard_error) ** 2 for one in level) > CONFIRMED
    )
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


def _contradicts(told: Estimate, effect: Effect) -> bool:
    """Whether the tuner tells another coefficient, and none."""
    if not told.lower <= 0.0 <= told.upper:
        return (told.value > 0.0) == (effect.value > 0.0)
    return abs(told.value + effect.value) > 2.0 * math.hypot(told.standard_error, effect.error)
