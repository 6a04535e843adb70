"""Small tools for arrays of unit quaternions (w, x, y, z), body → NED."""

import numpy as np
import numpy.typing as npt

from fusetune.quaternions import conjugate, multiply, rotation_vector

Array = npt.NDArray[np.float64]

_ROWS_AT_ONCE = 1 << 16
"""Some minutes of flight: what is made on the way is several times as large as the result."""


def interpolate(time: npt.NDArray[np.int64], values: Array, at: npt.NDArray[np.int64]) -> Array:
    """Linear interpolation of (N, D) values at times (M,), µs → (M, D)."""
    return np.column_stack([np.interp(at, time, column) for column in values.T])


def interpolate_quaternion(time: npt.NDArray[np.int64], quaternion: Array, at: npt.NDArray[np.int64]) -> Array:
    """Normalised linear interpolation of unit quaternions (N, 4), fit for the small steps of a log → (M, 4)."""
    flips = np.cumprod(np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0, -1.0, 1.0))
    continuous = quaternion * np.r_[1.0, flips][:, None]
    result = interpolate(time, continuous, at)
    return result / np.linalg.norm(result, axis=1, keepdims=True)


def heading(q: Array) -> Array:
    """Heading of (N, 4) quaternions, rad."""
    w, x, y, z = q.T
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def down_in_body(q: Array) -> Array:
    """The down axis of NED seen from the body, (N, 3)."""
    w, x, y, z = q.T
    return np.column_stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def wrap(angle: Array) -> Array:
    """Angles in [−π, π)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def error_in_ned(quaternion: Array, true_quaternion: Array) -> Array:
    """Rotation vectors (N, 3), rad, in NED that turn the true attitude into the estimated one."""
    error = np.empty((len(quaternion), 3))
    for first in range(0, len(quaternion), _ROWS_AT_ONCE):
        part = slice(first, first + _ROWS_AT_ONCE)
        error[part] = rotation_vector(multiply(quaternion[part], conjugate(true_quaternion[part])))
    return error
