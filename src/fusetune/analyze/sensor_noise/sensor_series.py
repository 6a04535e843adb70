"""The samples of each sensor: of what a log holds the fullest, with the rate and over what each sample is a mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.px4.flight import Flight, TopicTable, field_names, row_count, stacked
from fusetune.px4.layouts.logged_state import METRES_PER_DEGREE
from fusetune.px4.sample_times import measurement_time

Array = npt.NDArray[np.float64]
SensorName = Literal["gyro", "accel", "mag", "baro", "gnss_vel", "gnss_pos"]
BODY, EARTH = ("x", "y", "z"), ("north", "east", "down")

FEWEST_SAMPLES = 50
FULLER = 1.2
"""Another topic is taken when it holds so many times the samples."""
GAP_STEPS = 1.5
"""From so many sampling intervals on there is a gap: the stretch ends there. Lost samples are not made up for: a mean
of the neighbours of a tone near half the rate is wrong by its whole amplitude, and that is noise in the whole band."""
MOST_IMU_HZ = 1000.0
"""Faster samples are averaged to about this: what EKF2 integrates over milliseconds is not told by microseconds."""
WHOLE = 0.9
"""A sample that is a mean over less of the sampling interval has had its neighbours thinned away."""
_FIX_3D = 3


@dataclass(frozen=True)
class Sensor:
    """What is characterised: its name in words, unit and axes."""

    name: SensorName
    label: str
    unit: str
    axes: tuple[str, ...]

    @property
    def is_inertial(self) -> bool:
        """Whether EKF2 integrates it."""
        return self.name in ("gyro", "accel")


SENSORS: Mapping[SensorName, Sensor] = {
    one.name: one
    for one in (
        Sensor("gyro", "gyro", "rad/s", BODY),
        Sensor("accel", "accelerometer", "m/s²", BODY),
        Sensor("mag", "magnetometer", "Gs", BODY),
        Sensor("baro", "barometer", "m", ("height",)),
        Sensor("gnss_vel", "GNSS velocity", "m/s", EARTH),
        Sensor("gnss_pos", "GNSS position", "m", EARTH),
    )
}


@dataclass(frozen=True)
class SensorSeries:
    """Samples of one sensor.

    Attributes
    ----------
    sensor : which
    topic : PX4 topic that they are from
    time : (N,) int64, µs since boot, ascending
    values : (N, axes), unit of the sensor; gyro, accelerometer and magnetometer in the body frame (FRD)
    step_s : usual time between samples, s
    averaged_s : over which a sample is a mean, s; 0 where it is one reading, or that is not known
    device_id : PX4's; 0 where the log does not tell
    """

    sensor: Sensor
    topic: str
    time: npt.NDArray[np.int64]
    values: Array
    step_s: float
    averaged_s: float
    device_id: int

    @property
    def rate_hz(self) -> float:
        """Usual rate, Hz."""
        return 1.0 / self.step_s

    @property
    def shorter_mean(self) -> float:
        """Root of the share of the sampling interval that a sample is a mean over; 1 where that is all or unknown.

        Of a log that holds one sample of several the noise of a sample is that of a shorter mean, larger by the root of
        how much shorter it is: times this, white noise has the density of the sensor.
        """
        share = self.averaged_s / self.step_s
        return float(np.sqrt(share)) if 0.0 < share < WHOLE else 1.0

    def pieces(self, intervals: Iterable[Interval], shortest_s: float) -> list[Array]:
        """Values without a gap inside the intervals (µs), each (n, axes) and not shorter than `shortest_s`."""
        found = []
        for start, stop in intervals:
            first, last = np.searchsorted(self.time, (start, stop))
            breaks = np.flatnonzero(np.diff(self.time[first:last]) > GAP_STEPS * self.step_s * 1e6) + 1 + first
            edges = [int(first), *breaks.tolist(), int(last)]
            found += [
                self.values[begin:end] for begin, end in pairwise(edges) if (end - begin) * self.step_s >= shortest_s
            ]
        return found

    def inside(self, intervals: Iterable[Interval]) -> npt.NDArray[np.bool_]:
        """(N,) which samples lie in the intervals, µs."""
        return inside(self.time, intervals)


def sensor_series(flight: Flight) -> dict[SensorName, SensorSeries]:
    """Samples of each sensor of a canonical flight; sensors with fewer than fifty are left out."""
    found: dict[SensorName, SensorSeries | None] = {
        "gyro": _inertial(flight, "gyro", "gyro_rad", "sensor_gyro", "delta_angle"),
        "accel": _inertial(flight, "accel", "accelerometer_m_s2", "sensor_accel", "delta_velocity"),
        "mag": _magnetometer(flight),
        "baro": _barometer(flight),
        "gnss_vel": _gnss_velocity(flight),
        "gnss_pos": _gnss_position(flight),
    }
    return {name: one for name, one in found.items() if one is not None}


def _series(
    name: SensorName, topic: str, time: np.ndarray, values: Array, averaged_s: float = 0.0, device_id: int = 0
) -> SensorSeries | None:
    if len(time) < FEWEST_SAMPLES:
        return None
    values = values.reshape(len(values), -1)
    kept = np.isfinite(values).all(axis=1)
    time, values = np.asarray(time, np.int64)[kept], values[kept]
    # a clock that goes back is for the verdict to tell; here what comes after a later time is passed over
    kept = time > np.maximum.accumulate(np.concatenate([[-1], time]))[:-1]
    time, values = time[kept], values[kept]
    if len(time) < FEWEST_SAMPLES:
        return None
    step_s = _usual_step_s(time)
    together = int(1.0 / (step_s * MOST_IMU_HZ) + 0.1)
    if together > 1:
        rows = len(time) // together * together
        values = values[:rows].reshape(-1, together, values.shape[1]).mean(axis=1)
        time, step_s = time[together - 1 : rows : together], step_s * together
        averaged_s = step_s
    return SensorSeries(SENSORS[name], topic, time, values, step_s, averaged_s, device_id)


def _usual_step_s(time: npt.NDArray[np.int64]) -> float:
    """Mean of the steps that are none of a gap: time stamps jitter by more than the interval is uncertain."""
    steps = np.diff(time)
    return float(steps[steps <= GAP_STEPS * np.median(steps)].mean()) * 1e-6


def _inertial(flight: Flight, name: SensorName, combined: str, driver: str, increment: str) -> SensorSeries | None:
    """The fullest of FIFO, `sensor_combined` (of `vehicle_imu` where that is logged in full) and the driver's topic.

    FIFO and driver topics hold what the sensor gave before calibration: good for noise, for biases not.
    """
    device_id = _imu_device(flight, name)
    table = flight.topic("sensor_combined")
    best = None
    if table is not None and row_count(table) >= FEWEST_SAMPLES:
        prefix = "gyro" if name == "gyro" else "accelerometer"
        integrated = (
            float(np.median(table[f"{prefix}_integral_dt"])) * 1e-6 if f"{prefix}_integral_dt" in table else 0.0
        )
        time = np.asarray(table["timestamp"], np.int64)
        best = _series(name, "sensor_combined", time, stacked(table, combined), integrated, device_id)
    for other in (
        _of_increments(flight, name, increment, device_id),
        _of_driver(flight, name, driver, device_id),
        _of_fifo(flight, name, f"{driver}_fifo", device_id),
    ):
        if other is not None and (best is None or len(other.time) >= FULLER * len(best.time)):
            best = other
    return best


def _of_increments(flight: Flight, name: SensorName, increment: str, device_id: int) -> SensorSeries | None:
    """Delta angles or velocities over their time, where `sensor_combined` is missing or thinned."""
    table = _of_device(flight, "vehicle_imu", "gyro_device_id" if name == "gyro" else "accel_device_id", device_id)
    if table is None or not field_names(table, increment):
        return None
    interval_s = np.maximum(np.asarray(table[f"{increment}_dt"], np.float64), 1.0) * 1e-6
    values = stacked(table, increment) / interval_s[:, None]
    time = table["timestamp_sample"] if "timestamp_sample" in table else table["timestamp"]
    return _series(name, "vehicle_imu", time, values, float(np.median(interval_s)), device_id)


def _of_driver(flight: Flight, name: SensorName, topic: str, device_id: int) -> SensorSeries | None:
    table = _of_device(flight, topic, "device_id", device_id)
    if table is None or any(axis not in table for axis in BODY):
        return None
    values = np.column_stack([np.asarray(table[axis], np.float64) for axis in BODY])
    time = table["timestamp_sample"] if "timestamp_sample" in table else table["timestamp"]
    return _series(name, topic, time, values, 0.0, device_id)


def _of_fifo(flight: Flight, name: SensorName, topic: str, device_id: int) -> SensorSeries | None:
    """Readings of the sensor's FIFO: `samples` of a message are valid, `dt` µs apart, the last at its sample time."""
    table = _of_device(flight, topic, "device_id", device_id)
    if table is None or not row_count(table) or not field_names(table, "x") or "samples" not in table:
        return None
    readings = np.stack([stacked(table, axis) for axis in BODY], axis=2) * np.asarray(table["scale"])[:, None, None]
    place = np.arange(readings.shape[1])
    valid = place < np.asarray(table["samples"], np.int64)[:, None]
    end = np.asarray(table.get("timestamp_sample", table["timestamp"]), np.float64)
    behind = (np.asarray(table["samples"], np.float64) - 1.0)[:, None] - place
    time = np.round(end[:, None] - behind * np.asarray(table["dt"], np.float64)[:, None])
    return _series(name, topic, time[valid].astype(np.int64), readings[valid], 0.0, device_id)


