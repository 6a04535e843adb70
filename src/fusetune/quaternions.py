"""Unit quaternions (w, x, y, z) in NumPy arrays (…, 4): many at a time.

A quaternion rotates body (FRD) vectors to earth (NED); `ekf2/numerics/rotations.py` has the same for the
compiled estimator, one at a time.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SMALL_ANGLE = 1e-8
SMALL_SINE = 1e-12


def multiply(p: Array, q: Array) -> Array:
    """Hamilton products (…, 4): the rotation q, then p."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def conjugate(q: Array) -> Array:
    """Inverses (…, 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def normalised(q: Array) -> Array:
    """Quaternions (…, 4) of unit length."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def rotation_matrix(q: Array) -> Array:
    """Matrices (…, 3, 3) that turn body into NED vectors."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def from_rotation_vector(vector: Array) -> Array:
    """Quaternions (…, 4) of rotation vectors (…, 3), rad."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    # sin(a/2)/a, which tends to 1/2
    scale = np.where(angle < SMALL_ANGLE, 0.5, np.sin(0.5 * angle) / np.where(angle < SMALL_ANGLE, 1.0, angle))
    return np.concatenate([np.cos(0.5 * angle), scale * vector], axis=-1)


def rotation_vector(q: Array) -> Array:
    """Rotation vectors (…, 3), rad, the shorter way round."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > SMALL_SINE)
    return np.asarray(q[..., 1:] * scale)
