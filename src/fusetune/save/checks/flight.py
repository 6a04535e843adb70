"""Checks of the flight: when the vehicle was in the air, and which estimator and IMU were in charge meanwhile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.save.checks.judged_flight import IN_THE_AIR, LAND_DETECTOR, JudgedFlight
from fusetune.save.checks.logging_advice import ONE_ESTIMATOR, log_from_boot
from fusetune.save.log_facts import airborne_intervals, is_airborne

_ONE_ESTIMATOR = f"Set {ONE_ESTIMATOR}, so that one estimator runs on one IMU"
_MOST_TURNS_TOLD = 12
_SELECTED_DEVICES = ("accel_device_id", "gyro_device_id")


@check(topics=(LAND_DETECTOR,))
def land_detector(judged: JudgedFlight) -> Finding:
    """Whether the log tells when the vehicle is in the air, which the estimator is told, too."""
    table = judged.flight.topic(LAND_DETECTOR)
    if table is None or "landed" not in table:
        found = "the log has no land detector: when the vehicle was in the air is unknown"
        return land_detector.warned(found, "Log with SDLOG_PROFILE bit 0 (default set) set", 0.0, 1.0)
    rows = len(table["timestamp"])
    return land_detector.passed(f"the land detector is logged ({rows} messages)", float(rows), 1.0)


@check(topics=IN_THE_AIR, thresholds=("low_airborne_s",), unit="s")
def airborne(judged: JudgedFlight) -> Finding:
    """Time in the air."""
    intervals, threshold = airborne_intervals(judged.flight), judged.limits.low_airborne_s
    if intervals is None:
        return airborne.does_not_apply("the log has no land detector")
    seconds = sum(end - begin for begin, end in intervals) * 1e-6
    if seconds < threshold:
        found = f"airborne for {seconds:.0f} s only" if seconds > 0.0 else "never airborne"
        return airborne.warned(found, "Log a flight; on the ground a filter shows little", seconds, threshold)
    return airborne.passed(f"airborne for {seconds:.0f} s", seconds, threshold)


@check(topics=IN_THE_AIR, thresholds=("low_lead_s",), unit="s")
def log_start(judged: JudgedFlight) -> Finding:
    """Time from the first IMU sample to take-off, in which the filter can find itself."""
    flight, threshold = judged.flight, judged.limits.low_lead_s
    intervals = airborne_intervals(flight)
    if not intervals:
        return log_start.does_not_apply("no take-off in the log")
    lead = (intervals[0][0] - judged.begin_us) * 1e-6
    if lead <= 0.0:
        return log_start.warned("the log begins in the air", log_from_boot(flight), lead, threshold)
    said = f"the log begins {lead:.1f} s before take-off"
    if lead < threshold:
        found = f"{said}: the filter aligns and learns its biases in flight"
        return log_start.warned(found, log_from_boot(flight), lead, threshold)
    return log_start.passed(said, lead, threshold)


@check(topics=("sensor_combined", "estimator_selector_status", "estimator_status", "estimator_states"))
def estimator_instances(judged: JudgedFlight) -> Finding:
    """How many estimators ran, and which of them was primary when."""
    flight = judged.flight
    selector = flight.topic("estimator_selector_status")
    count = max(len(flight.instances("estimator_status")), len(flight.instances("estimator_states")))
    if selector is None or not len(selector["primary_instance"]):
        if count == 0:
            return estimator_instances.does_not_apply("the log holds nothing of the vehicle's own estimator")
        if count == 1:
            return estimator_instances.passed("one estimator ran", 0.0, 0.0)
        found = f"{count} estimators ran; the log does not say which was primary"
        return estimator_instances.warned(found, _ONE_ESTIMATOR, 0.0, 0.0)
    primary = np.asarray(selector["primary_instance"], np.int64)
    changes = _changes(judged, selector["timestamp"], primary)
    if not changes:
        found = f"{max(count, 1)} estimators ran, primary: instance {primary[0]}"
        return estimator_instances.passed(found, 0.0, 0.0)
    later = [f"{value} from {time:.1f} s on" for time, value in changes[:_MOST_TURNS_TOLD]]
    more = f", {len(changes) - len(later)} changes more" if len(changes) > len(later) else ""
    turns = ", ".join([f"instance {primary[0]} first", *later]) + more
    found = f"{max(count, 1)} estimators ran, primary: {turns}"
    return estimator_instances.warned(found, _ONE_ESTIMATOR, float(len(changes)), 0.0)


@check(topics=(*IN_THE_AIR, "sensor_selection"))
def imu_selection(judged: JudgedFlight) -> Finding:
    """Whether the IMU whose samples are logged was the same during the whole flight."""
    selection = judged.flight.topic("sensor_selection")
    devices = [column for column in _SELECTED_DEVICES if column in (selection or {})]
    if selection is None or not devices:
        return imu_selection.does_not_apply("the log does not say which IMU was selected")
    times = sorted(
        {time for device in devices for time, _ in _changes(judged, selection["timestamp"], selection[device])}
    )
    in_flight = [time for time, flying in zip(times, _are_airborne(judged, times), strict=True) if flying]
    if in_flight:
        said = ", ".join(list(dict.fromkeys(f"{time:.1f} s" for time in in_flight))[:5])
        found = f"the selected IMU changed in flight (at {said}): its biases jump there"
        return imu_selection.warned(found, _ONE_ESTIMATOR, float(len(in_flight)), 0.0)
    return imu_selection.passed("one IMU was selected during the whole flight", 0.0, 0.0)


def _changes(judged: JudgedFlight, timestamps: np.ndarray, values: np.ndarray) -> list[tuple[float, int]]:
    """Times, in seconds after the first IMU sample, at which a value changed, with the new value."""
    rows = np.flatnonzero(values[1:] != values[:-1]) + 1
    return [(float(timestamps[row] - judged.begin_us) * 1e-6, int(values[row])) for row in rows]


def _are_airborne(judged: JudgedFlight, times_s: Sequence[float]) -> np.ndarray:
    """Whether the vehicle was in the air so long after the first IMU sample; assumed where nothing tells."""
    times = judged.begin_us + (np.array(times_s, np.float64) * 1e6).round().astype(np.int64)
    return is_airborne(judged.flight, times)
