"""Attitude that the gyros alone turn: a magnetometer must not be judged by an attitude that follows it.

All that fusion did is taken out of the replay's attitude, of the heading all of it, of the tilt all but a straight
line: the one that fits while the vehicle manoeuvred, when GNSS tells tilt and accelerometer bias apart. On the ground
the replay's tilt is off by the bias of the accelerometer, and comes right after take-off, just when the motors begin to
draw; here it does not. What is left is a heading that is off by what it began with, and drifts of the gyros.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.attitude import interpolate_quaternion
from fusetune.analyze.replaying.replayed_set import ReplayedSteps
from fusetune.quaternions import conjugate, from_rotation_vector, multiply, rotation_matrix, rotation_vector

Array = npt.NDArray[np.float64]

SETTLED_AFTER_S = 15.0
"""In the air, before the tilt counts."""


@dataclass(frozen=True)
class GyroAttitude:
    """Attitude at K updates.

    Attributes
    ----------
    time : (K,) µs
    quaternion : (K, 4) body → NED but for the heading
    turned : (K,) how far the gyros turned the heading since the first row, rad
    """

    time: npt.NDArray[np.int64]
    quaternion: Array
    turned: Array

    def rotation_at(self, time: npt.NDArray[np.int64]) -> Array:
        """(N, 3, 3) at times (N,), µs."""
        return np.asarray(rotation_matrix(interpolate_quaternion(self.time, self.quaternion, time)))

    def turned_at(self, time: npt.NDArray[np.int64]) -> Array:
        """(N,) rad, of `turned`."""
        return np.asarray(np.interp(time, self.time, self.turned))


def gyro_attitude(steps: ReplayedSteps, airborne: Sequence[Interval]) -> GyroAttitude:
    """Take the corrections out of a replay's attitude.

    Parameters
    ----------
    airborne : when the vehicle flew, µs
    """
    rotation = steps.delta_angle[1:] - steps.gyro_bias.mean(axis=0) * steps.delta_angle_dt[1:, None]
    q = steps.quaternion
    added = rotation_vector(multiply(q[1:], conjugate(multiply(q[:-1], from_rotation_vector(rotation)))))
    corrected = np.vstack([np.zeros(3), np.cumsum(added, axis=0)])
    settled = [(start + round(SETTLED_AFTER_S * 1e6), stop) for start, stop in airborne]
    rows = inside(steps.time, settled)
    if np.count_nonzero(rows) < 2:
        rows = np.ones(steps.time.size, bool)
    since_s = (steps.time - steps.time[0]) * 1e-6
    line = np.column_stack([np.ones(since_s.size), since_s])
    tilt = line @ np.linalg.lstsq(line[rows], corrected[rows, :2], rcond=None)[0]
    heading = from_rotation_vector(np.column_stack([np.zeros((since_s.size, 2)), -corrected[:, 2]]))
    level = from_rotation_vector(np.column_stack([tilt - corrected[:, :2], np.zeros(since_s.size)]))
    turned = np.einsum("kj,kj->k", rotation_matrix(q[:-1])[:, 2], rotation)
    return GyroAttitude(steps.time, multiply(heading, multiply(level, q)), np.concatenate([[0.0], np.cumsum(turned)]))
