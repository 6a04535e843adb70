"""Checks of the IMU samples, which drive a replay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusetune.px4.flight import Flight, TopicTable, field_names
from fusetune.save.checks.check import Check, Status
from fusetune.save.checks.logging_advice import FASTER_CARD, log_more
from fusetune.save.thresholds import VerdictThresholds

_CHECK_IMU_DRIVER = "Use the IMU driver of a PX4 release; integration times are microseconds, as time stamps are"
_SHORTEST_INTERVAL_S = 2e-4
"""Half of the interval of PX4's fastest gyroscope."""
_CLIPPING_SINCE = (1, 11, 0)
_NEEDED = ("gyro_rad", "accelerometer_m_s2")
_INTEGRATION_TIMES = ("gyro_integral_dt", "accelerometer_integral_dt")


def imu_present(flight: Flight) -> Check:
    """Whether there are IMU samples that can be integrated at all."""
    imu = flight.topic("sensor_combined")
    if imu is None or len(imu["timestamp"]) < 2:
        return Check(
            "imu_present",
            "fail",
            "the log holds no IMU samples (topic sensor_combined)",
            log_more(flight, "sensor_combined"),
        )
    missing = [name for name in _NEEDED if len(field_names(imu, name)) != 3]
    missing += [name for name in _INTEGRATION_TIMES if name not in imu]
    if missing:
        reason = f"the IMU samples lack {', '.join(missing)}"
        return Check("imu_present", "fail", reason, "Use a log of PX4 v1.8 or later")
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
        return Check("imu_rate", "fail", reason, log_more(flight, "sensor_combined"), rate, limits.min_imu_rate_hz)
    if rate < limits.low_imu_rate_hz:
        reason = f"the IMU is logged at only {rate:.0f} Hz"
        return Check("imu_rate", "warning", reason, log_more(flight, "sensor_combined"), rate, limits.low_imu_rate_hz)
    return Check("imu_rate", "pass", f"the IMU is logged at {rate:.0f} Hz", "", rate, limits.min_imu_rate_hz)


def imu_duration(flight: Flight, limits: VerdictThresholds) -> Check:
    """Time from the first IMU sample to the last."""
    duration = _duration_s(_imu(flight))
    threshold = limits.min_imu_duration_s
    if duration < threshold:
        reason = f"too short: {duration:.1f} s of IMU samples (at least {threshold:.0f} s)"
        return Check("imu_duration", "fail", reason, "Log a whole flight", duration, threshold)
    return Check("imu_duration", "pass", f"{duration:.1f} s of IMU samples", "", duration, threshold)


def imu_gaps(flight: Flight, limits: VerdictThresholds) -> Check:
    """Longest time between two IMU samples; times in which the filter would be on its own."""
    steps = np.diff(_imu(flight)["timestamp"]) * 1e-6
    longest = float(steps.max(initial=0.0))
    count = int(np.sum(steps > limits.high_imu_gap_s))
    if longest > limits.max_imu_gap_s:
        reason = f"no IMU samples for {longest:.0f} s: the log has parts that do not belong to one flight"
        return Check("imu_gaps", "fail", reason, "Log each flight as a whole", longest, limits.max_imu_gap_s)
    if count:
        gaps = "a gap" if count == 1 else f"{count} gaps"
        reason = f"the IMU samples have {gaps} of up to {longest:.2f} s"
        return Check("imu_gaps", "warning", reason, FASTER_CARD, longest, limits.high_imu_gap_s)
    return Check("imu_gaps", "pass", f"no gap longer than {longest:.3f} s", "", longest, limits.high_imu_gap_s)


def imu_clipping(flight: Flight, limits: VerdictThresholds) -> Check:
    """Share of the IMU samples in which the accelerometer was at the end of its range."""
    name, imu, threshold = "imu_clipping", _imu(flight), limits.high_clipping_share
    if flight.release is not None and flight.release < _CLIPPING_SINCE:
        return Check(name, "does-not-apply", f"{flight.release_name} does not log clipping")
    share = float(np.mean(imu["accelerometer_clipping"] != 0)) if "accelerometer_clipping" in imu else 0.0
    if share > threshold:
        reason = f"the accelerometer clips in {share:.1%} of the IMU samples"
        return Check(name, "warning", reason, "Damp the vibration of the autopilot's mount", share, threshold)
    return Check(name, "pass", f"the accelerometer clips in {share:.2%} of the samples", "", share, threshold)


def imu_coverage(flight: Flight, limits: VerdictThresholds) -> Check:
    """Share of the time that IMU samples integrate over; the rest was lost by the logger.

    Of the accelerometer's and the gyroscope's integration times the sum counts that is farther from the time passed.
    """
    name, imu = "imu_coverage", _imu(flight)
    duration = _duration_s(imu)
    sums = [float(np.sum(imu[column][1:], dtype=np.float64)) * 1e-6 for column in _INTEGRATION_TIMES]
    coverage = max((total / duration for total in sums), key=lambda share: abs(share - 1.0)) if duration > 0.0 else 0.0
    interval_s = float(np.median(imu["gyro_integral_dt"])) * 1e-6
    said = f"IMU samples cover {coverage:.0%} of the time"
    if coverage > limits.high_imu_coverage:
        status: Status = "fail" if coverage > limits.max_imu_coverage else "warning"
        reason = f"the integration times of the IMU do not fit its time stamps: {said}"
        threshold = limits.max_imu_coverage if status == "fail" else limits.high_imu_coverage
        return Check(name, status, reason, _CHECK_IMU_DRIVER, coverage, threshold)
    if interval_s < _SHORTEST_INTERVAL_S:
        reason = f"the integration times of the IMU are not in microseconds ({interval_s * 1e6:g}): {said}"
        return Check(name, "fail", reason, _CHECK_IMU_DRIVER, coverage, limits.min_imu_coverage)
    if coverage < limits.min_imu_coverage:
        reason = f"{said} (at least {limits.min_imu_coverage:.0%})"
        return Check(name, "fail", reason, FASTER_CARD, coverage, limits.min_imu_coverage)
    if coverage < limits.low_imu_coverage:
        reason = f"{said}: the logger lost samples"
        return Check(name, "warning", reason, FASTER_CARD, coverage, limits.low_imu_coverage)
    return Check(name, "pass", said, "", coverage, limits.low_imu_coverage)


def _imu(flight: Flight) -> TopicTable:
    return flight.topics["sensor_combined", 0]


def _duration_s(imu: TopicTable) -> float:
    return float(imu["timestamp"].max() - imu["timestamp"].min()) * 1e-6


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    imu_clock,
    imu_rate,
    imu_duration,
    imu_gaps,
    imu_coverage,
    imu_clipping,
)
