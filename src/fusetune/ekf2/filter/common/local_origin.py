"""Origin of the local NED frame: where it lies, and local positions relative to it.

Before an origin is known, local positions are projected about latitude 0, longitude 0.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.geodesy import project, reproject

LOCAL_ORIGIN = np.dtype(
    [
        ("lat_lon_valid", "?"),
        ("valid", "?"),
        ("timestamp", "i8"),
        ("lat_rad", "f8"),
        ("lon_rad", "f8"),
        ("alt", "f8"),
    ],
    align=True,
)
"""Sub-record `ekf.origin`. `alt` (m above mean sea level) is NaN until known; `valid`: all three coordinates known.

Until `lat_lon_valid`, latitude and longitude are 0, the reference of local positions without an origin.
"""

LOWEST_ALTITUDE, HIGHEST_ALTITUDE = -12_000.0, 100_000.0


@kernel
def initialise_local_origin(origin):
    """No origin known."""
    origin.lat_lon_valid = False
    origin.valid = False
    origin.timestamp = 0
    origin.lat_rad = 0.0
    origin.lon_rad = 0.0
    origin.alt = np.nan


@kernel
def set_origin_lat_lon(ekf, lat, lon):
    """Place the origin (rad) and note the time."""
    ekf.origin.lat_rad = lat
    ekf.origin.lon_rad = lon
    ekf.origin.timestamp = ekf.time_delayed_us
    ekf.origin.lat_lon_valid = True
    ekf.origin.valid = math.isfinite(ekf.origin.alt)


@kernel
def set_origin_altitude(ekf, alt):
    """Set the altitude (m) of the origin."""
    ekf.origin.alt = alt
    ekf.origin.valid = ekf.origin.lat_lon_valid and math.isfinite(alt)


@kernel
def project_to_local(ekf, lat, lon):
    """Local north and east (m) of a latitude and longitude (rad)."""
    return project(ekf.origin.lat_rad, ekf.origin.lon_rad, lat, lon)


@kernel
def reproject_to_global(ekf, north, east):
    """Latitude and longitude (rad) of a local north and east (m)."""
    return reproject(ekf.origin.lat_rad, ekf.origin.lon_rad, north, east)


@kernel
def get_local_horizontal_position(ekf):
    """Local north and east (m) of the position estimate."""
    return project_to_local(ekf, ekf.gpos_lat, ekf.gpos_lon)


@kernel
def origin_altitude(ekf):
    """Altitude (m) of the origin, 0 while unknown."""
    return ekf.origin.alt if math.isfinite(ekf.origin.alt) else 0.0


@kernel
def is_lat_lon_plausible(lat, lon):
    """Whether a latitude and longitude (rad) lie on the globe."""
    return math.isfinite(lat) and math.isfinite(lon) and abs(lat) <= 0.5 * math.pi and abs(lon) <= math.pi


@kernel
def is_altitude_plausible(alt):
    """Whether an altitude (m) lies between the deepest sea and the edge of space."""
    return math.isfinite(alt) and LOWEST_ALTITUDE < alt < HIGHEST_ALTITUDE
