"""The world magnetic model at the vehicle: when it is looked up, and what it is used for."""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_memory import DECLINATION_FROM_WMM, DECLINATION_SAVED
from fusetune.ekf2.filter.common.conditions import is_local_horizontal_position_valid
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.numerics.world_magnetic_model import (
    get_mag_declination_degrees,
    get_mag_inclination_degrees,
    get_mag_strength_gauss,
)

WMM_CHECK_INTERVAL = 10_000_000
WMM_ANGLE_CHANGE = math.radians(1.0)
WMM_STRENGTH_CHANGE = 0.01
SAVED_DECLINATION_CHANGE_DEG = 0.1


@kernel
def earth_field_vector(declination, inclination, strength, field):
    """Write the NED field of given declination, inclination (rad, positive down) and strength into `field`."""
    horizontal = strength * math.cos(inclination)
    field[0] = horizontal * math.cos(declination)
    field[1] = horizontal * math.sin(declination)
    field[2] = strength * math.sin(inclination)


@kernel
def is_wmm_field_known(ekf):
    """Whether the world magnetic model has given a usable field vector."""
    field = ekf.mag.wmm_earth_field
    squared = field[0] * field[0] + field[1] * field[1] + field[2] * field[2]
    return np.isfinite(squared) and squared > 0.0


@kernel
def update_world_magnetic_model(ekf, latitude_deg, longitude_deg):
    """Look the field up at a place; return True when it differs enough (1°, 0.01 Gauss) to replace the known one."""
    declination = math.radians(get_mag_declination_degrees(latitude_deg, longitude_deg))
    inclination = math.radians(get_mag_inclination_degrees(latitude_deg, longitude_deg))
    strength = get_mag_strength_gauss(latitude_deg, longitude_deg)
    if not (np.isfinite(declination) and np.isfinite(inclination) and np.isfinite(strength)):
        return False

    mag = ekf.mag
    known = np.isfinite(mag.wmm_declination) and np.isfinite(mag.wmm_inclination) and np.isfinite(mag.wmm_strength)
    if (
        known
        and is_wmm_field_known(ekf)
        and abs(declination - mag.wmm_declination) <= WMM_ANGLE_CHANGE
        and abs(inclination - mag.wmm_inclination) <= WMM_ANGLE_CHANGE
        and abs(strength - mag.wmm_strength) <= WMM_STRENGTH_CHANGE
    ):
        return False

    mag.wmm_declination = declination
    mag.wmm_inclination = inclination
    mag.wmm_strength = strength
    earth_field_vector(declination, inclination, strength, mag.wmm_earth_field)
    return True


@kernel
def check_world_magnetic_model(ekf):
    """Look the field up when the origin is newer than the last mag fusion, and every 10 s of valid position."""
    if not ekf.origin.lat_lon_valid:
        return False
    origin_is_newer = ekf.origin.timestamp > ekf.aid.mag.time_last_fuse
    check_is_due = is_local_horizontal_position_valid(ekf) and is_timed_out(
        ekf, ekf.mag.wmm_time_last_checked, WMM_CHECK_INTERVAL
    )
    if not (origin_is_newer or check_is_due):
        return False
    ekf.mag.wmm_time_last_checked = ekf.time_delayed_us
    return update_world_magnetic_model(ekf, math.degrees(ekf.gpos_lat), math.degrees(ekf.gpos_lon))


@kernel
def has_wmm_declination(ekf, params):
    """Whether EKF2_DECL_TYPE wants the model's declination and the model knows it."""
    return (int(params.EKF2_DECL_TYPE) & DECLINATION_FROM_WMM) != 0 and np.isfinite(ekf.mag.wmm_declination)


@kernel
def has_saved_declination(params):
    """Whether EKF2_DECL_TYPE allows the saved declination and one is saved (not 0)."""
    return (
        (int(params.EKF2_DECL_TYPE) & DECLINATION_SAVED) != 0
        and np.isfinite(params.EKF2_MAG_DECL)
        and abs(params.EKF2_MAG_DECL) > 0.0
    )


@kernel
def save_declination(ekf, params):
    """Write the model's declination to EKF2_MAG_DECL, once, if EKF2_DECL_TYPE asks for it and it differs by 0.1°."""
    if ekf.mag.declination_saved or (int(params.EKF2_DECL_TYPE) & DECLINATION_SAVED) == 0:
        return
    if np.isfinite(ekf.mag.wmm_declination):
        declination_deg = math.degrees(ekf.mag.wmm_declination)
        if abs(declination_deg - params.EKF2_MAG_DECL) > SAVED_DECLINATION_CHANGE_DEG:
            params.EKF2_MAG_DECL = declination_deg
        ekf.mag.declination_saved = True


@kernel
def get_mag_declination(ekf, params):
    """Declination (rad) for heading: of the earth field state once aligned in flight, else model, parameter, or 0."""
    if ekf.cs.mag_aligned_in_flight:
        return math.atan2(ekf.mag_I[1], ekf.mag_I[0])
    if has_wmm_declination(ekf, params):
        return ekf.mag.wmm_declination
    if has_saved_declination(params):
        return math.radians(params.EKF2_MAG_DECL)
    return 0.0


@kernel
def synthetic_mag_z(ekf, mag_x, mag_y):
    """Body z field (Gauss) that completes x and y to the model's strength, with the model's sign."""
    field = ekf.mag.wmm_earth_field
    squared = field[0] * field[0] + field[1] * field[1] + field[2] * field[2]
    magnitude = math.sqrt(max(squared - mag_x * mag_x - mag_y * mag_y, 0.0))
    R = ekf.R_to_earth
    predicted = field[0] * R[0, 2] + field[1] * R[1, 2] + field[2] * R[2, 2]
    return -magnitude if predicted < 0.0 else magnitude
