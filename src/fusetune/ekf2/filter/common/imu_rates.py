"""What the IMU measured at the fusion time horizon, as it is, or corrected by the biases."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _one(ekf):
    return 1.0


@kernel
def _mean_interval(ekf):
    return ekf.quaternion.mean_dt


bias_unit = by_release(_one, "keeps_biases_as_increments", _mean_interval)
"""What a bias of 1 rad/s, or 1 m/s², is in the unit of `ekf.gyro_bias` and `ekf.accel_bias`."""


@kernel
def _gyro_bias_rates(ekf):
    return ekf.gyro_bias[0], ekf.gyro_bias[1], ekf.gyro_bias[2]


@kernel
def _gyro_bias_of_increments(ekf):
    dt = ekf.quaternion.mean_dt
    return ekf.gyro_bias[0] / dt, ekf.gyro_bias[1] / dt, ekf.gyro_bias[2] / dt


gyro_bias = by_release(_gyro_bias_rates, "keeps_biases_as_increments", _gyro_bias_of_increments)
"""Bias of the gyro (rad/s, FRD)."""


@kernel
def _accel_bias_rates(ekf):
    return ekf.accel_bias[0], ekf.accel_bias[1], ekf.accel_bias[2]


@kernel
def _accel_bias_of_increments(ekf):
    dt = ekf.quaternion.mean_dt
    return ekf.accel_bias[0] / dt, ekf.accel_bias[1] / dt, ekf.accel_bias[2] / dt


accel_bias = by_release(_accel_bias_rates, "keeps_biases_as_increments", _accel_bias_of_increments)
"""Bias of the accelerometer (m/s², FRD)."""


@kernel
def body_rate(ekf):
    """Rotation rate (rad/s, FRD)."""
    return _corrected(ekf.imu_delayed.delta_ang, ekf.imu_delayed.delta_ang_dt, gyro_bias(ekf))


@kernel
def specific_force(ekf):
    """Specific force (m/s², FRD)."""
    return _corrected(ekf.imu_delayed.delta_vel, ekf.imu_delayed.delta_vel_dt, accel_bias(ekf))


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
