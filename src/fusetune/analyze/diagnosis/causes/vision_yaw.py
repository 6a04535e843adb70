"""The frame of external vision is turned against north."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.diagnosis.vision_signs import LEAST_SPEED_M_S

TURN_FROM_DEG, SIGMAS = 6.0, 2.5
FAILS_FROM_DEG = 45.0
REMEDY = (
    "Say what frame vision is in: POSE_FRAME_NED only if it knows north, else POSE_FRAME_FRD, and leave bit 3 (yaw) of "
    "EKF2_EV_CTRL off unless vision is to give the heading; check the camera's extrinsics"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the angle from the way by vision to the way by GNSS and IMU, where vision says that it knows north."""
    one = signs.vision
    if one is None or one.speed < LEAST_SPEED_M_S or not one.by_gnss or not signs.vision_knows_north:
        return None
    turn, error = abs(float(np.degrees(one.turn))), float(np.degrees(one.turn_error))
    if turn < TURN_FROM_DEG + SIGMAS * error:
        return None
    words = f"vision's north points {np.degrees(one.turn):+.0f}° (±{2.0 * error:.0f}) off that of GNSS"
    return diagnosed(
        signs,
        "vision_yaw",
        "The frame of vision is turned against north",
        "fail" if turn > FAILS_FROM_DEG else "warning",
        confidence(turn, TURN_FROM_DEG + SIGMAS * error),
        [Sign(words, turn, TURN_FROM_DEG, "°", "replay")],
        touches=("ev", "gnss_vel", "gnss_pos"),
        remedy=REMEDY,
        values={"vision_turn_deg": round(float(np.degrees(one.turn)), 1)},
    )
