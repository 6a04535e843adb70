"""Which estimator instance flew, and which IMU and magnetometer it used, in logs of several instances (multi-EKF)."""

from __future__ import annotations

import numpy as np

from fusetune.px4.flight import Flight, TopicKey, TopicTable, merge_tables, row_count, select_rows, stacked

FULL_IMU_RATE_HZ = 100.0
"""From this rate on `vehicle_imu` can be replayed; by default it is logged twice a second."""


def selector_status(flight: Flight) -> TopicTable | None:
    """Messages of the selector; None where the log has none that name the primary instance."""
    selector = flight.topic("estimator_selector_status")
    return selector if selector is not None and len(selector.get("primary_instance", ())) else None


def primary_instance(flight: Flight) -> int:
    """The instance that the selector names in most of its messages; 0 where the log has no selector.

    It stands for the flight where that has to be one of one estimator, see `of_one_instance`.
    """
    selector = selector_status(flight)
    if selector is None:
        return 0
    chosen = np.asarray(selector["primary_instance"], np.int64)
    return int(np.argmax(np.bincount(chosen)))


def primary_instance_at(flight: Flight, timestamps: np.ndarray) -> np.ndarray:
    """The instance that was primary at each time (µs); before the first message of the selector: its first choice."""
    selector = selector_status(flight)
    if selector is None:
        return np.zeros(len(timestamps), np.int64)
    rows = np.searchsorted(selector["timestamp"], timestamps, side="right") - 1
    return np.asarray(selector["primary_instance"], np.int64)[np.maximum(rows, 0)]


def of_one_instance(flight: Flight) -> Flight:
    """The flight as if the instance that was primary for most of it had flown alone.

    For comparisons with replays of PX4, which run one estimator from the sensors of one instance.
    """
    chosen = primary_instance(flight)
    topics: dict[TopicKey, TopicTable] = {}
    for (name, instance), table in flight.topics.items():
        if name == "estimator_selector_status" or name == "vehicle_imu":
            continue
        if not name.startswith("estimator_"):
            topics[name, instance] = table
        elif instance == chosen:
            topics[name, 0] = table
    return flight.with_topics(topics)


def instance_switches(flight: Flight) -> np.ndarray:
    """Times (µs) at which another instance became the primary one."""
    selector = selector_status(flight)
    if selector is None:
        return np.zeros(0, np.int64)
    changed = np.flatnonzero(np.diff(np.asarray(selector["primary_instance"], np.int64))) + 1
    return np.asarray(selector["timestamp"], np.int64)[changed]


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


def instance_shares(flight: Flight) -> dict[int, float]:
    """Share of the log in which each estimator instance was the primary one."""
    selector = selector_status(flight)
    if selector is None:
        return {0: 1.0}
    start = np.asarray(selector["timestamp"], np.int64)
    stop = np.append(start[1:], max(flight.last_timestamp, int(start[-1]) + 1))
    chosen = np.asarray(selector["primary_instance"], np.int64)
    total = float((stop - start).sum())
    return {int(k): float((stop - start)[chosen == k].sum()) / total for k in np.unique(chosen)}


def rows_of_primary(flight: Flight, topic: str) -> TopicTable | None:
    """Messages of an estimator topic, each from the instance that was primary at its time; None without any."""
    tables = {instance: flight.topics[topic, instance] for instance in flight.instances(topic)}
    if not tables:
        return None
    if len(tables) == 1:
        return next(iter(tables.values()))
    parts = [
        select_rows(table, primary_instance_at(flight, table["timestamp"]) == instance)
        for instance, table in tables.items()
    ]
    return merge_tables([part for part in parts if row_count(part)] or [tables[min(tables)]])


def primary_magnetometer(flight: Flight) -> TopicTable | None:
    """`vehicle_magnetometer` as the primary instance saw it: of each time, the device that it used then.

    None where the log holds one magnetometer only, or does not tell which device was used.
    """
    instances = flight.instances("vehicle_magnetometer")
    tables = [flight.topics["vehicle_magnetometer", instance] for instance in instances]
    if len(tables) < 2 or any("device_id" not in table for table in tables):
        return None
    parts = []
    for table in tables:
        used = _device_in_use(flight, "mag_device_id", table["timestamp"])
        if used is None:
            return None
        parts.append(select_rows(table, np.asarray(table["device_id"], np.int64) == used))
    found = [part for part in parts if row_count(part)]
    return merge_tables(found) if found else None


def primary_imu(flight: Flight) -> TopicTable | None:
    """`sensor_combined` made from `vehicle_imu` of the devices that the primary instance used.

    None where the log holds `vehicle_imu` too seldom, as by default; then `sensor_combined`, which follows the
    selected IMU, is the best there is.
    """
    parts = []
    for instance in flight.instances("vehicle_imu"):
        table = flight.topics["vehicle_imu", instance]
        used = _device_in_use(flight, "accel_device_id", table["timestamp"])
        if used is None or "accel_device_id" not in table or not _is_full_rate(table):
            return None
        parts.append(select_rows(table, np.asarray(table["accel_device_id"], np.int64) == used))
    found = [part for part in parts if row_count(part)]
    return _as_sensor_combined(merge_tables(found)) if found else None


def _is_full_rate(table: TopicTable) -> bool:
    rows = row_count(table)
    span_s = float(table["timestamp"][-1] - table["timestamp"][0]) * 1e-6 if rows > 1 else 0.0
    return span_s > 0.0 and rows / span_s >= FULL_IMU_RATE_HZ


def _as_sensor_combined(imu: TopicTable) -> TopicTable:
    gyro_dt, accel_dt = (np.asarray(imu[name], np.float64) for name in ("delta_angle_dt", "delta_velocity_dt"))
    time = imu["timestamp_sample"] if "timestamp_sample" in imu else imu["timestamp"]
    rate = stacked(imu, "delta_angle") / (np.maximum(gyro_dt, 1.0) * 1e-6)[:, None]
    force = stacked(imu, "delta_velocity") / (np.maximum(accel_dt, 1.0) * 1e-6)[:, None]
    rows = np.unique(np.asarray(time, np.int64), return_index=True)[1]
    table: TopicTable = {"timestamp": np.asarray(time, np.int64)}
    table |= {f"gyro_rad[{axis}]": rate[:, axis].astype(np.float32) for axis in range(3)}
    table |= {f"accelerometer_m_s2[{axis}]": force[:, axis].astype(np.float32) for axis in range(3)}
    table["gyro_integral_dt"] = gyro_dt.astype(np.uint32)
    table["accelerometer_integral_dt"] = accel_dt.astype(np.uint32)
    unknown = np.zeros(len(gyro_dt), np.uint8)
    table["accelerometer_clipping"] = imu.get("delta_velocity_clipping", unknown)
    table["accel_calibration_count"] = imu.get("accel_calibration_count", unknown)
    table["gyro_calibration_count"] = imu.get("gyro_calibration_count", unknown)
    return select_rows(table, rows)


def _device_in_use(flight: Flight, name: str, times: np.ndarray) -> np.ndarray | None:
    """Device id that the primary instance used at each time; None where the log does not tell."""
    primary = primary_instance_at(flight, times)
    used = np.zeros(len(times), np.int64)
    for instance in np.unique(primary):
        status = flight.topic("estimator_status", int(instance))
        if status is None or name not in status:
            return None
        ids = np.asarray(status[name], np.int64)
        told = ids != 0
        if not told.any():
            return None
        rows = np.maximum(np.searchsorted(status["timestamp"][told], times, side="right") - 1, 0)
        here = primary == instance
        used[here] = ids[told][rows[here]]
    return used
