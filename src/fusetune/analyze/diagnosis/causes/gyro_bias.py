"""A large gyro bias, or one that changes in flight."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

REST_DEG_S, CHANGE_DEG_S = 3.0, 1.5
"""PX4's guide stands 5 °/s at switch-on with time to settle and 3 °/s over warm-up; what moves half of that within a
flight has not warmed up. Calibrated gyros rest within 1.2 °/s and move 0.6 on real and simulated healthy flights."""
FAILS_DEG_S = 8.0
REMEDY = (
    "Calibrate the gyros, warm. If the bias comes back with temperature: thermal calibration, insulation, or "
    "another IMU. "
    "Give the filter a minute at rest after switch-on"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the readings at rest, and by how the estimate moves."""
    bias = signs.gyro_bias
    if bias is None or signs.imu is None or signs.imu.rate_hz < 50.0:
        return None
    rest, change = (
        float(np.degrees(np.nanmax(np.abs(one)))) if np.isfinite(one).any() else 0.0
        for one in (bias.at_rest, bias.change)
    )
    found = []
    if rest > REST_DEG_S:
        found.append(Sign(f"a gyro reads {rest:.1f} °/s at rest", rest, REST_DEG_S, "°/s"))
    if change > CHANGE_DEG_S:
        found.append(Sign(f"its bias moves by {change:.1f} °/s over the flight", change, CHANGE_DEG_S, "°/s", "replay"))
    if not found:
        return None
    sure = max(confidence(one.figure, one.usual) for one in found)
    worst = max(rest, change)
    return diagnosed(
        signs,
        "gyro_bias",
        "A gyro has a large bias" if rest > REST_DEG_S else "The bias of a gyro changes in flight",
        "fail" if worst > FAILS_DEG_S else "warning",
        sure,
        found,
        touches=("mag", "gnss_vel", "gnss_yaw"),
        remedy=REMEDY,
        values={"bias_at_rest_deg_s": round(rest, 3), "bias_change_deg_s": round(change, 3)},
    )
