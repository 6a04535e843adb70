"""Checks of the IMU samples, which drive a replay: whether they are there, in order, often enough, and without gaps."""

from __future__ import annotations

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.flight import TopicTable, field_names
from fusetune.px4.releases import CLIPPING_COUNTED, FIRST, name_of
from fusetune.save.checks.judged_flight import IMU, IS_COMPLETE, JudgedFlight
from fusetune.save.checks.logging_advice import COPY_AGAIN, FASTER_CARD, log_more

_CHECK_IMU_DRIVER = "Use the IMU driver of a PX4 release; integration times are microseconds, as time stamps are"
_SHORTEST_INTERVAL_S = 2e-4
"""Half of the interval of PX4's fastest gyroscope."""
_NEEDED = ("gyro_rad", "accelerometer_m_s2")
_INTEGRATION_TIMES = ("gyro_integral_dt", "accelerometer_integral_dt")


@check(topics=(IMU, *IS_COMPLETE))
def imu_present(judged: JudgedFlight) -> Finding:
    """Whether there are IMU samples that can be integrated at all."""
    imu = judged.flight.topic(IMU)
    if imu is None or len(imu["timestamp"]) < 2:
        return imu_present.failed("the log holds no IMU samples (topic sensor_combined)", log_more(judged.flight, IMU))
    missing = [name for name in _NEEDED if len(field_names(imu, name)) != 3]
    missing += [name for name in _INTEGRATION_TIMES if name not in imu]
    if missing:
        return imu_present.failed(
            f"the IMU samples lack {', '.join(missing)}", f"Use a log of PX4 {name_of(FIRST)} or later"
        )
    return imu_present.passed(f"{len(imu['timestamp'])} IMU samples", float(len(imu["timestamp"])))


@check(topics=(IMU,), thresholds=("max_imu_step_back_s",), unit="s")
def imu_clock(judged: JudgedFlight) -> Finding:
    """Whether time runs forward."""
    steps = np.diff(judged.imu["timestamp"]) * 1e-6
    worst = float(max(-steps.min(), 0.0))
    threshold = judged.limits.max_imu_step_back_s
    if worst > threshold:
        count = int(np.sum(steps < -threshold))
        times = "once" if count == 1 else f"{count} times"
        found = f"time in the log runs backwards {times} (by up to {worst:.0f} s): records are lost or out of order"
        return imu_clock.failed(found, COPY_AGAIN, worst, threshold)
    if worst > 0.0:
        found = f"IMU samples are out of order by up to {worst:.3f} s"
        return imu_clock.warned(found, "Check the SD card", worst, threshold)
    return imu_clock.passed("time runs forward", worst, threshold)


@check(topics=(IMU, *IS_COMPLETE), thresholds=("min_imu_rate_hz", "low_imu_rate_hz"), unit="Hz")
def imu_rate(judged: JudgedFlight) -> Finding:
    """Rate of the IMU samples, from the median interval."""
    limits, steps = judged.limits, np.diff(judged.imu["timestamp"])
    forward = steps[steps > 0]
    rate = 1e6 / float(np.median(forward)) if len(forward) else 0.0
    if rate < limits.min_imu_rate_hz:
        found = f"the IMU is logged at {rate:.0f} Hz, too slow to integrate (at least {limits.min_imu_rate_hz:.0f} Hz)"
        return imu_rate.failed(found, log_more(judged.flight, IMU), rate, limits.min_imu_rate_hz)
    if rate < limits.low_imu_rate_hz:
        found = f"the IMU is logged at only {rate:.0f} Hz"
        return imu_rate.warned(found, log_more(judged.flight, IMU), rate, limits.low_imu_rate_hz)
    return imu_rate.passed(f"the IMU is logged at {rate:.0f} Hz", rate, limits.min_imu_rate_hz)


@check(topics=(IMU,), thresholds=("min_imu_duration_s",), unit="s")
def imu_duration(judged: JudgedFlight) -> Finding:
    """Time from the first IMU sample to the last."""
    duration, threshold = _duration_s(judged.imu), judged.limits.min_imu_duration_s
    if duration < threshold:
        found = f"too short: {duration:.1f} s of IMU samples (at least {threshold:.0f} s)"
        return imu_duration.failed(found, "Log a whole flight", duration, threshold)
    return imu_duration.passed(f"{duration:.1f} s of IMU samples", duration, threshold)


