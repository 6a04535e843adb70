"""A second IMU with an estimator of its own, and a selector that goes to and fro between the two."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fusetune.execute.sensors.faults import Fault, InstanceWhipsaw, of_kind
from fusetune.execute.sensors.imu import inertial_topics
from fusetune.execute.vehicle import Vehicle
from fusetune.execute.world.truth import Truth
from fusetune.execute.world.vehicle_state import ACCELEROMETER_ID, GYRO_ID
from fusetune.px4.flight import TopicKey, TopicTable, merge_tables, select_rows

Topics = dict[TopicKey, TopicTable]

SECOND_ID = 2621450
INSTANCES, PLACES = 2, 9
SELECTOR_INTERVAL_US = 500_000
SHARED = ("vehicle_attitude", "vehicle_local_position")
"""Topics that the selector passes on from the primary instance."""


def second_imu(sensed: Topics, truth: Truth, vehicle: Vehicle, faults: Sequence[Fault], seed: int) -> Topics:
    """The same sensors but for the IMU, which is another one of the same kind."""
    inertial = inertial_topics(truth, vehicle.imu, faults, seed + 1)
    selection = sensed["sensor_selection", 0]
    devices = {name: np.full_like(values, SECOND_ID) for name, values in selection.items() if "device_id" in name}
    status = {name: np.full_like(v, SECOND_ID) if "device_id" in name else v for name, v in inertial.status.items()}
    return sensed | {
        ("sensor_combined", 0): inertial.samples,
        ("sensor_selection", 0): selection | devices,
        ("vehicle_imu_status", 0): status,
    }


def with_second_instance(
    sensed: Sequence[Topics], estimated: Sequence[Topics], truth: Truth, faults: Sequence[Fault]
) -> Topics:
    """All topics of a vehicle that flies with two estimators.

    Parameters
    ----------
    sensed, estimated
        Of each instance, what its estimator gets and what it publishes.
    """
    end_us = int(truth.timestamp_us[-1])
    switches_us = _switches_us(truth, faults)

    def primary(timestamp: np.ndarray) -> np.ndarray:
        return np.searchsorted(switches_us, timestamp, side="right") % INSTANCES

    topics = dict(sensed[0])
    topics["sensor_combined", 0] = _of_primary([one["sensor_combined", 0] for one in sensed], primary)
    topics["vehicle_imu_status", 1] = sensed[1]["vehicle_imu_status", 0]
    for instance, published in enumerate(estimated):
        topics |= {(name, instance): table for (name, _), table in published.items() if name not in SHARED}
    for name in SHARED:
        if all((name, 0) in one for one in estimated):
            topics[name, 0] = _of_primary([one[name, 0] for one in estimated], primary)
    first_us = int(truth.timestamp_us[0])
    grid = np.arange(first_us, end_us, SELECTOR_INTERVAL_US, dtype=np.int64)
    timestamp = np.union1d(grid, switches_us).astype(np.int64)
    topics["estimator_selector_status", 0] = _selector(timestamp, primary(timestamp), switches_us)
    told = np.concatenate([[first_us], switches_us]).astype(np.int64)
    second = primary(told) == 1
    topics["sensor_selection", 0] = {
        "timestamp": told,
        "accel_device_id": np.where(second, SECOND_ID, ACCELEROMETER_ID).astype(np.uint32),
        "gyro_device_id": np.where(second, SECOND_ID, GYRO_ID).astype(np.uint32),
    }
    return topics


def _switches_us(truth: Truth, faults: Sequence[Fault]) -> np.ndarray:
    """When the other instance becomes primary, µs."""
    found = []
    for fault in of_kind(faults, InstanceWhipsaw):
        begin_s = truth.events.takeoff_s + fault.start_s
        found.append(begin_s + np.arange(0.0, fault.duration_s, fault.interval_s))
    switches = np.sort(np.concatenate(found)) if found else np.zeros(0)
    return np.rint(switches[switches < truth.time_s[-1]] * 1e6).astype(np.int64)


def _of_primary(tables: Sequence[TopicTable], primary: Callable[[np.ndarray], np.ndarray]) -> TopicTable:
    return merge_tables(
        [select_rows(table, primary(table["timestamp"]) == instance) for instance, table in enumerate(tables)]
    )


def _selector(timestamp: np.ndarray, chosen: np.ndarray, switches_us: np.ndarray) -> TopicTable:
    """`estimator_selector_status`: the instance in use has just become the worse one whenever it is left."""
    rows = len(timestamp)
    count = np.searchsorted(switches_us, timestamp, side="right")
    changed = np.concatenate([[0], switches_us])[count]
    nothing, no = np.zeros(rows, np.float32), np.zeros(rows, np.bool_)
    return {
        "timestamp": timestamp,
        "last_instance_change": changed.astype(np.uint64),
        "instance_changed_count": count.astype(np.uint32),
        "accel_device_id": np.where(chosen == 1, SECOND_ID, ACCELEROMETER_ID).astype(np.uint32),
        "gyro_device_id": np.where(chosen == 1, SECOND_ID, GYRO_ID).astype(np.uint32),
        **{f"combined_test_ratio[{place}]": nothing.copy() for place in range(PLACES)},
        **{f"relative_test_ratio[{place}]": nothing.copy() for place in range(PLACES)},
        "primary_instance": chosen.astype(np.uint8),
        "instances_available": np.full(rows, INSTANCES, np.uint8),
        **{f"healthy[{place}]": np.full(rows, place < INSTANCES) for place in range(PLACES)},
        "gyro_fault_detected": no,
        "accel_fault_detected": no.copy(),
    }
