"""Quaternions and rotation matrices as PX4 uses them.

A quaternion is (w, x, y, z) and rotates body (FRD) vectors to earth (NED); `R` is the same rotation as a matrix.
Yaw follows the Tait-Bryan sequence that stays clear of its singularity: 3-2-1 where the vehicle rolls more than it
pitches, 3-1-2 otherwise.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel

ANGLE_EPSILON = 1e-10

SMALL_ANGLE_SQUARED = 0.01
"""Square (rad²) of the angle up to which five Taylor terms give sine and cosine of its half in full precision."""

SMALL_LENGTH_EXCESS = 1e-6
"""Up to which three terms of a series give the inverse square root in full precision."""


@kernel
def wrap_pi(angle):
    """Angle (rad) brought into [-π, π)."""
    if -math.pi <= angle < math.pi:
        return angle
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@kernel
def rotation_matrix(w, x, y, z):
    """Rows of the rotation matrix of a unit quaternion, as three triples."""
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return (
        (ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz),
    )


@kernel
def quat_to_dcm(q, R):
    """Write the rotation matrix of the unit quaternion `q` into `R`, shape (3, 3)."""
    first, second, third = rotation_matrix(q[0], q[1], q[2], q[3])
    R[0, 0], R[0, 1], R[0, 2] = first
    R[1, 0], R[1, 1], R[1, 2] = second
    R[2, 0], R[2, 1], R[2, 2] = third


@kernel
def dcm_to_quat(R, q):
    """Write the unit quaternion of the rotation matrix `R` into `q` (largest component first, Shepperd 1978)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        s = math.sqrt(trace + 1.0)
        q[0] = 0.5 * s
        s = 0.5 / s
        q[1] = (R[2, 1] - R[1, 2]) * s
        q[2] = (R[0, 2] - R[2, 0]) * s
        q[3] = (R[1, 0] - R[0, 1]) * s
        return
    i = 0
    if R[1, 1] > R[i, i]:
        i = 1
    if R[2, 2] > R[i, i]:
        i = 2
    j = (i + 1) % 3
    k = (i + 2) % 3
    s = math.sqrt(R[i, i] - R[j, j] - R[k, k] + 1.0)
    q[i + 1] = 0.5 * s
    s = 0.5 / s
    q[j + 1] = (R[i, j] + R[j, i]) * s
    q[k + 1] = (R[k, i] + R[i, k]) * s
    q[0] = (R[k, j] - R[j, k]) * s


@kernel
def rotate_to_earth(R, x, y, z):
    """Body vector in NED, by the rotation matrix `R`."""
    return component_in_earth(R, 0, x, y, z), component_in_earth(R, 1, x, y, z), component_in_earth(R, 2, x, y, z)


@kernel
def rotate_to_body(R, north, east, down):
    """NED vector in the body frame, by the rotation matrix `R`."""
    return (
        component_in_body(R, 0, north, east, down),
        component_in_body(R, 1, north, east, down),
        component_in_body(R, 2, north, east, down),
    )


@kernel
def component_in_earth(R, axis, x, y, z):
    """Component `axis` in NED of a body vector."""
    return R[axis, 0] * x + R[axis, 1] * y + R[axis, 2] * z


@kernel
def component_in_body(R, axis, north, east, down):
    """Component `axis` in the body frame of a NED vector."""
    return R[0, axis] * north + R[1, axis] * east + R[2, axis] * down


@kernel
def variance_in_earth(R, axis, variance):
    """Variance of component `axis` in NED of a body vector with independent components."""
    return (
        R[axis, 0] * R[axis, 0] * variance[0]
        + R[axis, 1] * R[axis, 1] * variance[1]
        + R[axis, 2] * R[axis, 2] * variance[2]
    )


@kernel
def quat_multiply(a, b, out):
    """Write the Hamilton product a ⊗ b into `out`, which may be `a` or `b` itself."""
    w, x, y, z = quat_product((a[0], a[1], a[2], a[3]), (b[0], b[1], b[2], b[3]))
    out[0], out[1], out[2], out[3] = w, x, y, z


@kernel
def quat_multiply_inverse(a, b, out):
    """Write a ⊗ b⁻¹ of unit quaternions into `out`, which may be `a` or `b` itself."""
    w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    x = -a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    y = -a[0] * b[2] + a[1] * b[3] + a[2] * b[0] - a[3] * b[1]
    z = -a[0] * b[3] - a[1] * b[2] + a[2] * b[1] + a[3] * b[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@kernel
def kept_unit_length(w, x, y, z):
    """A quaternion of unit length but for rounding, such as a product of two, scaled by the first terms of a series."""
    excess = w * w + x * x + y * y + z * z - 1.0
    scale = 1.0 - excess * (0.5 - 0.375 * excess)
    return w * scale, x * scale, y * scale, z * scale


@kernel
def unit_length(w, x, y, z):
    """A quaternion scaled to unit length."""
    excess = w * w + x * x + y * y + z * z - 1.0
    if abs(excess) < SMALL_LENGTH_EXCESS:
        return kept_unit_length(w, x, y, z)
    scale = 1.0 / math.sqrt(1.0 + excess)
    return w * scale, x * scale, y * scale, z * scale


@kernel
def quat_normalise(q):
    """Scale `q` to unit length."""
    q[0], q[1], q[2], q[3] = unit_length(q[0], q[1], q[2], q[3])


@kernel
def small_rotation_to_quat(x, y, z, squared):
    """Unit quaternion of a rotation vector (rad) whose squared length is given and below `SMALL_ANGLE_SQUARED`."""
    h = 0.25 * squared
    scale = 0.5 + h * (-1.0 / 12.0 + h * (1.0 / 240.0 + h * (-1.0 / 10080.0 + h * (1.0 / 725760.0))))
    w = 1.0 + h * (-1.0 / 2.0 + h * (1.0 / 24.0 + h * (-1.0 / 720.0 + h * (1.0 / 40320.0))))
    return w, x * scale, y * scale, z * scale


@kernel
def rotation_vector_to_quat(x, y, z):
    """Unit quaternion (w, x, y, z) of a rotation vector (rad)."""
    squared = x * x + y * y + z * z
    if squared < SMALL_ANGLE_SQUARED:
        return small_rotation_to_quat(x, y, z, squared)
    angle = math.sqrt(squared)
    scale = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), x * scale, y * scale, z * scale


