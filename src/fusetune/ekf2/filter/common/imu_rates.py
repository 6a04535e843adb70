"""What the IMU measured at the fusion time horizon, as it is, or corrected by the biases."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.releases.by_release import by_release


@kernel
def body_rate(ekf):
    """Rotation rate (rad/s, FRD)."""
    return _corrected(ekf.imu_delayed.delta_ang, ekf.imu_delayed.delta_ang_dt, ekf.gyro_bias)


@kernel
def specific_force(ekf):
    """Specific force (m/s², FRD)."""
    return _corrected(ekf.imu_delayed.delta_vel, ekf.imu_delayed.delta_vel_dt, ekf.accel_bias)


@kernel
def measured_rate(ekf):
    """Rotation rate (rad/s, FRD) with its bias."""
    imu = ekf.imu_delayed
    return imu.delta_ang[0] / imu.delta_ang_dt, imu.delta_ang[1] / imu.delta_ang_dt, imu.delta_ang[2] / imu.delta_ang_dt


@kernel
def measured_force(ekf):
    """Specific force (m/s², FRD) with its bias."""
    imu = ekf.imu_delayed
    return imu.delta_vel[0] / imu.delta_vel_dt, imu.delta_vel[1] / imu.delta_vel_dt, imu.delta_vel[2] / imu.delta_vel_dt


@kernel
def _corrected(delta, dt, bias):
    return delta[0] / dt - bias[0], delta[1] / dt - bias[1], delta[2] / dt - bias[2]


lever_rate = by_release(body_rate, "levers_by_measured_rate", measured_rate)
"""Rotation rate (rad/s, FRD) that moves what sits away from the IMU."""


@kernel
def gyro_bias_rate(ekf):
    """Bias of the gyro (rad/s, FRD)."""
    return ekf.gyro_bias[0], ekf.gyro_bias[1], ekf.gyro_bias[2]
