"""The motion of the vehicle as its IMU alone tells it: no measurement of another sensor goes into its fast part.

A filter that is told a wrong delay follows the late measurements, in its velocity and in its tilt, so its own velocity
hides a part of the error. What the IMU integrates does not. The attitude that this takes is the filter's; whatever of
its corrections is faster than some seconds is taken out again, so that the gyros alone turn it there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.replayed_set import FilterStates
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.px4.flight import TopicTable, stacked
from fusetune.quaternions import conjugate, from_rotation_vector, multiply, rotation_matrix, rotation_vector

Array = npt.NDArray[np.float64]

ATTITUDE_KNOTS_S = 8.0
"""Corrections of the attitude slower than this stay: they are what holds it level."""
VELOCITY_KNOTS_S = 5.0
_LEAST_UPDATES = 100


@dataclass(frozen=True)
class InertialMotion:
    """Motion at every update of the filter; M rows in order of time.

    Attributes
    ----------
    time : (M,) µs
    velocity : (M, 3) NED, m/s, integrated from the IMU from the first row on; drifts
    bounded_velocity : (M, 3) NED, m/s, the same with the slow part of the filter's velocity
    rotation : (M, 3, 3) body → NED
    body_rate : (M, 3) rad/s, FRD
    """

    time: npt.NDArray[np.int64]
    velocity: Array
    bounded_velocity: Array
    rotation: Array
    body_rate: Array

    @property
    def travelled(self) -> Array:
        """(M, 3) integral of `velocity` (trapezoids), NED m."""
        step = np.diff(self.time)[:, None] * 1e-6
        way = np.cumsum(0.5 * (self.velocity[1:] + self.velocity[:-1]) * step, axis=0)
        return np.vstack([np.zeros(3), way])

    @property
    def swept(self) -> Array:
        """(M, 3, 3) velocity, NED m/s, of a point one metre along each axis of the body, by the body's turning."""
        across = np.cross(self.body_rate[:, None, :], np.eye(3)).swapaxes(1, 2)
        return np.asarray(self.rotation @ across)


def inertial_motion(imu: TopicTable, states: FilterStates) -> InertialMotion | None:
    """Integrate `sensor_combined` with the attitude of a replay; None where the two hardly overlap."""
    stamp = imu["timestamp"].astype(np.int64)
    inside = (states.time > stamp[0]) & (states.time <= stamp[-1]) if stamp.size else np.zeros(states.time.size, bool)
    if np.count_nonzero(inside) < _LEAST_UPDATES:
        return None
    time, q, filtered = states.time[inside], states.quaternion[inside], states.velocity[inside]
    # of an hour each of these, and each step in between, is tens of megabytes
    del states
    turned = _over(stamp, stacked(imu, "gyro_rad"), time)
    step_s = np.diff(time)[:, None] * 1e-6
    q = multiply(from_rotation_vector(-_fast_corrections(time, q, turned)), q)
    half_way = rotation_matrix(multiply(q[:-1], from_rotation_vector(0.5 * turned)))
    pushed = _over(stamp, stacked(imu, "accelerometer_m_s2"), time)
    gained = np.einsum("nij,nj->ni", half_way, pushed) + np.array([0.0, 0.0, ONE_G]) * step_s
    del half_way, pushed
    velocity = np.vstack([np.zeros(3), np.cumsum(gained, axis=0)])
    bounded = velocity - slow_part(time, velocity - filtered, VELOCITY_KNOTS_S)
    del gained, filtered
    rate = np.vstack([turned[:1], turned]) / np.maximum(np.vstack([step_s[:1], step_s]), 1e-3)
    return InertialMotion(time, velocity, bounded, rotation_matrix(q), rate)


def _fast_corrections(time: npt.NDArray[np.int64], q: Array, turned: Array) -> Array:
    """(M, 3) sum of the rotations in NED that the filter added to what its gyros said, without its slow part."""
    added = rotation_vector(multiply(q[1:], conjugate(multiply(q[:-1], from_rotation_vector(turned)))))
    corrections = np.vstack([np.zeros(3), np.cumsum(added, axis=0)])
    return np.asarray(corrections - slow_part(time, corrections, ATTITUDE_KNOTS_S))


def _over(stamp: npt.NDArray[np.int64], values: Array, time: npt.NDArray[np.int64]) -> Array:
    """Integral of IMU values, each the mean over the time up to its stamp, between consecutive times."""
    held = np.vstack([np.zeros(3), np.cumsum(values[1:] * (np.diff(stamp)[:, None] * 1e-6), axis=0)])
    return np.diff(np.column_stack([np.interp(time, stamp, column) for column in held.T]), axis=0)


def slow_part(time: npt.NDArray[np.int64], values: Array, knots_s: float) -> Array:
    """Broken line with knots that far apart which fits best in the least squares, (N, D) like the values.

    Parameters
    ----------
    time : (N,) µs, ascending
    """
    since_s = (time - time[0]) * 1e-6
    pieces = max(1, round(float(since_s[-1]) / knots_s))
    place = since_s / max(float(since_s[-1]), 1e-6) * pieces
    left = np.minimum(place.astype(np.int64), pieces - 1)
    right_share = place - left
    # hat functions overlap with their neighbours only: the normal equations are three diagonals
    normal, moment = np.zeros((pieces + 1, pieces + 1)), np.zeros((pieces + 1, values.shape[1]))
    for first, one in ((left, 1.0 - right_share), (left + 1, right_share)):
        for second, other in ((left, 1.0 - right_share), (left + 1, right_share)):
            np.add.at(normal, (first, second), one * other)
        np.add.at(moment, first, one[:, None] * values)
    height = np.linalg.lstsq(normal, moment, rcond=None)[0]
    return np.asarray((1.0 - right_share)[:, None] * height[left] + right_share[:, None] * height[left + 1])
