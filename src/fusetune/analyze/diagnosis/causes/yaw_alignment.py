"""A heading that is far off from the start, by a field of the body."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.causes.magnetometer_scale import scaled
from fusetune.analyze.diagnosis.causes.motor_magnetic_field import in_step
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.flight.intervals import inside

OFF_DEG = 13.0
"""PX4's guide says 15° of the heading that the filter ends with, which the gyros hold back."""
LEVEL_SHARE = 0.4
"""Of a field that is more upright than that the heading feels little; it is a disturbance like others."""
REMEDY = (
    "Calibrate the compass away from iron, look for what became magnetic or was moved near it (screws, "
    "batteries, power "
    "leads); check the heading on the ground before the next take-off"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the constant field of the body, and by how far the replay's heading was off when it took off."""
    one, motion, gnss = signs.magnetometer, signs.motion, signs.gnss_motion
    if one is None or motion is None or gnss is None or not one.by_gnss:
        return None
    if (
        one.fits["mounting"].left < 0.4 * one.fits["as_told"].left
        or scaled(one) is not None
        or in_step(one) is not None
    ):
        return None
    body = one.fits["body_field"]
    if not body.left < 0.4 * one.fits["as_told"].left:
        return None
    level = float(np.hypot(body.values["body_field_x"], body.values["body_field_y"]))
    if level < LEVEL_SHARE * abs(body.values["body_field_z"]):
        return None
    shown = float(np.degrees(one.compass_off))
    start = signs.airborne[0][0]
    rows = inside(motion.time, ((start, start + 3_000_000),))
    off = np.angle(np.exp(1j * (motion.heading_off[rows] - gnss.heading)))
    happened = float(np.degrees(np.abs(np.median(off)))) if rows.any() else 0.0
    if shown < OFF_DEG:
        return None
    found = [Sign(f"a field of the body turns the compass by up to {shown:.0f}°", shown, OFF_DEG, "°", "replay")]
    if happened > OFF_DEG:
        found.append(Sign(f"the heading was {happened:.0f}° off at take-off", happened, OFF_DEG, "°", "replay"))
    return diagnosed(
        signs,
        "yaw_alignment",
        "The heading is far off from the start: the compass feels a field of the body",
        "fail" if happened > 30.0 else "warning",
        confidence(shown, OFF_DEG),
        found,
        touches=("mag", "gnss_vel", "gnss_pos"),
        remedy=REMEDY,
        values={f"body_field_{axis}_gauss": round(body.values[f"body_field_{axis}"], 4) for axis in "xyz"}
        | {"heading_off_deg": round(happened, 1)},
    )