@check(topics=(IMU,), thresholds=("max_imu_gap_s", "high_imu_gap_s"), unit="s")
def imu_gaps(judged: JudgedFlight) -> Finding:
    """Longest time between two IMU samples; times in which the filter would be on its own."""
    limits, timestamp = judged.limits, judged.imu["timestamp"]
    steps = np.diff(timestamp) * 1e-6
    longest = float(steps.max(initial=0.0))
    count = int(np.sum(steps > limits.high_imu_gap_s))
    row = int(np.argmax(steps))
    start_us, stop_us = int(timestamp[row]), int(timestamp[row + 1])
    evidence = {"gaps": count}
    if longest > limits.max_imu_gap_s:
        return imu_gaps.failed(
            f"no IMU samples for {longest:.0f} s: the log has parts that do not belong to one flight",
            "Log each flight as a whole",
            longest,
            limits.max_imu_gap_s,
            start_us=start_us,
            stop_us=stop_us,
            evidence=evidence,
        )
    if count:
        gaps = "a gap" if count == 1 else f"{count} gaps"
        found = f"the IMU samples have {gaps} of up to {longest:.2f} s"
        return imu_gaps.warned(
            found, FASTER_CARD, longest, limits.high_imu_gap_s, start_us=start_us, stop_us=stop_us, evidence=evidence
        )
    return imu_gaps.passed(f"no gap longer than {longest:.3f} s", longest, limits.high_imu_gap_s)


@check(topics=(IMU,), thresholds=("high_clipping_share",))
def imu_clipping(judged: JudgedFlight) -> Finding:
    """Share of the IMU samples in which the accelerometer was at the end of its range."""
    flight, imu, threshold = judged.flight, judged.imu, judged.limits.high_clipping_share
    if flight.release is not None and flight.release < CLIPPING_COUNTED:
        return imu_clipping.does_not_apply(f"{flight.release_name} does not log clipping")
    share = float(np.mean(imu["accelerometer_clipping"] != 0)) if "accelerometer_clipping" in imu else 0.0
    if share > threshold:
        found = f"the accelerometer clips in {share:.1%} of the IMU samples"
        return imu_clipping.warned(found, "Damp the vibration of the autopilot's mount", share, threshold)
    return imu_clipping.passed(f"the accelerometer clips in {share:.2%} of the samples", share, threshold)


@check(
    topics=(IMU,),
    thresholds=("min_imu_coverage", "low_imu_coverage", "high_imu_coverage", "max_imu_coverage"),
)
def imu_coverage(judged: JudgedFlight) -> Finding:
    """Share of the time that IMU samples integrate over; the rest was lost by the logger.

    Of the accelerometer's and the gyroscope's integration times the sum counts that is farther from the time passed.
    """
    limits, imu = judged.limits, judged.imu
    duration = _duration_s(imu)
    sums = [float(np.sum(imu[column][1:], dtype=np.float64)) * 1e-6 for column in _INTEGRATION_TIMES]
    coverage = max((total / duration for total in sums), key=lambda share: abs(share - 1.0)) if duration > 0.0 else 0.0
    interval_s = float(np.median(imu["gyro_integral_dt"])) * 1e-6
    said = f"IMU samples cover {coverage:.0%} of the time"
    do_not_fit = f"the integration times of the IMU do not fit its time stamps: {said}"
    if coverage > limits.max_imu_coverage:
        return imu_coverage.failed(do_not_fit, _CHECK_IMU_DRIVER, coverage, limits.max_imu_coverage)
    if coverage > limits.high_imu_coverage:
        return imu_coverage.warned(do_not_fit, _CHECK_IMU_DRIVER, coverage, limits.high_imu_coverage)
    if interval_s < _SHORTEST_INTERVAL_S:
        found = f"the integration times of the IMU are not in microseconds ({interval_s * 1e6:g}): {said}"
        return imu_coverage.failed(found, _CHECK_IMU_DRIVER, coverage, limits.min_imu_coverage)
    if coverage < limits.min_imu_coverage:
        found = f"{said} (at least {limits.min_imu_coverage:.0%})"
        return imu_coverage.failed(found, FASTER_CARD, coverage, limits.min_imu_coverage)
    if coverage < limits.low_imu_coverage:
        return imu_coverage.warned(f"{said}: the logger lost samples", FASTER_CARD, coverage, limits.low_imu_coverage)
    return imu_coverage.passed(said, coverage, limits.low_imu_coverage)


def _duration_s(imu: TopicTable) -> float:
    return float(imu["timestamp"].max() - imu["timestamp"].min()) * 1e-6
