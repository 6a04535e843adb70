"""IMU samples are lost, or logged too seldom."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

LOST_FROM_S, SHARE_FROM, RATE_FROM_HZ = 0.25, 0.1, 100.0
"""Loggers of healthy vehicles lose up to 8 % of the samples, one at a time."""
SHARE_WHOLE = 0.004
"""Where the log holds what the estimator took of every run (`ekf2_timestamps`), the estimator missed them as well."""
REMEDY = (
    "A faster card, fewer logged topics (SDLOG_PROFILE), a look at the load (`top`): what the logger lost the "
    "filter had. If "
    "the messages of the IMU themselves stop, look for a driver that restarts, wiring and power"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By stretches without samples, by how many are missing in all, and by their rate."""
    imu = signs.imu
    if imu is None:
        return None
    found, when = [], None
    if imu.rate_hz < RATE_FROM_HZ:
        words = f"the log holds {imu.rate_hz:.0f} IMU samples a second, too few to follow the motion"
        found.append(Sign(words, RATE_FROM_HZ / max(imu.rate_hz, 1.0), 1.0, "1"))
    else:
        if imu.lost_s > LOST_FROM_S:
            words = f"{len(imu.gaps)} gaps in the IMU samples, {imu.lost_s:.2f} s in all"
            found.append(Sign(words, imu.lost_s, LOST_FROM_S, "s"))
            when = (imu.gaps[0][0], imu.gaps[-1][1])
        share_from = SHARE_WHOLE if signs.table("ekf2_timestamps") is not None else SHARE_FROM
        if imu.lost_share > share_from:
            found.append(Sign(f"{imu.lost_share:.1%} of the IMU samples are missing", imu.lost_share, share_from, "1"))
    if not found:
        return None
    return diagnosed(
        signs,
        "imu_gaps",
        "IMU samples are missing",
        "warning",
        max(confidence(one.figure, one.usual) for one in found),
        found,
        touches=("gnss_vel", "mag"),
        remedy=REMEDY,
        when=when,
        values={"imu_lost_s": round(imu.lost_s, 3)},
    )
