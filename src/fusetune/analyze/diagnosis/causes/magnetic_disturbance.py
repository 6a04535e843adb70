"""A field from outside for a while, or one that belongs to no cause that has a file of its own."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.causes.magnetometer_scale import as_sure_of_a_field, down_axis, scaled, scaled_down
from fusetune.analyze.diagnosis.causes.motor_magnetic_field import in_step
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

PASSING_FROM, BODY_FROM, SCATTER_FROM, STRENGTH_FROM = 0.14, 0.14, 0.25, 0.25
"""Of the earth's field: calibrated compasses of healthy flights, real and simulated, are off by a tenth, and in
strength by as much."""
FAILS_FROM = 0.7
REMEDY = (
    "Fly away from steel, power lines and reinforced ground, and calibrate the compass there; if it stays, look "
    "for what "
    "is magnetic near the sensor. EKF2_MAG_CHECK lets the filter refuse such a field"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By a field that came and went over the ground; else by one of the body, by scatter or by strength."""
    one = signs.magnetometer
    if one is None:
        return None
    earth, fits = one.field_gauss, one.fits
    if fits["mounting"].left < 0.3 * fits["as_told"].left and one.by_gnss:
        return None
    passing = one.disturbance / earth
    if one.disturbed is not None and passing > PASSING_FROM and one.undisturbed < 0.6 * fits["as_told"].left:
        length = (one.disturbed[1] - one.disturbed[0]) * 1e-6
        words = f"for {length:.0f} s the field over the ground was another by {passing:.0%} of the earth's"
        found = [Sign(words, passing, PASSING_FROM, "1", "replay")]
        return _diagnosis(signs, "A field from outside disturbs the magnetometer for a while", found, one.disturbed)
    if scaled(one) is not None or in_step(one) is not None:
        return None
    body = np.array([fits["body_field"].values[f"body_field_{axis}"] for axis in "xyz"])
    size = float(np.linalg.norm(body)) / earth
    if one.by_gnss and size > BODY_FROM and fits["body_field"].left < 0.4 * fits["as_told"].left:
        down = down_axis(signs) if scaled_down(one) is not None else False
        if down:
            return None
        words = f"a constant field of the body of {size:.0%} of the earth's was not calibrated"
        return _diagnosis(
            signs,
            "The compass feels a constant field of the body",
            [Sign(words, size, BODY_FROM, "1", "replay")],
            None,
            as_sure_of_a_field(one) if down is None else 1.0,
        )
    found = []
    if abs(one.strength - 1.0) > STRENGTH_FROM:
        words = f"the field is {one.strength:.2f} times as strong as the earth's there"
        found.append(Sign(words, abs(one.strength - 1.0), STRENGTH_FROM, "1"))
    scatter = fits["body_field"].left / earth
    if scatter > SCATTER_FROM:
        found.append(
            Sign(f"readings scatter by {scatter:.0%} of the earth's field", scatter, SCATTER_FROM, "1", "replay")
        )
    return _diagnosis(signs, "The magnetometer is disturbed", found, None) if found else None


def _diagnosis(
    signs: Signs, cause: str, found: list[Sign], when: tuple[int, int] | None, most: float = 1.0
) -> Diagnosis:
    worst = max(found, key=lambda one: one.figure / one.usual)
    # without a heading of its own the fit cannot be sure whose field it was; strength needs none
    sure = signs.magnetometer is not None and signs.magnetometer.by_gnss
    is_strong = any(one.figure > FAILS_FROM and (sure or one.origin == "vehicle") for one in found)
    return diagnosed(
        signs,
        "magnetic_disturbance",
        cause,
        "fail" if is_strong else "warning",
        min(confidence(worst.figure, worst.usual), most),
        found,
        touches=("mag",),
        remedy=REMEDY,
        when=when,
        values={"field_share": round(found[0].figure, 3)},
    )
