"""How the vehicle moved and what its accelerometers felt, on an even grid: what the tuners of effects share.

The attitude is the replay's, the fast velocity the IMU's alone (`analyze/delays/inertial_motion`), the slow one that of
GNSS; the way and the height are their integral. No other source goes in: an error of the barometer, of the optical flow
or of vision must not hide in what it is compared with. Without GNSS the slow velocity is the replay's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.inertial_motion import InertialMotion, slow_part
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.replaying.replayed_set import ReplayedSteps
from fusetune.analyze.smoothing.smoothed_velocity import NORMAL_QUARTILE, OUTLIER_SIGMAS
from fusetune.ekf2.feed.message_samples import gnss_refusals, gnss_samples, taken
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

EVERY_S = 0.1
VELOCITY_KNOTS_S = 5.0
"""Over so long the IMU alone knows the velocity."""
_FEWEST_FIXES = 20


@dataclass(frozen=True)
class BodyMotion:
    """Means over intervals of `EVERY_S`, stamped at their middles; K rows in order of time, without gaps of the IMU.

    Attributes
    ----------
    time : (K,) µs
    rotation : (K, 3, 3) body → NED
    velocity : (K, 3) of the IMU, NED, m/s
    specific_force : (K, 3) body, m/s², less the mean of the accelerometer bias that the replay found
    body_rate : (K, 3) FRD, rad/s, less the mean of the gyro bias
    height : (K,) above the first row, m; drifts
    by_gnss : whether GNSS velocities bound the drift; otherwise it is the replay's velocity
    fast_time, fast_rotation, fast_velocity, fast_way, fast_rate : (M, …) time, attitude, velocity, the way north, east,
        down, and body rate at every update of the filter: a sensor's lever arm shows in what is faster than the grid
    """

    time: Times
    rotation: Array
    velocity: Array
    specific_force: Array
    body_rate: Array
    height: Array
    by_gnss: bool
    fast_time: Times
    fast_rotation: Array
    fast_velocity: Array
    fast_way: Array
    fast_rate: Array

    @property
    def time_s(self) -> Array:
        """(K,) s since boot."""
        return np.asarray(self.time * 1e-6, np.float64)

    def within(self, intervals: tuple[Interval, ...]) -> npt.NDArray[np.bool_]:
        """Rows that lie in intervals, µs."""
        return inside(self.time, intervals)

    def at(self, time: Times, values: Array) -> Array:
        """Values (K, …) of the motion at other times (N,), µs → (N, …); the ends hold outside."""
        return _interpolated(time, self.time, values)

    def rotation_at(self, time: Times) -> Array:
        """(N, 3, 3) body → NED at times (N,), µs."""
        return _interpolated(time, self.fast_time, self.fast_rotation)

    def velocity_at(self, time: Times) -> Array:
        """(N, 3) NED, m/s, at times (N,), µs."""
        return _interpolated(time, self.fast_time, self.fast_velocity)

    def way_at(self, time: Times) -> Array:
        """(N, 3) travelled north, east and down from the first row, m, at times (N,), µs; drifts."""
        return _interpolated(time, self.fast_time, self.fast_way)

    def rate_at(self, time: Times) -> Array:
        """(N, 3) body rate, rad/s, at times (N,), µs."""
        return _interpolated(time, self.fast_time, self.fast_rate)

    def covers(self, time: Times) -> npt.NDArray[np.bool_]:
        """Times (N,), µs, at which it is known."""
        return np.asarray((time >= self.time[0]) & (time <= self.time[-1]))


def body_motion(
    steps: ReplayedSteps, motion: InertialMotion, flight: Flight, parameters: Mapping[str, float]
) -> BodyMotion:
    """Put a replay's motion on the grid.

    Parameters
    ----------
    steps : of the replay; those between the first and last row of `motion` are used
    flight : canonical; its GNSS velocities bound the height
    """
    first, last = np.searchsorted(steps.time, (motion.time[0], motion.time[-1] + 1))
    steps = steps.rows(slice(int(first), int(last)))
    place = ((steps.time - steps.time[0]) // round(EVERY_S * 1e6)).astype(np.int64)
    _, begin = np.unique(place, return_index=True)
    count = np.diff(np.append(begin, place.size))

    def mean(values: Array) -> Array:
        flat = values.reshape(values.shape[0], -1)
        return np.asarray(np.add.reduceat(flat, begin, axis=0) / count[:, None]).reshape(-1, *values.shape[1:])

    def of_imu(values: Array, seconds: Array, bias: Array) -> Array:
        summed = np.add.reduceat(values, begin, axis=0) / np.add.reduceat(seconds, begin)[:, None]
        return np.asarray(summed - bias.mean(axis=0))

    # an interval of the IMU ends at its step: its middle is half a step earlier
    half_us = 0.5 * float(np.median(np.diff(steps.time)))
    since: Array = np.asarray(steps.time[:, None] - steps.time[0], np.float64)
    time = np.rint(mean(since)[:, 0] + steps.time[0] - half_us).astype(np.int64)
    fast, by_gnss = _bounded_velocity(motion, flight, parameters)
    moved = 0.5 * (fast[1:] + fast[:-1]) * np.diff(motion.time)[:, None] * 1e-6
    way = np.vstack([np.zeros(3), np.cumsum(moved, axis=0)])
    return BodyMotion(
        time=time,
        rotation=mean(motion.rotation),
        velocity=_interpolated(time, motion.time, fast),
        specific_force=of_imu(steps.delta_velocity, steps.delta_velocity_dt, steps.accel_bias),
        body_rate=of_imu(steps.delta_angle, steps.delta_angle_dt, steps.gyro_bias),
        height=-np.interp(time, motion.time, way[:, 2]),
        by_gnss=by_gnss,
        fast_time=motion.time,
        fast_rotation=motion.rotation,
        fast_velocity=fast,
        fast_way=way,
        fast_rate=motion.body_rate - steps.gyro_bias.mean(axis=0),
    )


def _interpolated(time: Times, known: Times, values: Array) -> Array:
    flat = values.reshape(values.shape[0], -1)
    found = np.column_stack([np.interp(time, known, column) for column in flat.T])
    return found.reshape(time.size, *values.shape[1:])


def _bounded_velocity(motion: InertialMotion, flight: Flight, parameters: Mapping[str, float]) -> tuple[Array, bool]:
    """(M, 3) NED, m/s: fast part of the IMU, slow part of GNSS or, where there is too little of it, of the replay.

    The replay follows every source that is fused, a wrong one, too; so nothing can be judged by it where GNSS is there.
    """
    table = flight.topic("vehicle_gps_position")
    if table is None:
        return motion.bounded_velocity, False
    samples = gnss_samples(table)
    time = samples["time_us"] - round(1e3 * parameters.get("EKF2_GPS_DELAY", 0.0))
    usable = taken(table, gnss_refusals(table, flight.release)) & (samples["fix_type"] >= 3)
    usable &= np.isfinite(samples["vel"]).all(axis=1) & (time >= motion.time[0]) & (time <= motion.time[-1])
    if np.count_nonzero(usable) < _FEWEST_FIXES:
        return motion.bounded_velocity, False
    time = time[usable]
    # the receiver tells the velocity of its antenna, which sweeps around the IMU as the vehicle turns
    arm = np.array(
        [parameters.get(f"EKF2_GPS_POS_{one}", 0.0) - parameters.get(f"EKF2_IMU_POS_{one}", 0.0) for one in "XYZ"]
    )
    off = _interpolated(time, motion.time, motion.velocity + motion.swept @ arm) - samples["vel"][usable]
    drift = slow_part(time, off, VELOCITY_KNOTS_S)
    # once more without what lies far off: a glitch must not bend the reference
    left = np.abs(off - drift)
    near = (left <= OUTLIER_SIGMAS * np.median(left, axis=0) / NORMAL_QUARTILE).all(axis=1)
    if _FEWEST_FIXES <= np.count_nonzero(near) < near.size:
        time = time[near]
        drift = slow_part(time, off[near], VELOCITY_KNOTS_S)
    return motion.velocity - _interpolated(motion.time, time, drift), True
