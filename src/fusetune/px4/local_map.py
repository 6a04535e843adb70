"""The local map of PX4: north and east of a reference, on a sphere, azimuthal equidistant.

Snyder, Map Projections: A Working Manual (1987), equations 22-4, 22-5 and 25-2 forward, 20-14 and 20-15 backward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

EARTH_RADIUS_M = 6_371_000.0
"""CONSTANTS_RADIUS_OF_EARTH of PX4."""


@dataclass(frozen=True)
class LocalMap:
    """North and east (m) about a reference (degrees, WGS-84)."""

    lat_deg: float
    lon_deg: float

    def to_local(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """North and east (m) of a place (degrees)."""
        lat, ref = math.radians(lat_deg), math.radians(self.lat_deg)
        difference = math.radians(lon_deg - self.lon_deg)
        north = math.cos(ref) * math.sin(lat) - math.sin(ref) * math.cos(lat) * math.cos(difference)
        east = math.cos(lat) * math.sin(difference)
        # the arc from its sine: near the reference the arc cosine would lose half the digits
        sine = math.hypot(north, east)
        cosine = math.sin(ref) * math.sin(lat) + math.cos(ref) * math.cos(lat) * math.cos(difference)
        scale = EARTH_RADIUS_M * (math.atan2(sine, cosine) / sine if sine > 0.0 else 1.0)
        return scale * north, scale * east

    def to_global(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude (degrees) of a place north and east (m) of the reference."""
        arc = math.hypot(north_m, east_m) / EARTH_RADIUS_M
        if arc == 0.0:
            return self.lat_deg, self.lon_deg
        bearing_sin, bearing_cos = east_m / (arc * EARTH_RADIUS_M), north_m / (arc * EARTH_RADIUS_M)
        ref = math.radians(self.lat_deg)
        lat = math.asin(math.cos(arc) * math.sin(ref) + bearing_cos * math.sin(arc) * math.cos(ref))
        east = bearing_sin * math.sin(arc)
        north = math.cos(arc) * math.cos(ref) - bearing_cos * math.sin(arc) * math.sin(ref)
        lon = self.lon_deg + math.degrees(math.atan2(east, north))
        return math.degrees(lat), (lon + 180.0) % 360.0 - 180.0
