"""Where the GNSS antenna sits relative to the IMU."""

from fusetune.ekf2.compiled.kernel import kernel


@kernel
def antenna_offset_body(params):
    """Vector (m, FRD) from the IMU to the antenna."""
    return (
        params.EKF2_GPS_POS_X - params.EKF2_IMU_POS_X,
        params.EKF2_GPS_POS_Y - params.EKF2_IMU_POS_Y,
        params.EKF2_GPS_POS_Z - params.EKF2_IMU_POS_Z,
    )


@kernel
def rotate_to_earth(R, x, y, z):
    """Body vector in NED, by the rotation matrix `R`."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )
