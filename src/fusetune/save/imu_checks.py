"""Checks of the log itself and of the IMU samples that drive a replay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusetune.px4.flight import Flight, TopicTable, field_names, stacked
from fusetune.save.verdict import Check, VerdictThresholds

_LOG_MORE = "Log with SDLOG_PROFILE bit 1 (estimator replay) set"
_NEEDED = ("gyro_rad", "accelerometer_m_s2")
_INTEGRATION_TIMES = ("gyro_integral_dt", "accelerometer_integral_dt")


def readable(flight: Flight) -> Check:
    """Whether the whole file made sense."""
    if flight.corruption:
        reason = f"parts of the log are damaged ({'; '.join(flight.corruption)})"
        return Check("readable", "warning", reason, "Copy the log from the vehicle again; check the SD card")
    return Check("readable", "pass", "the log is sound")


def imu_present(flight: Flight) -> Check:
    """Whether there are IMU samples that can be integrated at all."""
    imu = flight.topic("sensor_combined")
    if imu is None or len(imu["timestamp"]) < 2:
        return Check("imu_present", "fail", "the log holds no IMU samples (topic sensor_combined)", _LOG_MORE)
    missing = [name for name in _NEEDED if len(field_names(imu, name)) != 3]
    missing += [name for name in _INTEGRATION_TIMES if name not in imu]
    if missing:
        reason = f"the IMU samples lack {', '.join(missing)}"
        return Check("imu_present", "fail", reason, "Use a log of PX4 v1.8 or later")
    broken = int(np.sum(~np.isfinite(np.hstack([stacked(imu, name) for name in _NEEDED])).all(axis=1)))
    if broken:
        reason = f"{broken} IMU samples are not finite numbers"
        return Check("imu_present", "fail", reason, "Check the SD card and the sensors", float(broken), 0.0)
    return Check("imu_present", "pass", f"{len(imu['timestamp'])} IMU samples", figure=float(len(imu["timestamp"])))


def imu_clock(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether time runs forward."""
    steps = np.diff(_imu(flight)["timestamp"]) * 1e-6
    worst = float(max(-steps.min(), 0.0))
    threshold = limits.max_imu_step_back_s
    if worst > threshold:
        count = int(np.sum(steps < -threshold))
        times = "once" if count == 1 else f"{count} times"
        reason = f"time in the log runs backwards {times} (by up to {worst:.0f} s): records are lost or out of order"
        return Check(
            "imu_clock", "fail", reason, "Copy the log from the vehicle again; check the SD card", worst, threshold
        )
    if worst > 0.0:
        reason = f"IMU samples are out of order by up to {worst:.3f} s"
        return Check("imu_clock", "warning", reason, "Check the SD card", worst, threshold)
    return Check("imu_clock", "pass", "time runs forward", "", worst, threshold)


def imu_rate(flight: Flight, limits: VerdictThresholds) -> Check:
    """Rate of the IMU samples, from the median interval."""
    steps = np.diff(_imu(flight)["timestamp"])
    forward = steps[steps > 0]
    rate = 1e6 / float(np.median(forward)) if len(forward) else 0.0
    if rate < limits.min_imu_rate_hz:
        reason = f"the IMU is logged at {rate:.0f} Hz, too slow to integrate (at least {limits.min_imu_rate_hz:.0f} Hz)"
        return Check("imu_rate", "fail", reason, _LOG_MORE, rate, limits.min_imu_rate_hz)
    if rate < limits.low_imu_rate_hz:
        reason = f"the IMU is logged at only {rate:.0f} Hz"
        return Check("imu_rate", "warning", reason, _LOG_MORE, rate, limits.low_imu_rate_hz)
    return Check("imu_rate", "pass", f"the IMU is logged at {rate:.0f} Hz", "", rate, limits.min_imu_rate_hz)


def imu_duration(flight: Flight, limits: VerdictThresholds) -> Check:
    """Time from the first IMU sample to the last."""
    duration = _duration_s(_imu(flight))
    threshold = limits.min_imu_duration_s
    if duration < threshold:
        reason = f"too short: {duration:.1f} s of IMU samples (at least {threshold:.0f} s)"
        return Check("imu_duration", "fail", reason, "Log a whole flight", duration, threshold)
    return Check("imu_duration", "pass", f"{duration:.1f} s of IMU samples", "", duration, threshold)


def imu_coverage(flight: Flight, limits: VerdictThresholds) -> Check:
    """Share of the time that IMU samples integrate over; the rest was lost by the logger."""
    imu = _imu(flight)
    duration = _duration_s(imu)
    integrated = float(np.sum(imu["gyro_integral_dt"][1:], dtype=np.float64)) * 1e-6
    coverage = integrated / duration if duration > 0.0 else 0.0
    said = f"IMU samples cover {coverage:.0%} of the time"
    remedy = "Use a faster SD card, or log fewer topics"
    if coverage < limits.min_imu_coverage:
        reason = f"{said} (at least {limits.min_imu_coverage:.0%})"
        return Check("imu_coverage", "fail", reason, remedy, coverage, limits.min_imu_coverage)
    if coverage < limits.low_imu_coverage:
        return Check(
            "imu_coverage", "warning", f"{said}: the logger lost samples", remedy, coverage, limits.low_imu_coverage
        )
    return Check("imu_coverage", "pass", said, "", coverage, limits.low_imu_coverage)


def _imu(flight: Flight) -> TopicTable:
    return flight.topics["sensor_combined", 0]


def _duration_s(imu: TopicTable) -> float:
    return float(imu["timestamp"].max() - imu["timestamp"].min()) * 1e-6


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (imu_clock, imu_rate, imu_duration, imu_coverage)