@kernel
def quat_product(a, b):
    """Hamilton product a ⊗ b of two quaternions that are given and returned as tuples (w, x, y, z)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@kernel
def rotate_by_body_increment(q, x, y, z):
    """q ← q ⊗ dq(x, y, z), normalised: a rotation vector measured in the body frame."""
    w, i, j, k = quat_product((q[0], q[1], q[2], q[3]), rotation_vector_to_quat(x, y, z))
    q[0], q[1], q[2], q[3] = unit_length(w, i, j, k)


@kernel
def rotate_by_earth_increment(q, x, y, z):
    """q ← dq(x, y, z) ⊗ q, normalised: a rotation vector given in the earth frame."""
    w, i, j, k = quat_product(rotation_vector_to_quat(x, y, z), (q[0], q[1], q[2], q[3]))
    q[0], q[1], q[2], q[3] = unit_length(w, i, j, k)


@kernel
def quat_to_rotation_vector(q):
    """Rotation vector (x, y, z) of a unit quaternion, its length in [0, 2π) as PX4's `AxisAngle`."""
    norm = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if norm < ANGLE_EPSILON:
        return 0.0, 0.0, 0.0
    scale = 2.0 * math.atan2(norm, q[0]) / norm
    return q[1] * scale, q[2] * scale, q[3] * scale


@kernel
def quat_aligning_with_up(x, y, z, q):
    """Write into `q` the shortest rotation that turns the body vector (x, y, z) to point up, NED (0, 0, -1)."""
    norm = math.sqrt(x * x + y * y + z * z)
    q[1] = -y
    q[2] = x
    q[3] = 0.0
    if math.hypot(x, y) < 1e-5 and z > 0.0:
        # upside down: any horizontal axis will do
        q[0] = 0.0
        q[1] = 1.0
        q[2] = 0.0
    else:
        q[0] = norm - z
    quat_normalise(q)


@kernel
def should_use_321_rotation_sequence(R):
    """Whether the vehicle rolls more than it pitches."""
    return abs(R[2, 0]) < abs(R[2, 1])


@kernel
def euler_yaw(R):
    """Yaw (rad) of the rotation matrix `R`, by the sequence suited to its tilt."""
    return euler_yaw_as(R, R)


@kernel
def euler_yaw_as(R, tilted):
    """Yaw (rad) of the rotation matrix `R`, by the sequence suited to the tilt of another one."""
    if should_use_321_rotation_sequence(tilted):
        return math.atan2(R[1, 0], R[0, 0])
    return math.atan2(-R[0, 1], R[1, 1])


@kernel
def update_yaw_in_rot_mat(yaw, R_in, R_out):
    """Write into `R_out` the rotation with the tilt of `R_in` and the given yaw (rad)."""
    if should_use_321_rotation_sequence(R_in):
        _dcm_from_321(yaw, math.asin(_unit(-R_in[2, 0])), math.atan2(R_in[2, 1], R_in[2, 2]), R_out)
    else:
        _dcm_from_312(yaw, math.asin(_unit(R_in[2, 1])), math.atan2(-R_in[2, 0], R_in[2, 2]), R_out)


@kernel
def _unit(sine):
    """Sine limited to [-1, 1], against rounding."""
    return min(max(sine, -1.0), 1.0)


@kernel
def _dcm_from_321(yaw, pitch, roll, R):
    cy, sy = math.cos(yaw), math.sin(yaw)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    R[0, 0] = cp * cy
    R[0, 1] = sr * sp * cy - cr * sy
    R[0, 2] = cr * sp * cy + sr * sy
    R[1, 0] = cp * sy
    R[1, 1] = sr * sp * sy + cr * cy
    R[1, 2] = cr * sp * sy - sr * cy
    R[2, 0] = -sp
    R[2, 1] = sr * cp
    R[2, 2] = cr * cp


@kernel
def _dcm_from_312(yaw, roll, pitch, R):
    cy, sy = math.cos(yaw), math.sin(yaw)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    R[0, 0] = cy * cp - sy * sp * sr
    R[0, 1] = -sy * cr
    R[0, 2] = cy * sp + sy * cp * sr
    R[1, 0] = sy * cp + cy * sp * sr
    R[1, 1] = cy * cr
    R[1, 2] = sy * sp - cy * cp * sr
    R[2, 0] = -sp * cr
    R[2, 1] = sr
    R[2, 2] = cp * cr
