"""Excessive vibration, or vibration near the IMU's sampling frequency that shows only as an offset (aliasing)."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.ekf2.numerics.constants import ONE_G

SHAKES_FROM = ONE_G
"""RMS change between IMU samples; Flight Review draws its red line for the vibration metric at 1 g as well. Healthy
real quadrotors show up to 0.9 g, simulated ones 0.3."""
OFFSET_FROM, SIGMAS = 0.35, 4.0
"""m/s² of bias that come with the thrust; calibrated accelerometers keep within 0.1, and EKF2_ABL_LIM is 0.4."""
REMEDY = (
    "Mount the autopilot on an isolation mount (all six resonances above 25 Hz and below the motors), balance "
    "propellers, look for loose parts. Only then, if it has to fly: gate of the height source × 2, EKF2_ACC_NOISE "
    "0.5 and up in steps of 0.1, not beyond 1.0"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By how the samples shake, or by a vertical bias in the air that was not there at rest."""
    imu = signs.imu
    if imu is None:
        return None
    found = []
    sure = 0.0
    if imu.shaking > SHAKES_FROM and imu.rate_hz > 50.0:
        words = f"IMU samples change by {imu.shaking:.1f} m/s² from one to the next"
        found.append(Sign(words, imu.shaking, SHAKES_FROM, "m/s²"))
        sure = confidence(imu.shaking, SHAKES_FROM, 0.95)
    motion = signs.gnss_motion
    if motion is not None and np.isfinite(imu.resting_force):
        # at rest the sensor reads -g - b down the body: its size tells the bias
        at_rest = ONE_G - imu.resting_force
        offset, error = motion.bias_down - at_rest, motion.bias_down_error
        if abs(offset) > OFFSET_FROM + SIGMAS * error:
            words = f"the accelerometer is {offset:+.2f} m/s² off downwards in the air, and was not at rest"
            found.insert(0, Sign(words, abs(offset), OFFSET_FROM, "m/s²", "replay"))
            sure = max(sure, confidence(abs(offset), OFFSET_FROM + SIGMAS * error))
    if not found:
        return None
    worst = max(one.figure / one.usual for one in found)
    return diagnosed(
        signs,
        "vibration",
        "The IMU shakes more than it can stand",
        "fail" if worst > 2.0 else "warning",
        sure,
        found,
        touches=("baro", "gnss", "rng", "ev"),
        remedy=REMEDY,
        values={"imu_shaking_m_s2": round(imu.shaking, 3)},
    )
