"""Static pressure error from airflow over the vehicle, as a height correction.

The error pressure is a body-fixed fraction of the dynamic pressure, ½ ρ Σ Kᵢ vᵢ², with different fractions forward and
backward, right and left. As height it is that over ρ g, so the air density drops out.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_local_horizontal_position_valid

STANDARD_GRAVITY = 9.80665


@kernel
def static_pressure_height_correction(params, airspeed_x, airspeed_y, airspeed_z):
    """Height (m) to add to the barometer's for an airspeed vector in the body frame (m/s)."""
    limit = params.EKF2_ASPD_MAX * params.EKF2_ASPD_MAX
    coef_x = params.EKF2_PCOEF_XP if airspeed_x >= 0.0 else params.EKF2_PCOEF_XN
    coef_y = params.EKF2_PCOEF_YP if airspeed_y >= 0.0 else params.EKF2_PCOEF_YN
    weighted = (
        coef_x * min(airspeed_x * airspeed_x, limit)
        + coef_y * min(airspeed_y * airspeed_y, limit)
        + params.EKF2_PCOEF_Z * min(airspeed_z * airspeed_z, limit)
    )
    return 0.5 * weighted / STANDARD_GRAVITY


@kernel
def compensate_baro_for_dynamic_pressure(ekf, params, height):
    """Corrected barometric height (m); unchanged without a wind estimate or a valid horizontal position."""
    if not (ekf.cs.wind and is_local_horizontal_position_valid(ekf)):
        return height

    imu, R = ekf.imu_delayed, ekf.R_to_earth
    wx = imu.delta_ang[0] / imu.delta_ang_dt - ekf.gyro_bias[0]
    wy = imu.delta_ang[1] / imu.delta_ang_dt - ekf.gyro_bias[1]
    wz = imu.delta_ang[2] / imu.delta_ang_dt - ekf.gyro_bias[2]
    px, py, pz = params.EKF2_IMU_POS_X, params.EKF2_IMU_POS_Y, params.EKF2_IMU_POS_Z
    north = ekf.vel[0] - ekf.wind_vel[0]
    east = ekf.vel[1] - ekf.wind_vel[1]
    down = ekf.vel[2]
    return height + static_pressure_height_correction(
        params,
        R[0, 0] * north + R[1, 0] * east + R[2, 0] * down - (wy * pz - wz * py),
        R[0, 1] * north + R[1, 1] * east + R[2, 1] * down - (wz * px - wx * pz),
        R[0, 2] * north + R[1, 2] * east + R[2, 2] * down - (wx * py - wy * px),
    )