def _of_device(flight: Flight, topic: str, field: str, device_id: int) -> TopicTable | None:
    """The instance of a topic that a device has; the first where the device is not known or has none."""
    tables = [flight.topics[topic, instance] for instance in flight.instances(topic)]
    return next((one for one in tables if device_id and _usual(one, field) == device_id), tables[0] if tables else None)


def _imu_device(flight: Flight, name: SensorName) -> int:
    """Device that the vehicle had selected; else that of the first `vehicle_imu`; 0 where neither is logged."""
    field = "gyro_device_id" if name == "gyro" else "accel_device_id"
    for topic in ("sensor_selection", "estimator_status", "vehicle_imu"):
        table = flight.topic(topic)
        if table is not None and _usual(table, field):
            return _usual(table, field)
    return 0


def _usual(table: TopicTable, field: str) -> int:
    """Value that a column has most often; 0 where the table lacks it or is empty."""
    if field not in table or not row_count(table):
        return 0
    values, counts = np.unique(np.asarray(table[field], np.int64), return_counts=True)
    return int(values[np.argmax(counts)])


def _magnetometer(flight: Flight) -> SensorSeries | None:
    table = flight.topic("vehicle_magnetometer")
    if table is None:
        return None
    time = measurement_time("vehicle_magnetometer", table)
    values = stacked(table, "magnetometer_ga")
    return _series("mag", "vehicle_magnetometer", time, values, 0.0, _usual(table, "device_id"))


