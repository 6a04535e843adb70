"""Checks of what accelerometer and gyroscope say: values that stand still, and values that no vehicle can have."""

from __future__ import annotations

import numpy as np

from fusetune.check import Check, check
from fusetune.finding import Finding
from fusetune.px4.flight import field_names, stacked
from fusetune.save.checks.judged_flight import IMU, JudgedFlight
from fusetune.save.checks.standstill import STUCK_IMU, STUCK_TOPICS, Subject, flying_steps, stuck

STANDARD_GRAVITY_M_S2 = 9.80665
_FEWEST_ROWS_IN_A_SECOND = 10


@check(
    topics=(IMU,),
    thresholds=("low_gravity_share", "high_gravity_share", "min_gravity_share", "max_gravity_share"),
    unit="g",
)
def accelerometer_gravity(judged: JudgedFlight) -> Finding:
    """Whether the accelerometer sees gravity: median of the specific force averaged over seconds, in g.

    Vibration averages out within a second, and no vehicle falls, or pulls two g, for half of its flight.
    """
    limits, imu = judged.limits, judged.imu
    second = (imu["timestamp"] - imu["timestamp"].min()) // 1_000_000
    seconds, index, rows = np.unique(second, return_inverse=True, return_counts=True)
    sums = [np.bincount(index, weights=axis, minlength=len(seconds)) for axis in stacked(imu, "accelerometer_m_s2").T]
    force = np.linalg.norm(np.stack(sums, axis=1) / rows[:, None], axis=1)
    whole = rows >= min(_FEWEST_ROWS_IN_A_SECOND, rows.max())
    share = float(np.median(force[whole])) / STANDARD_GRAVITY_M_S2
    said = f"the accelerometer measures {share:.2f} g in the mean"
    remedy = "Calibrate the accelerometer; check that its driver gives m/s² and its scale (CAL_ACC0_XSCALE …)"
    for threshold, is_outside in (
        (limits.min_gravity_share, share < limits.min_gravity_share),
        (limits.max_gravity_share, share > limits.max_gravity_share),
    ):
        if is_outside:
            return accelerometer_gravity.failed(f"{said}: it does not see gravity", remedy, share, threshold)
    for threshold, is_outside in (
        (limits.low_gravity_share, share < limits.low_gravity_share),
        (limits.high_gravity_share, share > limits.high_gravity_share),
    ):
        if is_outside:
            return accelerometer_gravity.warned(f"{said}, far from gravity", remedy, share, threshold)
    return accelerometer_gravity.passed(said, share, limits.low_gravity_share)


@check(topics=STUCK_TOPICS, thresholds=STUCK_IMU, unit="s")
def accelerometer_stuck(judged: JudgedFlight) -> Finding:
    """Whether an axis of the accelerometer stands still."""
    return _stuck(accelerometer_stuck, judged, "the accelerometer", "accelerometer_m_s2")


@check(topics=STUCK_TOPICS, thresholds=STUCK_IMU, unit="s")
def gyroscope_stuck(judged: JudgedFlight) -> Finding:
    """Whether an axis of the gyroscope stands still."""
    return _stuck(gyroscope_stuck, judged, "the gyroscope", "gyro_rad")


def _stuck(asked: Check[JudgedFlight], judged: JudgedFlight, what: str, vector: str) -> Finding:
    axes = [[column] for column in field_names(judged.imu, vector)]
    return stuck(asked, judged, Subject(what, judged.imu, axes, judged.limits.high_stuck_imu_s))


@check(topics=STUCK_TOPICS, thresholds=("high_repeated_share",))
def imu_repeats(judged: JudgedFlight) -> Finding:
    """Share of the IMU rows that say the same as the row before, in all axes: samples that were logged twice."""
    imu, threshold = judged.imu, judged.limits.high_repeated_share
    columns = [*field_names(imu, "gyro_rad"), *field_names(imu, "accelerometer_m_s2")]
    flying = flying_steps(judged.flight, imu)
    same = flying & np.all([imu[column][1:] == imu[column][:-1] for column in columns], axis=0)
    share = float(np.sum(same) / max(np.sum(flying), 1))
    if share > threshold:
        found = f"{share:.0%} of the IMU samples repeat the one before"
        remedy = "Check the IMU's driver: the same sample must not be published twice"
        return imu_repeats.warned(found, remedy, share, threshold)
    return imu_repeats.passed(f"{share:.1%} of the IMU samples repeat the one before", share, threshold)
