"""The GNSS antenna is not where PX4 is told."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

Array = npt.NDArray[np.float64]

MATTERS_M, SIGMAS = 0.1, 3.0
WARNS_FROM_M = 0.2
"""What is not surely more is worth a note: a turn of 60 °/s moves such an antenna by 0.2 m/s, as much as receivers are
unsure of."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the velocity's error in proportion to the rate of turn."""
    motion = signs.gnss_motion
    if motion is None:
        return None
    imu = np.array([signs.parameters[f"EKF2_IMU_POS_{name}"] for name in "XYZ"])
    told = np.array([signs.parameters[f"EKF2_GPS_POS_{axis}"] for axis in "XYZ"]) - imu
    found = _beyond(motion.arm - told, motion.arm_error)
    place = signs.gnss_place if found is not None else None
    arm, error = motion.arm, motion.arm_error
    if place is not None:
        # told of the flight elsewhere, too, and found together with the delay
        arm, error = place.arm - imu, np.sqrt(np.diag(place.arm_covariance))
        found = _beyond(arm - told, error)
    if found is None:
        return None
    known, size, spread = found
    level = MATTERS_M + SIGMAS * spread
    there = ", ".join(f"{name} {value:+.2f}" for name, value, sure in zip("XYZ", arm, known, strict=True) if sure)
    words = (
        f"velocity moves with the rate of turn as at {there} m, PX4 is told X {told[0]:+.2f}, Y {told[1]:+.2f}, Z "
        f"{told[2]:+.2f}"
    )
    values = {f"EKF2_GPS_POS_{'XYZ'[i]}": round(float(arm[i] + imu[i]), 3) for i in range(3) if known[i]}
    return diagnosed(
        signs,
        "gnss_lever_arm",
        f"The GNSS antenna is {size:.2f} m from where PX4 is told",
        "warning" if size - 2.0 * spread > WARNS_FROM_M else "note",
        confidence(size, level, 0.95),
        [Sign(words, size, level, "m", "replay")],
        touches=("gnss_vel",),
        values=values,
        remedy="Measure from the IMU to the antenna, forward, right, down, and set EKF2_GPS_POS_X, _Y, _Z to it",
    )


def _beyond(off: Array, error: Array) -> tuple[npt.NDArray[np.bool_], float, float] | None:
    """Axes that are known, (3,), how far off they are together, m, and its standard error; None where that is chance.

    Along the axis about which a vehicle hardly turns the arm does not show.
    """
    known = error < np.maximum(0.5 * MATTERS_M, 0.2 * np.abs(off))
    if not known.any():
        return None
    size = float(np.linalg.norm(off[known]))
    spread = float(np.sqrt(np.sum((off[known] * error[known]) ** 2))) / max(size, 1e-9)
    return (known, size, spread) if size >= MATTERS_M + SIGMAS * spread else None
