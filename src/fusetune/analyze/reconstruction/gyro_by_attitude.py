"""How the vehicle turned while IMU rows are missing, as the logged attitude tells.

The vehicle's own attitude is integrated from every IMU sample, those that the log lacks among them.
"""

from __future__ import annotations

import numpy as np

from fusetune.analyze.reconstruction.attitude import attitude_at, integrated_gyro, logged_attitude
from fusetune.analyze.reconstruction.gap_surplus import MIN_INTERVALS, surplus_rate
from fusetune.analyze.reconstruction.trial_gaps import try_gaps, variance_per_second
from fusetune.px4.flight import TopicTable
from fusetune.quaternions import conjugate, multiply, rotation_vector

MAX_INTERVAL_US = 250_000


def correct_gyro(table: TopicTable, present: np.ndarray, attitude: TopicTable | None) -> TopicTable:
    """Correct the rates of filled rows so that the rotation over each gap is that of the logged attitude.

    Parameters
    ----------
    table : `sensor_combined`, its gaps filled
    present : for each row whether it was measured
    attitude : `vehicle_attitude`; without one the table is returned as it is
    """
    if attitude is None or present.all():
        return table
    time = table["timestamp"].astype(np.int64)
    logged_time, logged = logged_attitude(attitude, time)
    if len(logged_time) < MIN_INTERVALS:
        return table
    turned = attitude_at(time, integrated_gyro(table), logged_time)
    difference = rotation_vector(multiply(conjugate(_steps(turned)), _steps(logged)))
    usable = (np.diff(logged_time) <= MAX_INTERVAL_US) & ~_has_reset(attitude, logged_time)
    start = time - table["gyro_integral_dt"].astype(np.int64)
    trials = try_gaps(table, present, "gyro_rad", "gyro_integral_dt")
    variance = variance_per_second(trials, trials.error)
    if variance is None:
        return table
    rate = surplus_rate(difference, logged_time, usable, (start, time), ~present, variance)
    if rate is None:
        return table
    corrected = dict(table)
    for axis in range(3):
        name = f"gyro_rad[{axis}]"
        corrected[name] = (table[name] + rate[:, axis]).astype(table[name].dtype)
    return corrected


def _has_reset(attitude: TopicTable, logged_time: np.ndarray) -> np.ndarray:
    """Whether the filter reset its attitude in an interval; releases without the counter do not tell."""
    counter = attitude.get("quat_reset_counter")
    if counter is None:
        return np.zeros(len(logged_time) - 1, np.bool_)
    published = attitude["timestamp"].astype(np.int64)
    at = counter[np.clip(np.searchsorted(published, logged_time), 0, len(counter) - 1)].astype(np.int64)
    return np.diff(at) != 0


def _steps(q: np.ndarray) -> np.ndarray:
    """Rotation from each attitude to the next, in the body frame."""
    return multiply(conjugate(q[:-1]), q[1:])
