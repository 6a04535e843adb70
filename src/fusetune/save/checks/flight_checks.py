"""Checks of the flight: when the vehicle was in the air, and what changed meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fusetune.px4.flight import Flight
from fusetune.save.checks.check import Check, Status
from fusetune.save.checks.logging_advice import ONE_ESTIMATOR, log_from_boot
from fusetune.save.log_facts import airborne_intervals, is_airborne
from fusetune.save.thresholds import VerdictThresholds

_ONE_ESTIMATOR = f"Set {ONE_ESTIMATOR}, so that one estimator runs on one IMU"
_SAVED_BY_EKF2 = ("EKF2_MAG_DECL", "EKF2_MAGBIAS_X", "EKF2_MAGBIAS_Y", "EKF2_MAGBIAS_Z")
"""Parameters that the estimator itself stores."""
_MOST_TURNS_TOLD = 12
_SELECTED_DEVICES = ("accel_device_id", "gyro_device_id")
_OF_THE_ESTIMATOR = ("EKF2_", "SENS_", "CAL_", "IMU_")


def land_detector(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the log tells when the vehicle is in the air, which the estimator is told, too."""
    table = flight.topic("vehicle_land_detected")
    if table is None or "landed" not in table:
        reason = "the log has no land detector: when the vehicle was in the air is unknown"
        return Check("land_detector", "warning", reason, "Log with SDLOG_PROFILE bit 0 (default set) set", 0.0, 1.0)
    rows = len(table["timestamp"])
    return Check("land_detector", "pass", f"the land detector is logged ({rows} messages)", "", float(rows), 1.0)


def airborne(flight: Flight, limits: VerdictThresholds) -> Check:
    """Time in the air."""
    intervals = airborne_intervals(flight)
    if intervals is None:
        return Check("airborne", "does-not-apply", "the log has no land detector")
    seconds = sum(end - begin for begin, end in intervals) * 1e-6
    if seconds < limits.low_airborne_s:
        reason = f"airborne for {seconds:.0f} s only" if seconds > 0.0 else "never airborne"
        remedy = "Log a flight; on the ground a filter shows little"
        return Check("airborne", "warning", reason, remedy, seconds, limits.low_airborne_s)
    return Check("airborne", "pass", f"airborne for {seconds:.0f} s", "", seconds, limits.low_airborne_s)


def log_start(flight: Flight, limits: VerdictThresholds) -> Check:
    """Time from the first IMU sample to take-off, in which the filter can find itself."""
    name, threshold = "log_start", limits.low_lead_s
    intervals = airborne_intervals(flight)
    if not intervals:
        return Check(name, "does-not-apply", "no take-off in the log")
    lead = (intervals[0][0] - int(flight.topics["sensor_combined", 0]["timestamp"].min())) * 1e-6
    if lead <= 0.0:
        return Check(name, "warning", "the log begins in the air", log_from_boot(flight), lead, threshold)
    said = f"the log begins {lead:.1f} s before take-off"
    if lead < threshold:
        reason = f"{said}: the filter aligns and learns its biases in flight"
        return Check(name, "warning", reason, log_from_boot(flight), lead, threshold)
    return Check(name, "pass", said, "", lead, threshold)


def estimator_instances(flight: Flight, limits: VerdictThresholds) -> Check:
    """How many estimators ran, and which of them was primary when."""
    name = "estimator_instances"
    selector = flight.topic("estimator_selector_status")
    count = max(len(flight.instances("estimator_status")), len(flight.instances("estimator_states")))
    if selector is None or not len(selector["primary_instance"]):
        if count == 0:
            return Check(name, "does-not-apply", "the log holds nothing of the vehicle's own estimator")
        words = "one estimator ran" if count == 1 else f"{count} estimators ran; the log does not say which was primary"
        status: Status = "pass" if count == 1 else "warning"
        return Check(name, status, words, "" if count == 1 else _ONE_ESTIMATOR, 0.0, 0.0)
    primary = np.asarray(selector["primary_instance"], np.int64)
    changes = _changes(flight, selector["timestamp"], primary)
    later = [f"{value} from {time:.1f} s on" for time, value in changes[:_MOST_TURNS_TOLD]]
    more = f", {len(changes) - len(later)} changes more" if len(changes) > len(later) else ""
    turns = ", ".join([f"instance {primary[0]} first", *later]) + more
    reason = f"{max(count, 1)} estimators ran, primary: {turns}"
    if changes:
        return Check(name, "warning", reason, _ONE_ESTIMATOR, float(len(changes)), 0.0)
    return Check(name, "pass", f"{max(count, 1)} estimators ran, primary: instance {primary[0]}", "", 0.0, 0.0)


def imu_selection(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the IMU whose samples are logged was the same during the whole flight."""
    name, selection = "imu_selection", flight.topic("sensor_selection")
    devices = [column for column in _SELECTED_DEVICES if column in (selection or {})]
    if selection is None or not devices:
        return Check(name, "does-not-apply", "the log does not say which IMU was selected")
    times = sorted(
        {time for device in devices for time, _ in _changes(flight, selection["timestamp"], selection[device])}
    )
    in_flight = [time for time, flying in zip(times, _are_airborne(flight, times), strict=True) if flying]
    if in_flight:
        said = ", ".join(list(dict.fromkeys(f"{time:.1f} s" for time in in_flight))[:5])
        reason = f"the selected IMU changed in flight (at {said}): its biases jump there"
        return Check(name, "warning", reason, _ONE_ESTIMATOR, float(len(in_flight)), 0.0)
    return Check(name, "pass", "one IMU was selected during the whole flight", "", 0.0, 0.0)


def parameter_changes(flight: Flight, limits: VerdictThresholds) -> Check:
    """Parameters of estimator and sensors that were changed in the air; a replay keeps one set."""
    name, begin = "parameter_changes", _begin_us(flight)
    relevant = [
        change
        for change in flight.parameters.changed
        if change.name.startswith(_OF_THE_ESTIMATOR) and change.name not in _SAVED_BY_EKF2
    ]
    flying = is_airborne(flight, np.array([change.timestamp for change in relevant], np.int64))
    changed = [change for change, in_the_air in zip(relevant, flying, strict=True) if in_the_air]
    if not changed:
        return Check(name, "pass", "no parameter of estimator or sensors changed in flight", "", 0.0, 0.0)
    said = ", ".join(f"{one.name} = {one.value:g} at {(one.timestamp - begin) * 1e-6:.1f} s" for one in changed[:5])
    reason = f"parameters changed in flight ({said}{' …' if len(changed) > 5 else ''})"
    return Check(name, "warning", reason, "Change parameters on the ground only", float(len(changed)), 0.0)


def _changes(flight: Flight, timestamps: np.ndarray, values: np.ndarray) -> list[tuple[float, int]]:
    """Times, in seconds after the first IMU sample, at which a value changed, with the new value."""
    rows = np.flatnonzero(values[1:] != values[:-1]) + 1
    begin = _begin_us(flight)
    return [(float(timestamps[row] - begin) * 1e-6, int(values[row])) for row in rows]


def _begin_us(flight: Flight) -> int:
    return int(flight.topics["sensor_combined", 0]["timestamp"].min())


def _are_airborne(flight: Flight, times_s: Sequence[float]) -> np.ndarray:
    """Whether the vehicle was in the air so long after the first IMU sample; assumed where nothing tells."""
    return is_airborne(flight, _begin_us(flight) + (np.array(times_s, np.float64) * 1e6).round().astype(np.int64))


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    land_detector,
    airborne,
    log_start,
    estimator_instances,
    imu_selection,
    parameter_changes,
)
