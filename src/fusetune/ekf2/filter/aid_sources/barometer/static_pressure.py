"""Static pressure error from airflow over the vehicle, as a height correction.

The error pressure is a body-fixed fraction of the dynamic pressure, ½ ρ Σ Kᵢ vᵢ², with different fractions forward and
backward, right and left. As height it is that over ρ g, so the air density drops out.

Mirrors `compensateBaroForDynamicPressure` of PX4 v1.16 `EKF/aid_sources/barometer/baro_height_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_local_horizontal_position_valid
from fusetune.ekf2.filter.common.imu_rates import lever_rate
from fusetune.ekf2.filter.wind import air_velocity_body
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.numerics.lever_arm import velocity_of_offset


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
    return 0.5 * weighted / ONE_G


@kernel
def compensate_baro_for_dynamic_pressure(ekf, params, height):
    """Corrected barometric height (m); unchanged without a wind estimate or a valid horizontal position."""
    if not (ekf.cs.wind and is_local_horizontal_position_valid(ekf)):
        return height

    x, y, z = air_velocity_body(ekf)
    wx, wy, wz = lever_rate(ekf)
    # the velocity is the IMU's, less that of the IMU around the body's origin it is the body's
    ox, oy, oz = velocity_of_offset(wx, wy, wz, params.EKF2_IMU_POS_X, params.EKF2_IMU_POS_Y, params.EKF2_IMU_POS_Z)
    return height + static_pressure_height_correction(params, x - ox, y - oy, z - oz)
