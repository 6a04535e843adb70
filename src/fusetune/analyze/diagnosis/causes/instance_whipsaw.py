"""The selector goes to and fro between estimator instances."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

FEWEST = 3
"""One switch mends something; more within a flight mend nothing."""
REMEDY = (
    "Find which IMU or magnetometer makes the difference (health per instance) and mend or disable that one; "
    "until then fly "
    "a single one (EKF2_MULTI_IMU 0, EKF2_MULTI_MAG 0, SENS_IMU_MODE 1)"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the number of switches in the air."""
    times = signs.switches
    if times.size < FEWEST:
        return None
    words = f"the primary instance changes {times.size} times in the air"
    return diagnosed(
        signs,
        "instance_whipsaw",
        "The selector goes to and fro between estimator instances",
        "fail" if times.size > 10 else "warning",
        confidence(float(times.size), float(FEWEST) - 1.0),
        [Sign(words, float(times.size), 1.0, "")],
        remedy=REMEDY,
        when=(int(times[0]), int(times[-1]) + 1),
        values={"switches": float(times.size)},
    )
