"""Attitude whose heading the gyros alone turn: a magnetometer must not be judged by a heading that follows it.

The tilt is the replay's. All that fusion did to the heading is taken out, so it is off by what it began with, and drifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.attitude import interpolate_quaternion
from fusetune.analyze.replaying.replayed_set import ReplayedSteps
from fusetune.quaternions import conjugate, from_rotation_vector, multiply, rotation_matrix, rotation_vector

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GyroHeading:
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


def gyro_heading(steps: ReplayedSteps) -> GyroHeading:
    """Take the corrections of the heading out of a replay's attitude."""
    rotation = steps.delta_angle[1:] - steps.gyro_bias.mean(axis=0) * steps.delta_angle_dt[1:, None]
    q = steps.quaternion
    added = rotation_vector(multiply(q[1:], conjugate(multiply(q[:-1], from_rotation_vector(rotation)))))[:, 2]
    corrected = np.concatenate([[0.0], np.cumsum(added)])
    back = from_rotation_vector(np.column_stack([np.zeros((corrected.size, 2)), -corrected]))
    turned = np.einsum("kj,kj->k", rotation_matrix(q[:-1])[:, 2], rotation)
    return GyroHeading(steps.time, multiply(back, q), np.concatenate([[0.0], np.cumsum(turned)]))
