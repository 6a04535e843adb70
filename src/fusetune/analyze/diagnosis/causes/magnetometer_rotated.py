"""A magnetometer mounted otherwise than PX4 is told."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.save.checks.magnetometer_mounting import described

FITS_BELOW = 0.3
"""The right mounting leaves this share of what is wrong at most; no other cause is mended so by turning axes."""
OFF_FROM = 0.12
"""RMS of an axis over the field: the smallest turn that is looked for, 45° where the field is steep, makes 0.16."""
REMEDY = (
    "Set CAL_MAGn_ROT (or SENS_BOARD_ROT) to how the sensor sits, then calibrate the compass again; in a "
    "simulation, ask "
    "its sensor model"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the mounting under which the readings fit the field of the place, or, without a heading, stand still."""
    magnetometer = signs.magnetometer
    if magnetometer is not None and magnetometer.by_gnss:
        fits = magnetometer.fits
        as_told, turned = fits["as_told"].left, fits["mounting"]
        others = min(fits[name].left for name in ("body_field", "one_scale"))
        if as_told > OFF_FROM * magnetometer.field_gauss and turned.turn is not None:
            share = turned.left / as_told
            if share < FITS_BELOW and turned.left < 0.6 * others:
                words = (
                    f"turned by {_turn(turned.turn)} the readings miss the field by {turned.left:.3f} G instead "
                    f"of {as_told:.3f}"
                )
                found = [Sign(words, as_told / magnetometer.field_gauss, OFF_FROM, "1", "replay")]
                return _diagnosis(signs, found, confidence(FITS_BELOW / max(share, 1e-3), 1.0), _turn(turned.turn))
        return None
    if signs.mounting is not None:
        verdict, _ = signs.mounting
        left = 1.0 / max(verdict.figure or 1.0, 1e-3)
        found = [Sign(verdict.found, left, 1.0 / FITS_BELOW, "1")]
        return _diagnosis(signs, found, confidence(left, 1.5, 0.9), "a quarter turn or two")
    return None


def claimed_mounting(signs: Signs) -> np.ndarray | None:
    """Rotation (3, 3) from axes that turn with the vehicle to those of the samples: that of the sign that spoke."""
    magnetometer = signs.magnetometer
    if magnetometer is not None and magnetometer.by_gnss:
        return magnetometer.fits["mounting"].turn
    return signs.mounting[1] if signs.mounting is not None else None


def _turn(turn: np.ndarray) -> str:
    if np.allclose(np.abs(turn).max(axis=0), 1.0):
        return described(turn.T)
    return f"yaw {round(float(np.degrees(np.arctan2(turn[0, 1], turn[0, 0])))) % 360}°"


def _diagnosis(signs: Signs, found: list[Sign], sure: float, turn: str) -> Diagnosis:
    return diagnosed(
        signs,
        "magnetometer_rotated",
        f"The magnetometer sits otherwise than PX4 is told, by {turn}",
        "fail",
        sure,
        found,
        touches=("mag", "gnss_vel", "gnss_pos"),
        remedy=REMEDY,
    )
