"""Lever arms: where a sensor sits relative to the IMU, and how it moves as the vehicle turns. Body vectors are FRD."""

from fusetune.ekf2.compiled.kernel import kernel


@kernel
def position_relative_to_imu(params, x, y, z):
    """Vector (m) from the IMU to a sensor whose position in the body is (x, y, z)."""
    return x - params.EKF2_IMU_POS_X, y - params.EKF2_IMU_POS_Y, z - params.EKF2_IMU_POS_Z


@kernel
def velocity_of_offset(wx, wy, wz, x, y, z):
    """Velocity ω × r (m/s) of a point at r (m) on a body that turns at ω (rad/s)."""
    return wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
