"""Attitude of the vehicle at any time: the logged attitude, and the gyro between its samples.

`vehicle_attitude` is logged some 20 times a second, too seldom to say how a quadrotor turned in between; the gyro
says that, but drifts. So the gyro carries the attitude on from each logged sample, and the small rotation by which it
misses the next one is spread evenly over the interval.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import TopicTable, row_count, stacked
from fusetune.quaternions import conjugate, from_rotation_vector, multiply, normalised, rotation_vector

MAX_INTERVAL_US = 1_000_000
"""Over a longer pause of the logged attitude nothing is interpolated."""

MAX_PUBLISH_DELAY_US = 20_000

DRIFT_WINDOW_S = 20.0
"""Time over which the gyro's drift is taken to be constant."""

ROWS_AT_ONCE = 1 << 15

MIN_COVERED = 0.9
"""With a smaller share of an interval covered by IMU rows the gyro does not tell how the vehicle turned in it."""


@dataclass(frozen=True)
class AttitudeHistory:
    """Attitude at the times of the IMU samples.

    Attributes
    ----------
    time : (N,) µs, ascending
    q : (N, 4) unit quaternions w, x, y, z, body to NED
    known : (N,) whether the logged attitude covers the time
    """

    time: np.ndarray
    q: np.ndarray
    known: np.ndarray

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Attitude (M, 4) at times (M,) µs, and whether it is known."""
        if len(self.time) < 2:
            return np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1)), np.zeros(len(time), np.bool_)
        right = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        known = self.known[right - 1] & self.known[right] & (time >= self.time[0]) & (time <= self.time[-1])
        return attitude_at(self.time, self.q, time), known


def attitude_history(attitude: TopicTable | None, imu: TopicTable) -> AttitudeHistory:
    """Join `vehicle_attitude` and `sensor_combined`.

    Parameters
    ----------
    attitude : `vehicle_attitude`; None where the log has none
    imu : canonical `sensor_combined`, its gaps filled
    """
    time = imu["timestamp"].astype(np.int64)
    nothing = AttitudeHistory(np.zeros(0, np.int64), np.zeros((0, 4)), np.zeros(0, np.bool_))
    if attitude is None or len(time) < 2:
        return nothing
    logged_time, logged = logged_attitude(attitude, time)
    if len(logged_time) < 2:
        return nothing
    q = integrated_gyro(imu)
    # rotation that takes the integrated gyro's frame into NED, at each logged attitude
    frame = multiply(logged, conjugate(attitude_at(time, q, logged_time)))
    known = np.zeros(len(time), np.bool_)
    for rows in blocks(len(time)):
        right = np.clip(np.searchsorted(logged_time, time[rows]), 1, len(logged_time) - 1)
        left = right - 1
        interval = logged_time[right] - logged_time[left]
        share = (time[rows] - logged_time[left]) / np.maximum(interval, 1)
        known[rows] = (share >= 0.0) & (share <= 1.0) & (interval <= MAX_INTERVAL_US)
        drift = rotation_vector(multiply(frame[right], conjugate(frame[left])))
        here = multiply(from_rotation_vector(drift * np.clip(share, 0.0, 1.0)[:, None]), frame[left])
        q[rows] = normalised(multiply(here, q[rows]))
    return AttitudeHistory(time, q, known)


def steady_history(attitude: TopicTable | None, imu: TopicTable) -> AttitudeHistory:
    """Attitude in a frame that does not follow the filter's corrections: that of the gyro, less its drift.

    The filter's heading is corrected and reset in flight, while the earth's field stays where it is. The gyro tells how
    the vehicle turned since some seconds ago much better than two such headings. Its drift is the median rate by which
    the logged attitude turns otherwise, over `DRIFT_WINDOW_S`. Over rows that are missing the logged attitude is
    followed. The frame turns slowly against north, by what the drift is wrong.

    Parameters
    ----------
    attitude, imu : as for `attitude_history`
    """
    # Imported here: it takes a fifth of a second to load, and few logs need it.
    from scipy.ndimage import median_filter

    history = attitude_history(attitude, imu)
    if attitude is None or not len(history.time):
        return history
    time, window = history.time, imu["gyro_integral_dt"].astype(np.float64)
    logged_time, logged = logged_attitude(attitude, time)
    turned = attitude_at(time, integrated_gyro(imu), logged_time)
    length = np.diff(logged_time).astype(np.float64)
    steps, turned_steps = (multiply(conjugate(q[:-1]), q[1:]) for q in (logged, turned))
    rate = rotation_vector(multiply(conjugate(turned_steps), steps)) / length[:, None]
    per_window = max(int(DRIFT_WINDOW_S * 1e6 / float(np.median(length))), 1)
    drift = median_filter(rate, size=(per_window, 1), mode="nearest")
    covered = np.diff(np.interp(logged_time, time, np.cumsum(window)))
    follow = (covered < MIN_COVERED * length) | (length > MAX_INTERVAL_US)
    drift[follow] = rate[follow] * (length / np.maximum(covered, 1.0))[follow, None]
    interval = np.clip(np.searchsorted(logged_time, time) - 1, 0, len(length) - 1)
    steady = dict(imu)
    for axis in range(3):
        steady[f"gyro_rad[{axis}]"] = imu[f"gyro_rad[{axis}]"] + drift[interval, axis] * 1e6
    q = integrated_gyro(steady)
    start = int(np.searchsorted(time, logged_time[0]))
    frame = multiply(logged[0], conjugate(q[start]))
    for rows in blocks(len(q)):
        q[rows] = multiply(np.broadcast_to(frame, q[rows].shape), q[rows])
    return AttitudeHistory(time, q, history.known)


def logged_attitude(attitude: TopicTable, imu_time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of the IMU samples that the logged attitudes belong to, ascending, and the attitudes (K, 4).

    Releases that log no sample time publish the attitude right after the IMU sample, so it belongs to the last one.
    """
    time = attitude["timestamp"].astype(np.int64)
    sampled = attitude.get("timestamp_sample", np.zeros_like(time)).astype(np.int64)
    last = imu_time[np.clip(np.searchsorted(imu_time, time, side="right") - 1, 0, len(imu_time) - 1)]
    time = np.where(sampled > 0, sampled, np.where(time - last < MAX_PUBLISH_DELAY_US, last, time))
    q = stacked(attitude, "q")
    norm = np.linalg.norm(q, axis=1)
    good = np.isfinite(norm) & (np.abs(norm - 1.0) < 0.1)
    good &= (time >= imu_time[0]) & (time <= imu_time[-1])
    time, q = time[good], q[good] / norm[good, None]
    order = np.unique(time, return_index=True)[1]
    return time[order], q[order]


