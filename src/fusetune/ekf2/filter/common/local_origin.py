"""Origin of the local NED frame: where it lies, and local positions relative to it.

Before an origin is known, local positions are projected about latitude 0, longitude 0.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.numerics.geodesy import lat_lon_difference, project, reproject
from fusetune.ekf2.releases.by_release import by_release

LOCAL_ORIGIN = np.dtype(
    [
        *fields("?", "lat_lon_valid", "valid"),
        ("timestamp", "i8"),
        *fields("f8", "lat_rad", "lon_rad", "alt"),
    ],
    align=True,
)
"""Sub-record `ekf.origin`. `alt` (m above mean sea level) is NaN until known; `valid`: all three coordinates known.

Until `lat_lon_valid`, latitude and longitude are 0, the reference of local positions without an origin.
"""

LOWEST_ALTITUDE, HIGHEST_ALTITUDE = -12_000.0, 100_000.0


@kernel
def initialise_local_origin(origin):
    """What is not zero at start: no altitude is known."""
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
def _project_estimate(ekf):
    return project_to_local(ekf, ekf.gpos_lat, ekf.gpos_lon)


@kernel
def _local_estimate(ekf):
    return ekf.local.north, ekf.local.east


get_local_horizontal_position = by_release(_project_estimate, "keeps_position_local", _local_estimate)
"""Local north and east (m) of the position estimate."""


@kernel
def _global_estimate(ekf):
    return ekf.gpos_lat, ekf.gpos_lon


@kernel
def _reproject_estimate(ekf):
    return reproject_to_global(ekf, ekf.local.north, ekf.local.east)


get_global_horizontal_position = by_release(_global_estimate, "keeps_position_local", _reproject_estimate)
"""Latitude and longitude (rad) of the position estimate."""


@kernel
def _remember_lat_lon(ekf):
    ekf.last_known_lat, ekf.last_known_lon = ekf.gpos_lat, ekf.gpos_lon


@kernel
def _remember_north_east(ekf):
    ekf.local.last_known_north, ekf.local.last_known_east = ekf.local.north, ekf.local.east


remember_horizontal_position = by_release(_remember_lat_lon, "keeps_position_local", _remember_north_east)
"""Note the horizontal position as the last known one."""


@kernel
def _difference_of_lat_lon(ekf):
    return lat_lon_difference(ekf.gpos_lat, ekf.gpos_lon, ekf.gpos_alt, ekf.last_known_lat, ekf.last_known_lon)


@kernel
def _difference_of_north_east(ekf):
    return ekf.local.north - ekf.local.last_known_north, ekf.local.east - ekf.local.last_known_east


offset_from_last_known = by_release(_difference_of_lat_lon, "keeps_position_local", _difference_of_north_east)
"""North and east (m) of the position estimate, seen from the last known one."""


@kernel
def origin_altitude(ekf):
    """Altitude (m) of the origin, 0 while unknown."""
    return ekf.origin.alt if math.isfinite(ekf.origin.alt) else 0.0


@kernel
def _zero(ekf):
    return 0.0


altitude_at_origin = by_release(origin_altitude, "keeps_position_local", _zero)
"""What `ekf.gpos_alt` is (m) at the height of the local origin."""


@kernel
def is_lat_lon_plausible(lat, lon):
    """Whether a latitude and longitude (rad) lie on the globe."""
    return math.isfinite(lat) and math.isfinite(lon) and abs(lat) <= 0.5 * math.pi and abs(lon) <= math.pi


@kernel
def is_altitude_plausible(alt):
    """Whether an altitude (m) lies between the deepest sea and the edge of space."""
    return math.isfinite(alt) and LOWEST_ALTITUDE < alt < HIGHEST_ALTITUDE
