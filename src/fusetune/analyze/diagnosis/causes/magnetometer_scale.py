"""A magnetometer that is scaled wrongly."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.magnetometer_signs import MagnetometerSigns
from fusetune.analyze.diagnosis.signs import Signs

OFF_FROM, WARNS_FROM, FAILS_FROM = 0.1, 0.15, 0.6
"""Calibrations are better where the flight shows them; where a field of the body explains as much, that is taken."""
REMEDY = (
    "Calibrate the compass where there is no iron; check that the driver's scale is that of the sensor "
    "(CAL_MAGn_?SCALE)"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By a factor per axis, or one for all, that explains the readings better than any field of the body."""
    one = signs.magnetometer
    if one is None:
        return None
    scale = scaled(one)
    is_sure = scale is not None
    if scale is None:
        scale = scaled_down(one)
        down = down_axis(signs) if scale is not None else None
        if scale is None or down is False:
            return None
        is_sure = down is True
    scale = _tuned(signs, scale)
    off = float(np.abs(scale - 1.0).max())
    if off < OFF_FROM:
        return None
    told = ", ".join(f"{axis} {value:.2f}" for axis, value in zip("xyz", scale, strict=True))
    words = f"readings are the field times {told}"
    return diagnosed(
        signs,
        "magnetometer_scale",
        "The magnetometer is scaled wrongly",
        "fail" if off > FAILS_FROM else "warning" if off > WARNS_FROM else "note",
        confidence(off, OFF_FROM) if is_sure else 1.0 - as_sure_of_a_field(one),
        [Sign(words, off, OFF_FROM, "1", "replay")],
        touches=("mag",),
        remedy=REMEDY,
        values={f"mag_scale_{axis}": round(float(value), 3) for axis, value in zip("xyz", scale, strict=True)},
    )


def scaled(one: MagnetometerSigns) -> np.ndarray | None:
    """(3,) factors, where they explain the readings."""
    fits = one.fits
    noise2 = one.noise**2
    as_told, body = (max(fits[name].left ** 2 - noise2, 1e-8) for name in ("as_told", "body_field"))
    for name, least in (("one_scale", 0.3), ("scale", 0.4)):
        left = max(fits[name].left ** 2 - noise2, 0.0)
        scale = np.array([fits[name].values[f"scale_{axis}"] for axis in "xyz"])
        if (scale <= 0.2).any() or float(np.abs(scale - 1.0).max()) < OFF_FROM:
            continue
        # a field of the body comes before a scale that leaves as much
        if fits[name].left > fits["body_field"].left:
            continue
        if left < least * as_told and left < 0.7 * body and one.by_gnss:
            return scale
        # without a heading only the strength tells, and that all axes share it
        if name == "one_scale" and not one.by_gnss and left < 0.15 * as_told and left < body:
            return scale
    return None


def scaled_down(one: MagnetometerSigns) -> np.ndarray | None:
    """(3,) factors of which only that of the down axis is off.

    Where a vehicle hardly tilts, the field down the body is constant, and a wrong scale there is the same as a field of
    the body along it: neither can be excluded, and both are told.
    """
    if not one.by_gnss:
        return None
    fits = one.fits
    body = np.array([fits["body_field"].values[f"body_field_{axis}"] for axis in "xyz"])
    scale = np.array([1.0, 1.0, fits["scale"].values["scale_z"]])
    is_upright = float(np.hypot(body[0], body[1])) < UPRIGHT * abs(float(body[2]))
    fits_well = fits["body_field"].left < 0.4 * fits["as_told"].left and fits["scale"].left < 0.6 * fits["as_told"].left
    return scale if is_upright and fits_well and abs(scale[2] - 1.0) > OFF_FROM and scale[2] > 0.2 else None


UPRIGHT = 0.4


def down_axis(signs: Signs) -> bool | None:
    """Whether it is the scale of the down axis that is off, or a field along it: None where tilts do not tell.

    The tuner of the effect fits both beside each other.
    """
    down = _scales(signs).get("Z")
    if down is None:
        return None
    value, lower, upper = down
    if abs(value - 1.0) > OFF_FROM:
        return True
    return False if max(abs(lower - 1.0), abs(upper - 1.0)) < OFF_FROM else None


def _tuned(signs: Signs, scale: np.ndarray) -> np.ndarray:
    """Scale (3,) with the axes that the tuner of the effect tells."""
    told = _scales(signs)
    return np.array([told[axis][0] if axis in told else one for axis, one in zip("XYZ", scale, strict=True)])


def _scales(signs: Signs) -> dict[str, tuple[float, float, float]]:
    """Reading over field of each axis that the tuner tells, with its interval; what it tells is what mends that."""
    found = {}
    for name, one in signs.told_by("magnetometer").items():
        if name.endswith("SCALE") or name.startswith("magnetometer_scale_"):
            now = one.told if one.told is not None else 1.0
            axis = name[-6] if name.endswith("SCALE") else name[-1].upper()
            found[axis] = now / one.value, now / one.upper, now / one.lower
    return found


def as_sure_of_a_field(one: MagnetometerSigns) -> float:
    """How sure a field down the body is where a scale of that axis may be as well: a little, by what each leaves."""
    return 0.6 if one.fits["body_field"].left < one.fits["scale"].left else 0.4
