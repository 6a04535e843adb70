"""Geodesy as PX4 v1.16 does it: WGS 84 radii for small steps, a sphere for the local map projection.

Latitudes and longitudes are radians, altitudes and distances metres, north, east and down positive.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.constants import EARTH_SPIN_RATE, RADIUS_OF_EARTH
from fusetune.ekf2.numerics.rotations import wrap_pi

WGS84_EQUATORIAL_RADIUS = 6378137.0
WGS84_ECCENTRICITY = 0.0818191908425
WGS84_ECCENTRICITY2 = WGS84_ECCENTRICITY * WGS84_ECCENTRICITY


@kernel
def radii_of_curvature(lat):
    """Meridian and transverse (prime vertical) radius of curvature (m) of the ellipsoid at a latitude.

    Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed., eqs. 2.105 and 2.106,
    except that PX4 v1.16 divides the meridian radius by w^2.5 instead of w^1.5, w = 1 − e² sin²φ (0.7 % at the poles).
    """
    e_sin = WGS84_ECCENTRICITY * math.sin(lat)
    w = 1.0 - e_sin * e_sin
    root = math.sqrt(w)
    meridian = WGS84_EQUATORIAL_RADIUS * (1.0 - WGS84_ECCENTRICITY2) / (w * w * root)
    return meridian, WGS84_EQUATORIAL_RADIUS / root


@kernel
def metres_per_radian(lat, alt):
    """Metres north per radian of latitude and metres east per radian of longitude."""
    meridian, transverse = radii_of_curvature(lat)
    return meridian + alt, (transverse + alt) * math.cos(lat)


@kernel
def add_to_lat_lon(lat, lon, alt, north, east):
    """Latitude and longitude of the point a small step (m) away, by the radii at the starting point."""
    dn_dlat, de_dlon = metres_per_radian(lat, alt)
    return wrap_pi(lat + north / dn_dlat), wrap_pi(lon + east / de_dlon)


@kernel
def lat_lon_difference(lat, lon, alt, lat_from, lon_from):
    """North and east (m) of a point, seen from another close by; by the radii at the first."""
    dn_dlat, de_dlon = metres_per_radian(lat, alt)
    return wrap_pi(lat - lat_from) * dn_dlat, wrap_pi(lon - lon_from) * de_dlon


@kernel
def project(lat_ref, lon_ref, lat, lon):
    """North and east (m) of a point in the azimuthal equidistant projection about a reference.

    Snyder, Map Projections – A Working Manual (1987), eqs. 22-4, 22-5, 25-2 and 5-3.
    """
    return project_about(math.sin(lat_ref), math.cos(lat_ref), lon_ref, lat, lon)


@kernel
def project_about(sin_ref, cos_ref, lon_ref, lat, lon):
    """`project` for a reference whose latitude's sine and cosine are known."""
    sin_lat, cos_lat = math.sin(lat), math.cos(lat)
    cos_d_lon = math.cos(lon - lon_ref)
    c = math.acos(min(max(sin_ref * sin_lat + cos_ref * cos_lat * cos_d_lon, -1.0), 1.0))
    k = RADIUS_OF_EARTH
    if c > 0.0:
        k = RADIUS_OF_EARTH * c / math.sin(c)
    return k * (cos_ref * sin_lat - sin_ref * cos_lat * cos_d_lon), k * cos_lat * math.sin(lon - lon_ref)


@kernel
def reproject(lat_ref, lon_ref, north, east):
    """Latitude and longitude of the point that `project` maps to (`north`, `east`); Snyder, eqs. 20-14 and 20-15."""
    x, y = north / RADIUS_OF_EARTH, east / RADIUS_OF_EARTH
    c = math.sqrt(x * x + y * y)
    if c == 0.0:
        return lat_ref, lon_ref
    sin_c, cos_c = math.sin(c), math.cos(c)
    sin_ref, cos_ref = math.sin(lat_ref), math.cos(lat_ref)
    lat = math.asin(cos_c * sin_ref + x * sin_c * cos_ref / c)
    lon = lon_ref + math.atan2(y * sin_c, c * cos_ref * cos_c - x * sin_ref * sin_c)
    return lat, wrap_pi(lon)


@kernel
def earth_rate_ned(lat):
    """Rotation rate of the Earth (rad/s, NED) at a latitude."""
    return EARTH_SPIN_RATE * math.cos(lat), 0.0, -EARTH_SPIN_RATE * math.sin(lat)
