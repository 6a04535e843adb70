"""Where the GNSS antenna sits relative to the IMU."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.lever_arm import position_relative_to_imu


@kernel
def antenna_offset_body(params):
    """Vector (m, FRD) from the IMU to the antenna."""
    return position_relative_to_imu(params, params.EKF2_GPS_POS_X, params.EKF2_GPS_POS_Y, params.EKF2_GPS_POS_Z)
