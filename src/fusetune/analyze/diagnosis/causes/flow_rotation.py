"""Optical flow is turned against the body, or its gyro does not tell how it turns."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.flow_signs import FlowSigns
from fusetune.analyze.diagnosis.signs import Signs

TURN_FROM_DEG, LEFT_FROM, SIGMAS = 9.0, 0.3, 2.5
REMEDY = (
    "Compare SENS_FLOW_ROT with how the sensor sits, and see that the driver publishes the angular rate over the "
    "same time "
    "as the flow (`delta_angle`); without a gyro of its own let PX4 use the autopilot's"
)


def not_turned(one: FlowSigns) -> bool:
    """Whether nothing is left of the turning, or scale alone explains it: as much is left as the scale is off."""
    left = np.minimum(np.abs(one.rotation), np.abs(one.rotation - (1.0 - one.scale)))
    level = np.maximum(LEFT_FROM + SIGMAS * np.minimum(one.rotation_error, 0.1), SIGMAS * one.scale_error)
    turn = abs(float(np.degrees(one.turn)))
    is_straight = turn < TURN_FROM_DEG + SIGMAS * min(float(np.degrees(one.turn_error)), 10.0)
    return is_straight and bool((left < level).all())


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the direction of the flow, and by how much of the body's turning is left in it."""
    one = signs.flow
    if one is None or not_turned(one):
        return None
    turn, error = float(np.degrees(one.turn)), float(np.degrees(one.turn_error))
    found = []
    if abs(turn) > TURN_FROM_DEG + SIGMAS * min(error, 10.0):
        found.append(Sign(f"flow points {turn:+.0f}° off the motion", abs(turn), TURN_FROM_DEG, "°", "replay"))
    left = float(np.abs(one.rotation).max())
    if left > LEFT_FROM + SIGMAS * float(np.max(one.rotation_error)):
        found.append(Sign(f"{left:.0%} of the body's turning is left in the flow", left, LEFT_FROM, "1", "replay"))
    if not found:
        return None
    return diagnosed(
        signs,
        "flow_rotation",
        "Optical flow is turned, or its turning is not taken out",
        "fail",
        max(confidence(sign.figure, sign.usual, 0.95) for sign in found),
        found,
        touches=("optical_flow",),
        remedy=REMEDY,
        values={"flow_turn_deg": round(turn, 1), "turning_left": round(left, 3)},
    )