def _barometer(flight: Flight) -> SensorSeries | None:
    table = flight.topic("vehicle_air_data")
    if table is None:
        return None
    time = measurement_time("vehicle_air_data", table)
    values = np.asarray(table["baro_alt_meter"], np.float64)
    return _series("baro", "vehicle_air_data", time, values, 0.0, _usual(table, "baro_device_id"))


def _gnss_velocity(flight: Flight) -> SensorSeries | None:
    fixed = _fixed_gnss(flight)
    if fixed is None or any(f"vel_{axis}_m_s" not in fixed for axis in "ned"):
        return None
    values = np.column_stack([np.asarray(fixed[f"vel_{axis}_m_s"], np.float64) for axis in "ned"])
    time = measurement_time("vehicle_gps_position", fixed)
    return _series("gnss_vel", "vehicle_gps_position", time, values, 0.0, _usual(fixed, "device_id"))


def _gnss_position(flight: Flight) -> SensorSeries | None:
    """North, east and down from the median position, m, on a sphere: what counts here are metres about a place."""
    fixed = _fixed_gnss(flight)
    if fixed is None or any(one not in fixed for one in ("latitude_deg", "longitude_deg", "altitude_msl_m")):
        return None
    latitude, longitude, altitude = (
        np.asarray(fixed[name], np.float64) for name in ("latitude_deg", "longitude_deg", "altitude_msl_m")
    )
    if not len(latitude):
        return None
    centre = np.median(latitude), np.median(longitude), np.median(altitude)
    north = (latitude - centre[0]) * METRES_PER_DEGREE
    east = (longitude - centre[1]) * METRES_PER_DEGREE * np.cos(np.radians(centre[0]))
    values = np.column_stack([north, east, centre[2] - altitude])
    time = measurement_time("vehicle_gps_position", fixed)
    return _series("gnss_pos", "vehicle_gps_position", time, values, 0.0, _usual(fixed, "device_id"))


def _fixed_gnss(flight: Flight) -> TopicTable | None:
    """GNSS messages with a 3D fix."""
    table = flight.topic("vehicle_gps_position")
    if table is None or "fix_type" not in table:
        return table
    kept = np.asarray(table["fix_type"]) >= _FIX_3D
    return {name: values[kept] for name, values in table.items()}
