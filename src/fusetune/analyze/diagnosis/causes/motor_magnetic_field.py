"""A field in step with throttle or current."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.causes.magnetometer_scale import scaled
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.magnetometer_signs import MagnetometerSigns
from fusetune.analyze.diagnosis.signs import Signs

FIELD_FROM = 0.06
"""Of the earth's field: heading moves by 8° where the field is steep. Healthy vehicles show half of it."""
FAILS_FROM = 0.7
FITS_BELOW = 0.4
"""What a field of the body leaves of the readings, at most; wrong scales look like one that turns with the heading."""
REMEDY = (
    "Move the magnetometer away from motors and power leads, twist the leads; then compensate what is left "
    "(CAL_MAG_COMP_TYP and CAL_MAGn_XCOMP, _YCOMP, _ZCOMP), or fly without it (EKF2_MAG_TYPE 5) where GNSS gives "
    "heading"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the step that the body's field makes when the motors turn, or by what follows the throttle in the air."""
    one = signs.magnetometer
    if one is None or signs.motion is None:
        return None
    field = in_step(one)
    if field is None:
        return None
    size = float(np.linalg.norm(field)) / one.field_gauss
    words = f"a field of {np.linalg.norm(field):.2f} G comes with the motors ({size:.0%} of the earth's)"
    return diagnosed(
        signs,
        "motor_magnetic_field",
        "The motors' current disturbs the magnetometer",
        "fail" if size > FAILS_FROM and one.by_gnss else "warning",
        confidence(size, FIELD_FROM),
        [Sign(words, size, FIELD_FROM, "1", "replay")],
        touches=("mag",),
        remedy=REMEDY,
        values=_tuned(signs)
        or {f"motor_field_{axis}_gauss": round(float(value), 4) for axis, value in zip("xyz", field, strict=True)},
    )


def _tuned(signs: Signs) -> dict[str, float]:
    """What the tuner of the effect tells: PX4's compensation, or the field over what the motors draw."""
    told = signs.told_by("magnetometer")
    return {name: round(one.value, 4) for name, one in told.items() if name.endswith("COMP") or name in MOTOR_FIELD}


MOTOR_FIELD = tuple(f"motor_field_{axis}" for axis in "xyz")


def in_step(one: MagnetometerSigns) -> np.ndarray | None:
    """(3,) field at the thrust of a hover, Gauss; None where none is in step."""
    fits = one.fits
    if scaled(one) is not None:
        return None
    step = one.in_air - one.motors_off
    if np.isfinite(step).all() and one.by_gnss:
        size = float(np.linalg.norm(step))
        fits_body = fits["body_field"].left < FITS_BELOW * max(fits["as_told"].left, 1e-9)
        is_own = size > 0.5 * float(np.linalg.norm(one.in_air))
        return step if size > FIELD_FROM * one.field_gauss and is_own and fits_body else None
    coefficient = np.array([fits["motor_field"].values[f"motor_field_{axis}"] for axis in "xyz"])
    explained = 1.0 - (fits["motor_field"].left / max(fits["body_field"].left, 1e-9)) ** 2
    large = float(np.linalg.norm(coefficient)) > 3.0 * FIELD_FROM * one.field_gauss
    return coefficient if large and explained > 0.5 and fits["body_field"].left > 0.06 * one.field_gauss else None
