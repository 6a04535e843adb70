"""The world magnetic model at the vehicle: when it is looked up, and what it is used for.

Mirrors the declination and the look-up of the model of PX4 v1.16 `EKF/aid_sources/magnetometer/mag_control.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_local_horizontal_position_valid
from fusetune.ekf2.filter.common.field_parameters import DECLINATION_FROM_WMM, DECLINATION_SAVED
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.numerics.world_magnetic_model import (
    EDITION_OF_V1_13,
    EDITION_OF_V1_14,
    EDITION_OF_V1_15,
    get_mag_declination_degrees,
    get_mag_inclination_degrees,
    get_mag_strength_gauss,
    older_field_at,
)
from fusetune.ekf2.releases.by_release import by_release

WMM_CHECK_INTERVAL = 10_000_000
WMM_ANGLE_CHANGE = math.radians(1.0)
WMM_STRENGTH_CHANGE = 0.01
SAVED_DECLINATION_CHANGE_DEG = 0.1
FIX_CHECK_INTERVAL = 1_000_000
ROUGH_FIX_TYPE = 2
ROUGH_FIX_ACCURACY = 1000.0


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
def _field_of_v1_16(ekf, latitude_deg, longitude_deg):
    """Declination, inclination (rad) and strength (Gauss) of the model at a place."""
    declination = math.radians(get_mag_declination_degrees(latitude_deg, longitude_deg))
    inclination = math.radians(get_mag_inclination_degrees(latitude_deg, longitude_deg))
    strength = get_mag_strength_gauss(latitude_deg, longitude_deg)
    return declination, inclination, strength


@kernel
def _field_of_v1_15(ekf, latitude_deg, longitude_deg):
    return older_field_at(EDITION_OF_V1_15, latitude_deg, longitude_deg)


@kernel
def _field_of_v1_14(ekf, latitude_deg, longitude_deg):
    return older_field_at(EDITION_OF_V1_14, latitude_deg, longitude_deg)


@kernel
def _field_of_v1_13(ekf, latitude_deg, longitude_deg):
    return older_field_at(EDITION_OF_V1_13, latitude_deg, longitude_deg)


field_of_model = by_release(
    by_release(
        by_release(_field_of_v1_16, "knows_field_of_early_2024", _field_of_v1_15),
        "knows_field_of_2023",
        _field_of_v1_14,
    ),
    "knows_field_of_2022",
    _field_of_v1_13,
)


@kernel
def _take_field(ekf, declination, inclination, strength):
    """Know this field (rad, rad, Gauss) from now on."""
    mag = ekf.mag
    mag.wmm_declination = declination
    mag.wmm_inclination = inclination
    mag.wmm_strength = strength
    earth_field_vector(declination, inclination, strength, mag.wmm_earth_field)


@kernel
def update_world_magnetic_model(ekf, latitude_deg, longitude_deg):
    """Look the field up at a place; return True when it differs enough (1°, 0.01 Gauss) to replace the known one."""
    declination, inclination, strength = field_of_model(ekf, latitude_deg, longitude_deg)
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

    _take_field(ekf, declination, inclination, strength)
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
def _is_rough_fix(sample):
    """Whether a fix, of two dimensions at least, tells where on Earth the vehicle is."""
    return sample.fix_type >= ROUGH_FIX_TYPE and sample.hacc < ROUGH_FIX_ACCURACY


@kernel
def take_field_of_place(ekf, latitude_deg, longitude_deg):
    """Know the model's field at a place, as releases before v1.16 do at every new origin."""
    declination, inclination, strength = field_of_model(ekf, latitude_deg, longitude_deg)
    if np.isfinite(declination) and np.isfinite(inclination) and np.isfinite(strength):
        _take_field(ekf, declination, inclination, strength)
        ekf.field_history.wmm_time_last_set = ekf.time_delayed_us


