"""Which estimator instance flew, and which magnetometer it used, in logs of several instances (multi-EKF)."""

from __future__ import annotations

import numpy as np

from fusetune.px4.flight import Flight


def primary_instance(flight: Flight) -> int:
    """The instance that the selector names in most of its messages; 0 where the log has no selector.

    A replay follows one estimator, so a flight in which the selector switched is represented by one instance.
    """
    selector = flight.topic("estimator_selector_status")
    if selector is None or not len(selector["primary_instance"]):
        return 0
    chosen = np.asarray(selector["primary_instance"], np.int64)
    return int(np.argmax(np.bincount(chosen)))


def primary_instance_at(flight: Flight, timestamps: np.ndarray) -> np.ndarray:
    """The instance that was primary at each time (µs); before the first message of the selector: its first choice."""
    selector = flight.topic("estimator_selector_status")
    if selector is None or not len(selector["primary_instance"]):
        return np.zeros(len(timestamps), np.int64)
    rows = np.searchsorted(selector["timestamp"], timestamps, side="right") - 1
    return np.asarray(selector["primary_instance"], np.int64)[np.maximum(rows, 0)]


def magnetometer_instance(flight: Flight) -> int:
    """Instance of `vehicle_magnetometer` that the primary estimator instance used.

    Found by the device id in its `estimator_status`; the first instance where the log does not tell.
    """
    instances = flight.instances("vehicle_magnetometer")
    first = instances[0] if instances else 0
    status = flight.topic("estimator_status", primary_instance(flight))
    if status is None or "mag_device_id" not in status or len(instances) < 2:
        return first
    used = np.asarray(status["mag_device_id"])
    used = used[used != 0]
    if not len(used):
        return first
    ids, counts = np.unique(used, return_counts=True)
    wanted = ids[np.argmax(counts)]
    for instance in instances:
        if np.any(flight.topics["vehicle_magnetometer", instance].get("device_id", np.zeros(1)) == wanted):
            return instance
    return first
