"""Direction and strength of the Earth's magnetic field at a place, as PX4 looks them up.

Bilinear interpolation on a grid of 10°; date and height are not considered. Releases before v1.16 do the same with
tables of an earlier date.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.world_magnetic_model_table import (
    OLDER_EPOCHS,
    QUANTITIES,
    RESOLUTION_DEG,
    older_table_path,
    read_tables,
)

_TABLES = read_tables()
_DECLINATION_SCALE, _DECLINATION = _TABLES["declination"]
_INCLINATION_SCALE, _INCLINATION = _TABLES["inclination"]
_STRENGTH_SCALE, _STRENGTH = _TABLES["strength"]
_RESOLUTION = float(RESOLUTION_DEG)
_GAUSS_PER_NANOTESLA = 1e-5

_OLDER_TABLES = [read_tables(older_table_path(release)) for release in OLDER_EPOCHS]
_OLDER = np.array([[tables[quantity].values for quantity in QUANTITIES] for tables in _OLDER_TABLES])
_RADIANS_PER_UNIT = 1e-4
_GAUSS_PER_UNIT = 1e-4
EDITION_OF_V1_13, EDITION_OF_V1_14, EDITION_OF_V1_15 = range(len(OLDER_EPOCHS))


@kernel
def _interpolate(latitude_deg, longitude_deg, table):
    """Value of a table at a place; latitude is limited to the poles, longitude wraps once."""
    latitude = min(max(latitude_deg, -90.0), 90.0)
    longitude = longitude_deg
    if longitude > 180.0:
        longitude -= 360.0
    if longitude < -180.0:
        longitude += 360.0
    south = min(max(math.floor(latitude / _RESOLUTION) * _RESOLUTION, -90.0), 90.0 - _RESOLUTION)
    west = min(max(math.floor(longitude / _RESOLUTION) * _RESOLUTION, -180.0), 180.0 - _RESOLUTION)
    row = int((south + 90.0) / _RESOLUTION)
    column = int((west + 180.0) / _RESOLUTION)
    northing = min(max((latitude - south) / _RESOLUTION, 0.0), 1.0)
    easting = min(max((longitude - west) / _RESOLUTION, 0.0), 1.0)
    at_south = table[row, column] + easting * (table[row, column + 1] - table[row, column])
    at_north = table[row + 1, column] + easting * (table[row + 1, column + 1] - table[row + 1, column])
    return at_south + northing * (at_north - at_south)


@kernel
def get_mag_declination_degrees(latitude_deg, longitude_deg):
    """Angle (deg) from true to magnetic north, positive to the east."""
    if not (math.isfinite(latitude_deg) and math.isfinite(longitude_deg)):
        return math.nan
    return _interpolate(latitude_deg, longitude_deg, _DECLINATION) * _DECLINATION_SCALE


@kernel
def get_mag_inclination_degrees(latitude_deg, longitude_deg):
    """Angle (deg) of the field below the horizon."""
    if not (math.isfinite(latitude_deg) and math.isfinite(longitude_deg)):
        return math.nan
    return _interpolate(latitude_deg, longitude_deg, _INCLINATION) * _INCLINATION_SCALE


@kernel
def get_mag_strength_gauss(latitude_deg, longitude_deg):
    """Strength of the field (Gauss)."""
    if not (math.isfinite(latitude_deg) and math.isfinite(longitude_deg)):
        return math.nan
    return _interpolate(latitude_deg, longitude_deg, _STRENGTH) * _STRENGTH_SCALE * _GAUSS_PER_NANOTESLA


@kernel
def older_field_at(edition, latitude_deg, longitude_deg):
    """Declination, inclination (rad) and strength (Gauss) at a place, as a release before v1.16 knows them."""
    declination = _interpolate(latitude_deg, longitude_deg, _OLDER[edition, 0]) * _RADIANS_PER_UNIT
    inclination = _interpolate(latitude_deg, longitude_deg, _OLDER[edition, 1]) * _RADIANS_PER_UNIT
    strength = _interpolate(latitude_deg, longitude_deg, _OLDER[edition, 2]) * _GAUSS_PER_UNIT
    return declination, inclination, strength


def field_at(latitude_deg: float, longitude_deg: float, release: str | None = None) -> tuple[float, float, float]:
    """Declination, inclination (rad) and strength (Gauss) at a place, for callers outside compiled code.

    That of v1.16, or of a `release` that has an older model.
    """
    look_up = _interpolate.py_func
    if release in OLDER_EPOCHS:
        tables = _OLDER[list(OLDER_EPOCHS).index(release)]
        units = (_RADIANS_PER_UNIT, _RADIANS_PER_UNIT, _GAUSS_PER_UNIT)
        found = [look_up(latitude_deg, longitude_deg, one) * unit for one, unit in zip(tables, units, strict=True)]
        return found[0], found[1], found[2]
    declination = look_up(latitude_deg, longitude_deg, _DECLINATION) * _DECLINATION_SCALE
    inclination = look_up(latitude_deg, longitude_deg, _INCLINATION) * _INCLINATION_SCALE
    strength = look_up(latitude_deg, longitude_deg, _STRENGTH) * _STRENGTH_SCALE * _GAUSS_PER_NANOTESLA
    return math.radians(declination), math.radians(inclination), strength
