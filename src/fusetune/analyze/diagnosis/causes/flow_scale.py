"""Optical flow is scaled wrongly."""

from __future__ import annotations

import math

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.causes.flow_rotation import not_turned
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

OFF_FROM, LEAST_OFF, SIGMAS = 0.09, 0.05, 2.5
"""Lenses and focal lengths are known to some percent."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By flow over what the motion makes, where its own turning is scaled alike."""
    one = signs.flow
    if one is None or not not_turned(one):
        return None
    # what turning leaves once the gyro's is taken out tells the scale, too
    by_turning = 1.0 - float(np.average(one.rotation, weights=one.rotation_error**-2.0))
    by_turning_error = float(np.sum(one.rotation_error**-2.0) ** -0.5)
    off, other = abs(one.scale - 1.0), abs(by_turning - 1.0)
    if other < LEAST_OFF or (one.scale - 1.0) * (by_turning - 1.0) <= 0.0:
        return None
    tuned = signs.told_by("flow").get("SENS_FLOW_SCALE")
    if tuned is not None:
        # the scale itself is that by which the tuner divides
        off, level = abs((tuned.told or 1.0) / tuned.value - 1.0), OFF_FROM
    else:
        level = OFF_FROM + SIGMAS * by_turning_error if off > LEAST_OFF else math.inf
    if (off if tuned is not None else other) < level:
        return None
    values = {"flow_scale": round(by_turning, 3)} if tuned is None else {"SENS_FLOW_SCALE": round(tuned.value, 3)}
    factor = 1.0 / max(by_turning, 0.1) if tuned is None else tuned.value
    found = [
        Sign(f"flow is {one.scale:.2f} times what the motion over the ground makes", off, OFF_FROM, "1", "replay"),
        Sign(f"and {by_turning:.2f} times what turning makes", other, OFF_FROM, "1", "replay"),
    ]
    return diagnosed(
        signs,
        "flow_scale",
        "Optical flow is scaled wrongly",
        "fail" if off > 0.5 else "warning",
        confidence(off, OFF_FROM, 0.95),
        found,
        touches=("optical_flow",),
        values=values,
        remedy=f"Correct the sensor's scale by {factor:.2f} (SENS_FLOW_SCALE, or its lens)",
    )
