"""Vibration metrics of the IMUs as a log of any release holds them, as rates.

Each metric is a low-pass of the length of what changed from one IMU interval to the next. Up to v1.12 that is the
increment of angle (rad) and velocity (m/s) over the interval, from v1.13 on rate (rad/s) and acceleration (m/s²); then
coning, too, became another figure under another name. Up to v1.10 `estimator_status.vibe` alone has them, of the IMU
that the estimator used. Source: `msg/vehicle_imu_status.msg`, `msg/estimator_status.msg` and `VehicleIMU.cpp`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import Flight, TopicTable, row_count

_OLD_CONING, _NEW_CONING = "gyro_coning_vibration", "delta_angle_coning_metric"
_VIBE = 3


@dataclass(frozen=True)
class Vibration:
    """Metrics of one IMU, (N,) each; None where they are not logged.

    Attributes
    ----------
    imu : instance of `vehicle_imu_status`; None of the IMU that the estimator used
    time : µs
    accel, gyro : m/s² and rad/s
    coning : rad²; up to v1.12 the product of neighbouring increments, from then on the mean correction
    interval_s : by which increments were divided, s
    """

    imu: int | None
    time: np.ndarray
    accel: np.ndarray | None
    gyro: np.ndarray | None
    coning: np.ndarray | None
    is_old_coning: bool
    was_per_interval: bool
    interval_s: float


def vibrations(flight: Flight) -> list[Vibration]:
    """Of every IMU that the log tells of; empty where it tells of none.

    Parameters
    ----------
    flight : in the layout of its own release
    """
    tables = ((one, flight.topics["vehicle_imu_status", one]) for one in flight.instances("vehicle_imu_status"))
    found = [_of_imu_status(flight, one, table) for one, table in tables if row_count(table)]
    if found:
        return found
    status = flight.topic("estimator_status")
    if status is None or not row_count(status) or any(f"vibe[{axis}]" not in status for axis in range(_VIBE)):
        return []
    interval = _interval_s(flight, None)
    coning, gyro, accel = (status[f"vibe[{axis}]"] for axis in range(_VIBE))
    time = status["timestamp"]
    return [Vibration(None, time, accel / interval, gyro / interval, coning, True, True, interval)]


def _of_imu_status(flight: Flight, instance: int, table: TopicTable) -> Vibration:
    per_interval = _NEW_CONING not in table
    interval = _interval_s(flight, instance)
    accel, gyro = (table.get(f"{kind}_vibration_metric") for kind in ("accel", "gyro"))
    divided = interval if per_interval else 1.0
    return Vibration(
        imu=instance,
        time=table["timestamp"],
        accel=None if accel is None else accel / divided,
        gyro=None if gyro is None else gyro / divided,
        coning=table.get(_OLD_CONING if per_interval else _NEW_CONING),
        is_old_coning=per_interval,
        was_per_interval=per_interval,
        interval_s=interval,
    )


def _interval_s(flight: Flight, instance: int | None) -> float:
    """Median integration interval of an IMU, or of the one in use, s; no number where the log does not tell."""
    own = None if instance is None else flight.topic("vehicle_imu", instance)
    if own is not None and "delta_angle_dt" in own and row_count(own):
        return float(np.median(own["delta_angle_dt"])) * 1e-6
    combined = flight.topic("sensor_combined")
    if combined is None or "gyro_integral_dt" not in combined or not row_count(combined):
        return float("nan")
    interval = combined["gyro_integral_dt"]
    # seconds in releases before v1.7
    return float(np.median(interval)) * (1.0 if interval.dtype.kind == "f" else 1e-6)
