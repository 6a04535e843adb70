"""Derivatives by the attitude: from those by errors about north, east and down to those by the quaternion.

A rotation error δθ in the NED frame turns q into (1, δθ/2) ⊗ q. Of the quaternion's four directions three are such
turns, 2 (0, eᵢ) ⊗ q for the axis i; the fourth, along q itself, scales it. PX4 writes rotations as squares of the
elements, so an observation that is a rotated vector grows with the square of the norm: Euler's theorem gives the
derivative along q as the degree of the observation times its value. Ratios of rotated components have degree zero.

Mirrors what PX4 v1.14 `EKF/python/ekf_derivation/derivation.py` differentiates.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ATTITUDE, ERROR_STATE_SIZE
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release


@kernel
def set_quaternion_jacobian(H, h0, h1, h2, h3):
    """Write the derivatives by the elements of the quaternion into `H` (24,)."""
    H[ATTITUDE], H[ATTITUDE + 1], H[ATTITUDE + 2], H[Q3] = h0, h1, h2, h3


@kernel
def _leave_jacobian(ekf, H, growth):
    """v1.16 has the errors about north, east and down as states."""


@kernel
def _take_quaternion_jacobian(ekf, H, growth):
    q0, q1, q2, q3 = ekf.q[0], ekf.q[1], ekf.q[2], ekf.q[3]
    n, e, d = 2.0 * H[ATTITUDE], 2.0 * H[ATTITUDE + 1], 2.0 * H[ATTITUDE + 2]
    set_quaternion_jacobian(
        H,
        -n * q1 - e * q2 - d * q3 + growth * q0,
        n * q0 + e * q3 - d * q2 + growth * q1,
        -n * q3 + e * q0 + d * q1 + growth * q2,
        n * q2 - e * q1 + d * q0 + growth * q3,
    )


complete_attitude_jacobian = by_release(_leave_jacobian, "adds_quaternion_errors", _take_quaternion_jacobian)
"""Turn the derivatives by attitude errors about NED, in `H` (24,), into those by the attitude states of the release.

Call it once the other elements of `H` are set; the place of the terrain must not be one of them. `growth` is the
derivative along the quaternion's norm: twice the value of an observation that is a rotated vector (without what is not
rotated, like a bias), 0 for an angle or a ratio.
"""


@kernel
def uses_321_sequence(R):
    """Whether yaw is the first of the rotations about z, y, x; near the vertical it is taken of z, x, y."""
    return abs(R[2, 0]) < abs(R[2, 1])


@kernel
def write_yaw_jacobian(ekf, H):
    """Write the derivative of the yaw by the quaternion into `H` (24,), zero elsewhere."""
    q0, q1, q2, q3 = ekf.q[0], ekf.q[1], ekf.q[2], ekf.q[3]
    for i in range(ERROR_STATE_SIZE):
        H[i] = 0.0
    if uses_321_sequence(ekf.R_to_earth):
        y = 2.0 * (q0 * q3 + q1 * q2)
        x = _off_zero(q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3)
        scale = 2.0 / (x * x + y * y)
        h0, h1 = q3 * x - q0 * y, q2 * x - q1 * y
        h2, h3 = q1 * x + q2 * y, q0 * x + q3 * y
    else:
        y = 2.0 * (q0 * q3 - q1 * q2)
        x = _off_zero(q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3)
        scale = 2.0 / (x * x + y * y)
        h0, h1 = q3 * x - q0 * y, -q2 * x + q1 * y
        h2, h3 = -q1 * x - q2 * y, q0 * x + q3 * y
    set_quaternion_jacobian(H, scale * h0, scale * h1, scale * h2, scale * h3)


@kernel
def _off_zero(value):
    sign = 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)
    return value + FLT_EPSILON * (sign + 0.5)


@kernel
def attitude_variance(ekf, H):
    """H P Hᵀ of a Jacobian (24,) by the quaternion alone."""
    P = ekf.P
    h0, h1, h2, h3 = H[ATTITUDE], H[ATTITUDE + 1], H[ATTITUDE + 2], H[Q3]
    return (
        h0 * h0 * P[0, 0]
        + h1 * h1 * P[1, 1]
        + h2 * h2 * P[2, 2]
        + h3 * h3 * P[Q3, Q3]
        + 2.0 * (h0 * (h1 * P[0, 1] + h2 * P[0, 2] + h3 * P[0, Q3]) + h1 * (h2 * P[1, 2] + h3 * P[1, Q3]))
        + 2.0 * h2 * h3 * P[2, Q3]
    )