@kernel
def _look_up_every_second(ekf, sample, is_usable):
    """Look the field up at a GNSS fix, once a second; keep the known one unless a direction differs by 1°.

    Parameters
    ----------
    is_usable : whether the GNSS checks have passed, or there is no origin yet

    Returns
    -------
    bool : True if the fix was used: two dimensions within 1 km are enough

    Mirrors `collect_gps` of PX4 v1.15 `EKF/gps_checks.cpp`.
    """
    mag, history = ekf.mag, ekf.field_history
    if history.wmm_time_last_set != 0 and not is_timed_out(ekf, mag.wmm_time_last_checked, FIX_CHECK_INTERVAL):
        return False
    mag.wmm_time_last_checked = ekf.time_delayed_us
    if not (is_usable and _is_rough_fix(sample)):
        return False
    declination, inclination, _ = field_of_model(ekf, sample.lat_deg, sample.lon_deg)
    is_kept = (
        history.wmm_time_last_set != 0
        and abs(declination - mag.wmm_declination) <= WMM_ANGLE_CHANGE
        and abs(inclination - mag.wmm_inclination) <= WMM_ANGLE_CHANGE
    )
    if not is_kept:
        take_field_of_place(ekf, sample.lat_deg, sample.lon_deg)
    return True


@kernel
def _look_up_until_origin(ekf, sample, is_usable):
    """Know the field of every rough fix until there is an origin, and then of that fix; the first resets the yaw.

    Mirrors `collect_gps` of PX4 v1.14 `EKF/gps_checks.cpp`.
    """
    if not (is_usable and _is_rough_fix(sample)):
        return False
    if not np.isfinite(ekf.mag.wmm_declination):
        ekf.mag_modes.yaw_reset_requested = True
    take_field_of_place(ekf, sample.lat_deg, sample.lon_deg)
    return True


look_field_up_by_fix = by_release(_look_up_every_second, "looks_field_up_until_origin", _look_up_until_origin)
"""Look the field up at a GNSS fix (`sample`) that `is_usable`, if it is due; True if the fix was used."""


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
def _wherever_known(ekf):
    return True


@kernel
def _with_origin(ekf):
    return ekf.origin.lat_lon_valid


_may_save_declination = by_release(_wherever_known, "looks_field_up_by_fix", _with_origin)


@kernel
def save_declination(ekf, params):
    """Write the model's declination to EKF2_MAG_DECL, once, if EKF2_DECL_TYPE asks for it and it differs by 0.1°."""
    if ekf.mag.declination_saved or (int(params.EKF2_DECL_TYPE) & DECLINATION_SAVED) == 0:
        return
    if not _may_save_declination(ekf):
        return
    if np.isfinite(ekf.mag.wmm_declination):
        declination_deg = math.degrees(ekf.mag.wmm_declination)
        if abs(declination_deg - params.EKF2_MAG_DECL) > SAVED_DECLINATION_CHANGE_DEG:
            params.EKF2_MAG_DECL = declination_deg
        ekf.mag.declination_saved = True


@kernel
def _saved_or_none(ekf, params):
    return math.radians(params.EKF2_MAG_DECL) if has_saved_declination(params) else 0.0


@kernel
def _parameter(ekf, params):
    return math.radians(params.EKF2_MAG_DECL)


_declination_otherwise = by_release(_saved_or_none, "assumes_given_declination", _parameter)
"""Declination (rad) where neither field states nor model tell it."""


@kernel
def get_mag_declination(ekf, params):
    """Declination (rad) for heading: of the earth field state once aligned in flight, else model, parameter, or 0."""
    if ekf.cs.mag_aligned_in_flight:
        return math.atan2(ekf.mag_I[1], ekf.mag_I[0])
    if has_wmm_declination(ekf, params):
        return ekf.mag.wmm_declination
    return _declination_otherwise(ekf, params)


@kernel
def synthetic_mag_z(ekf, mag_x, mag_y):
    """Body z field (Gauss) that completes x and y to the model's strength, with the model's sign."""
    field = ekf.mag.wmm_earth_field
    squared = field[0] * field[0] + field[1] * field[1] + field[2] * field[2]
    magnitude = math.sqrt(max(squared - mag_x * mag_x - mag_y * mag_y, 0.0))
    R = ekf.R_to_earth
    predicted = field[0] * R[0, 2] + field[1] * R[1, 2] + field[2] * R[2, 2]
    return -magnitude if predicted < 0.0 else magnitude


@kernel
def synthesise_z(ekf, params, sample):
    """With EKF2_SYNT_MAG_Z, replace the sample's z by what the model and the other axes leave for it."""
    ekf.cs.synthetic_mag_z = (
        params.EKF2_SYNT_MAG_Z != 0.0
        and (int(params.EKF2_DECL_TYPE) & DECLINATION_FROM_WMM) != 0
        and is_wmm_field_known(ekf)
    )
    if ekf.cs.synthetic_mag_z:
        sample[2] = synthetic_mag_z(ekf, sample[0], sample[1])
