"""Covariance of the quaternion: from a rotation vector and back, and what resets make of it.

Mirrors `initialiseQuatCovariances`, `calcRotVecVariances` and `increaseQuatYawErrVariance` of PX4 v1.14
`EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.covariance_blocks import uncorrelate_set_variance_vector, zero_covariance_block
from fusetune.ekf2.filter.common.state import ATTITUDE, ERROR_STATE_SIZE
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import attitude_variance, write_yaw_jacobian
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3, quaternion_place

SMALLEST_SQUARED_ANGLE = 1e-9
MOST_YAW_VARIANCE_ADDED = 0.01


@kernel
def zero_quaternion_covariance(ekf):
    """Nothing is known to be uncertain of the attitude."""
    zero_covariance_block(ekf, ATTITUDE, 3)
    zero_covariance_block(ekf, Q3, 1)


@kernel
def set_quaternion_covariance(ekf, variance):
    """Covariance of a quaternion whose rotation vector is uncertain by `variance` (rad²) about each axis.

    With r the rotation vector, φ its length and s, c sine and cosine of φ/2: ∂q₀/∂rⱼ = -s rⱼ / 2φ and
    ∂qᵢ/∂rⱼ = (s/φ) δᵢⱼ + rᵢ rⱼ (c/2φ² - s/φ³).
    """
    zero_quaternion_covariance(ekf)
    P, J = ekf.P, ekf.quaternion.gains
    squared = _write_jacobian_of_rotation_vector(ekf, J)
    if not squared > SMALLEST_SQUARED_ANGLE:
        uncorrelate_set_variance_vector(ekf, ATTITUDE, 0.0, 0.25 * variance, 0.25 * variance)
        P[Q3, Q3] = 0.25 * variance
        return
    for i in range(4):
        for j in range(4):
            covariance = J[0, i] * J[0, j] + J[1, i] * J[1, j] + J[2, i] * J[2, j]
            P[quaternion_place(i), quaternion_place(j)] = variance * covariance


@kernel
def _write_jacobian_of_rotation_vector(ekf, J):
    """Write ∂q/∂r transposed, (3, 4) of `J`, and return r²; none where there is hardly a rotation."""
    q = ekf.q
    sign = 1.0 if q[0] >= 0.0 else -1.0
    angle = 2.0 * math.acos(min(sign * q[0], 1.0))
    sine = math.sin(0.5 * angle)
    if sine == 0.0:
        return 0.0
    scale = sign * angle / sine
    squared = (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) * scale * scale
    if not squared > SMALLEST_SQUARED_ANGLE:
        return squared
    length = math.sqrt(squared)
    s, c = math.sin(0.5 * length), math.cos(0.5 * length)
    mixed = 0.5 * c / squared - s / (squared * length)
    for j in range(3):
        r = scale * q[j + 1]
        J[j, 0] = -0.5 * s / length * r
        for i in range(3):
            J[j, i + 1] = scale * q[i + 1] * r * mixed
        J[j, j + 1] += s / length
    return squared


@kernel
def _rotation_vector_variance(ekf, axis):
    """Variance (rad²) of one element of the rotation vector r = 2 acos(q₀) (q₁, q₂, q₃) / √(1 - q₀²)."""
    q, P = ekf.q, ekf.P
    i = quaternion_place(axis + 1)
    sign = 1.0 if q[0] >= 0.0 else -1.0
    q0, qi = sign * q[0], sign * q[axis + 1]
    rest = 1.0 - q0 * q0
    if not rest > SMALLEST_SQUARED_ANGLE:
        return 4.0 * P[i, i]
    angle = math.acos(q0)
    by_q0 = -2.0 * qi / rest + 2.0 * q0 * qi * angle / (rest * math.sqrt(rest))
    by_qi = 2.0 * angle / math.sqrt(rest)
    return by_q0 * by_q0 * P[0, 0] + 2.0 * by_q0 * by_qi * P[0, i] + by_qi * by_qi * P[i, i]


@kernel
def tilt_variance_of_quaternion(ekf):
    """Sum of the variances (rad²) of the rotation vector's first two elements, which PX4 takes for the tilt's."""
    return _rotation_vector_variance(ekf, 0) + _rotation_vector_variance(ekf, 1)


@kernel
def yaw_variance_of_quaternion(ekf):
    """Variance (rad²) of the yaw; `ekf.scratch.H` is not kept."""
    write_yaw_jacobian(ekf, ekf.scratch.H)
    return attitude_variance(ekf, ekf.scratch.H)


@kernel
def attitude_variance_about(ekf, axis):
    """Variance (rad²) of the attitude error about an axis of NED; `ekf.scratch.H` is not kept.

    δθᵢ is twice the part of δq along the turn (0, eᵢ) ⊗ q.
    """
    H = ekf.scratch.H
    for i in range(ERROR_STATE_SIZE):
        H[i] = 0.0
    _write_turn(ekf, axis, H)
    return 4.0 * attitude_variance(ekf, H)


@kernel
def _write_turn(ekf, axis, H):
    """Write (0, eᵢ) ⊗ q into the places of the quaternion in `H`."""
    q0, q1, q2, q3 = ekf.q[0], ekf.q[1], ekf.q[2], ekf.q[3]
    if axis == 0:
        H[0], H[1], H[2], H[Q3] = -q1, q0, -q3, q2
    elif axis == 1:
        H[0], H[1], H[2], H[Q3] = -q2, q3, q0, -q1
    else:
        H[0], H[1], H[2], H[Q3] = -q3, -q2, q1, q0


@kernel
def add_yaw_variance(ekf, variance):
    """Let the yaw be more uncertain by `variance` (rad²), of which at most 0.01 is taken at once."""
    H = ekf.scratch.H
    _write_turn(ekf, 2, H)
    added = 0.25 * min(variance, MOST_YAW_VARIANCE_ADDED)
    for i in range(4):
        for j in range(4):
            a, b = quaternion_place(i), quaternion_place(j)
            ekf.P[a, b] += added * (H[a] * H[b])


@kernel
def uncorrelate_quaternion(ekf):
    """Zero the covariances of the attitude with all other states, not those of the quaternion itself."""
    P = ekf.P
    for i in range(4):
        a = quaternion_place(i)
        for j in range(3, Q3):
            P[a, j] = 0.0
            P[j, a] = 0.0
