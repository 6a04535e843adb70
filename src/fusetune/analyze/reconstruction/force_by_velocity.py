"""How the vehicle accelerated while IMU rows are missing, as the logged velocity tells."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.reconstruction.attitude import attitude_history, to_body, to_earth
from fusetune.analyze.reconstruction.gap_surplus import MIN_INTERVALS, surplus_rate
from fusetune.analyze.reconstruction.trial_gaps import try_gaps, variance_per_second
from fusetune.px4.flight import TopicTable, row_count, stacked

MAX_INTERVAL_US = 250_000
GRAVITY_M_S2 = 9.80665
RESETS = ("vxy_reset_counter", "vz_reset_counter")


def correct_force(
    table: TopicTable, present: np.ndarray, attitude: TopicTable | None, local_position: TopicTable | None
) -> TopicTable:
    """Correct the specific force of filled rows so that the velocity gained over each gap is the logged one.

    Parameters
    ----------
    table : `sensor_combined`, its gaps filled
    present : for each row whether it was measured
    attitude, local_position : `vehicle_attitude` and `vehicle_local_position`; without one of them the table is
        returned as it is
    """
    if attitude is None or local_position is None or present.all():
        return table
    history = attitude_history(attitude, table)
    time = table["timestamp"].astype(np.int64)
    logged_time, velocity, usable = _logged(local_position, time)
    if len(logged_time) < MIN_INTERVALS or not len(history.time):
        return table
    window = table["accelerometer_integral_dt"].astype(np.int64)
    gained = to_earth(history.q, stacked(table, "accelerometer_m_s2"))
    gained[:, 2] += GRAVITY_M_S2
    integral = np.vstack([np.zeros(3), np.cumsum(gained * (window * 1e-6)[:, None], axis=0)])
    grid = np.concatenate([[time[0] - window[0]], time])
    at_logged = np.stack([np.interp(logged_time, grid, integral[:, axis]) for axis in range(3)], axis=1)
    difference = np.diff(velocity, axis=0) - np.diff(at_logged, axis=0)
    row = np.searchsorted(time, logged_time)
    known = history.known[np.clip(row, 0, len(time) - 1)]
    usable &= known[:-1] & known[1:]
    trials = try_gaps(table, present, "accelerometer_m_s2", "accelerometer_integral_dt")
    variance = variance_per_second(trials, to_earth(history.q[trials.row], trials.error))
    if variance is None:
        return table
    rate = surplus_rate(difference, logged_time, usable, (time - window, time), ~present, variance)
    if rate is None:
        return table
    force = to_body(history.q, rate)
    corrected = dict(table)
    for axis in range(3):
        name = f"accelerometer_m_s2[{axis}]"
        corrected[name] = np.where(present, table[name], table[name] + force[:, axis]).astype(table[name].dtype)
    return corrected


def _logged(local_position: TopicTable, imu_time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (K,) and velocities (K, 3) NED of the log, and which of the K - 1 intervals are free of resets."""
    sampled = local_position.get("timestamp_sample", local_position["timestamp"]).astype(np.int64)
    velocity = np.stack([local_position[name].astype(np.float64) for name in ("vx", "vy", "vz")], axis=1)
    counters = np.stack(
        [local_position.get(name, np.zeros(row_count(local_position))).astype(np.int64) for name in RESETS], axis=1
    )
    inside = (sampled >= imu_time[0]) & (sampled <= imu_time[-1]) & np.isfinite(velocity).all(axis=1)
    rows = np.flatnonzero(inside)[np.unique(sampled[inside], return_index=True)[1]]
    time, velocity, counters = sampled[rows], velocity[rows], counters[rows]
    unreset = (np.diff(counters, axis=0) == 0).all(axis=1)
    return time, velocity, unreset & (np.diff(time) <= MAX_INTERVAL_US)
