"""Shaking beyond the range of the accelerometer."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

SHARE_FROM, FEWEST = 5e-4, 4
"""A landing clips a sample or two; what clips one in two thousand in flight is no landing."""
FAILS_FROM = 5e-3
REMEDY = (
    "Mend the mounting of the autopilot first (isolation, loose parts, propellers); then choose an IMU of a "
    "larger range. "
    "No parameter of the filter helps"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the samples that say so themselves, or by the driver's counters."""
    imu = signs.imu
    if imu is None or imu.clipping is None or imu.clipped < FEWEST or imu.clipped_share < SHARE_FROM:
        return None
    words = f"{imu.clipped} IMU samples in the air are clipped ({100.0 * imu.clipped_share:.2f} %)"
    found = [Sign(words, imu.clipped_share, SHARE_FROM, "1")]
    return diagnosed(
        signs,
        "accelerometer_clipping",
        "The vehicle shakes beyond the range of its accelerometer",
        "fail" if imu.clipped_share > FAILS_FROM else "warning",
        confidence(imu.clipped_share, SHARE_FROM),
        found,
        touches=("baro", "gnss", "rng", "ev"),
        remedy=REMEDY,
        when=imu.clipping,
        values={"clipped_share": round(imu.clipped_share, 5)},
    )
