"""What the IMU measured at the fusion time horizon, corrected by the biases."""

from fusetune.ekf2.compiled.kernel import kernel


@kernel
def body_rate(ekf):
    """Rotation rate (rad/s, FRD)."""
    imu = ekf.imu_delayed
    return (
        imu.delta_ang[0] / imu.delta_ang_dt - ekf.gyro_bias[0],
        imu.delta_ang[1] / imu.delta_ang_dt - ekf.gyro_bias[1],
        imu.delta_ang[2] / imu.delta_ang_dt - ekf.gyro_bias[2],
    )


@kernel
def specific_force(ekf):
    """Specific force (m/s², FRD)."""
    imu = ekf.imu_delayed
    return (
        imu.delta_vel[0] / imu.delta_vel_dt - ekf.accel_bias[0],
        imu.delta_vel[1] / imu.delta_vel_dt - ekf.accel_bias[1],
        imu.delta_vel[2] / imu.delta_vel_dt - ekf.accel_bias[2],
    )
