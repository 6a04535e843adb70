"""Small steps of the position: metres north, east and down applied to latitude, longitude and altitude.

The radii of the ellipsoid are looked up again only after the latitude has moved by 1e-7 rad (0.6 m), which changes a
step by less than 1 part in 10⁷. PX4 keeps the altitude and the terrain height in single precision, so that steps of
less than half its resolution (30 µm at 500 m) vanish; the same rounding is applied here, since it is part of what PX4
publishes.

Mirrors `LatLonAlt` of PX4 v1.16 `lib/lat_lon_alt/lat_lon_alt.cpp`. Releases until v1.15 move `ekf.local`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.local_position import POSITION_LIMIT
from fusetune.ekf2.numerics.geodesy import radii_of_curvature
from fusetune.ekf2.numerics.rotations import wrap_pi
from fusetune.ekf2.releases.by_release import by_release

ELLIPSOID_LATITUDE_STEP = 1e-7


@kernel
def refresh_ellipsoid(ekf):
    """Look up radii of curvature, cosine and tangent of the present latitude if it has moved."""
    if abs(ekf.gpos_lat - ekf.ellipsoid_lat_ref) > ELLIPSOID_LATITUDE_STEP or ekf.ellipsoid_meridian_radius == 0.0:
        ekf.ellipsoid_lat_ref = ekf.gpos_lat
        meridian, transverse = radii_of_curvature(ekf.gpos_lat)
        ekf.ellipsoid_meridian_radius = meridian
        ekf.ellipsoid_transverse_radius = transverse
        ekf.ellipsoid_cos_lat = math.cos(ekf.gpos_lat)
        ekf.ellipsoid_tan_lat = math.tan(ekf.gpos_lat)


@kernel
def single_precision(value):
    """The value rounded to single precision, as PX4 stores altitudes."""
    return float(np.float32(value))


@kernel
def _add_to_global_position(ekf, north, east, down):
    refresh_ellipsoid(ekf)
    ekf.gpos_lat = wrap_pi(ekf.gpos_lat + north / (ekf.ellipsoid_meridian_radius + ekf.gpos_alt))
    ekf.gpos_lon = wrap_pi(
        ekf.gpos_lon + east / ((ekf.ellipsoid_transverse_radius + ekf.gpos_alt) * ekf.ellipsoid_cos_lat)
    )
    ekf.gpos_alt = single_precision(ekf.gpos_alt - single_precision(down))


@kernel
def _moved(position, step):
    return min(max(single_precision(position + single_precision(step)), -POSITION_LIMIT), POSITION_LIMIT)


@kernel
def _add_to_local_position(ekf, north, east, down):
    ekf.local.north = _moved(ekf.local.north, north)
    ekf.local.east = _moved(ekf.local.east, east)
    ekf.gpos_alt = _moved(ekf.gpos_alt, -down)


add_to_position = by_release(_add_to_global_position, "keeps_position_local", _add_to_local_position)
"""Move the position estimate by a small step (m)."""