def integrated_gyro(imu: TopicTable) -> np.ndarray:
    """Rotation (N, 4) from before the first row to the end of each."""
    turned = np.zeros((row_count(imu), 4))
    for rows in blocks(len(turned)):
        part = {name: values[rows] for name, values in imu.items()}
        dt_s = part["gyro_integral_dt"].astype(np.float64) * 1e-6
        turned[rows] = from_rotation_vector(stacked(part, "gyro_rad") * dt_s[:, None])
    reach = 1
    # each pass doubles the number of steps that a product covers (Hillis and Steele, 1986); from the end on, so that
    # what is multiplied is still that of the pass before
    while reach < len(turned):
        for rows in reversed(list(blocks(len(turned) - reach))):
            later = slice(rows.start + reach, rows.stop + reach)
            turned[later] = multiply(turned[rows], turned[later])
        reach *= 2
    for rows in blocks(len(turned)):
        turned[rows] = normalised(turned[rows])
    return turned


def attitude_at(time: np.ndarray, q: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Attitudes (M, 4) at the times `wanted`, turning evenly between those (N, 4) given at `time` (µs, ascending)."""
    found = np.zeros((len(wanted), 4))
    for rows in blocks(len(wanted)):
        right = np.clip(np.searchsorted(time, wanted[rows]), 1, len(time) - 1)
        left = right - 1
        share = np.clip((wanted[rows] - time[left]) / np.maximum(time[right] - time[left], 1), 0.0, 1.0)
        step = rotation_vector(multiply(conjugate(q[left]), q[right]))
        found[rows] = multiply(q[left], from_rotation_vector(step * share[:, None]))
    return found


def blocks(rows: int) -> Iterator[slice]:
    """Some rows after the other: quaternions take several times their own memory while they are multiplied."""
    for first in range(0, rows, ROWS_AT_ONCE):
        yield slice(first, min(first + ROWS_AT_ONCE, rows))


def to_earth(q: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotate body vectors (N, 3) to NED by the attitudes (N, 4)."""
    turned = np.zeros(vector.shape)
    for rows in blocks(len(vector)):
        axis = q[rows, 1:]
        twice = 2.0 * np.cross(axis, vector[rows])
        turned[rows] = vector[rows] + q[rows, :1] * twice + np.cross(axis, twice)
    return turned


def to_body(q: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotate NED vectors (N, 3) to the body by the attitudes (N, 4)."""
    return to_earth(conjugate(q), vector)
