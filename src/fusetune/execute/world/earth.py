"""The earth that the simulated vehicle flies on: WGS-84 ellipsoid, its rotation, gravity and magnetic field."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from pygeomag import GeoMag

SEMI_MAJOR_AXIS_M = 6_378_137.0
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
EARTH_RATE_RAD_S = 7.292115e-5
GRAVITATIONAL_CONSTANT_M3_S2 = 3.986004418e14
EQUATORIAL_GRAVITY_M_S2 = 9.7803253359
SOMIGLIANA_CONSTANT = 0.00193185265241
MAP_RADIUS_M = 6_371_000.0
"""Radius of the sphere of PX4's map projection."""
NANOTESLA_PER_GAUSS = 1e5


def ecef_from_geodetic(lat_rad: npt.ArrayLike, lon_rad: npt.ArrayLike, height_m: npt.ArrayLike) -> np.ndarray:
    """Earth-centred, earth-fixed position, (…, 3) m, from latitude, longitude and height above the ellipsoid."""
    lat_rad, lon_rad, height_m = np.asarray(lat_rad), np.asarray(lon_rad), np.asarray(height_m)
    sin_lat, cos_lat = np.sin(lat_rad), np.cos(lat_rad)
    prime_vertical = SEMI_MAJOR_AXIS_M / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin_lat**2)
    return np.stack(
        [
            (prime_vertical + height_m) * cos_lat * np.cos(lon_rad),
            (prime_vertical + height_m) * cos_lat * np.sin(lon_rad),
            (prime_vertical * (1.0 - ECCENTRICITY_SQUARED) + height_m) * sin_lat,
        ],
        axis=-1,
    )


def geodetic_from_ecef(position_ecef: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Latitude (rad), longitude (rad) and height above the ellipsoid (m) of (…, 3) earth-fixed positions.

    Bowring's formula with the parametric latitude improved once more; below a nanometre for all heights of flight.
    """
    x, y, z = position_ecef[..., 0], position_ecef[..., 1], position_ecef[..., 2]
    distance = np.hypot(x, y)
    semi_minor = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
    second_eccentricity_squared = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
    parametric = np.arctan2(z * SEMI_MAJOR_AXIS_M, distance * semi_minor)
    lat = parametric
    for _ in range(2):
        lat = np.arctan2(
            z + second_eccentricity_squared * semi_minor * np.sin(parametric) ** 3,
            distance - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M * np.cos(parametric) ** 3,
        )
        parametric = np.arctan2((1.0 - FLATTENING) * np.sin(lat), np.cos(lat))
    sin_lat = np.sin(lat)
    # Holds at the poles too, where distance / cos(lat) does not.
    height = distance * np.cos(lat) + z * sin_lat - SEMI_MAJOR_AXIS_M * np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin_lat**2)
    return lat, np.arctan2(y, x), height


def ned_axes(lat_rad: npt.ArrayLike, lon_rad: npt.ArrayLike) -> np.ndarray:
    """Rotation from local north-east-down to the earth-fixed frame, (…, 3, 3)."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat_rad), np.cos(lat_rad), np.sin(lon_rad), np.cos(lon_rad)
    zero = np.zeros_like(sin_lat)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    east = np.stack([-sin_lon, cos_lon, zero], axis=-1)
    down = np.stack([-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat], axis=-1)
    return np.stack([north, east, down], axis=-1)


def normal_gravity(lat_rad: np.ndarray, height_m: np.ndarray) -> np.ndarray:
    """Gravity along the ellipsoid's vertical, m/s², centrifugal part included.

    Somigliana's formula with the second-order height reduction of WGS-84 (NIMA TR8350.2, equations 4-1 and 4-3).
    """
    sin_squared = np.sin(lat_rad) ** 2
    surface = (
        EQUATORIAL_GRAVITY_M_S2
        * (1.0 + SOMIGLIANA_CONSTANT * sin_squared)
        / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin_squared)
    )
    semi_minor = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
    ratio = EARTH_RATE_RAD_S**2 * SEMI_MAJOR_AXIS_M**2 * semi_minor / GRAVITATIONAL_CONSTANT_M3_S2
    linear = 2.0 / SEMI_MAJOR_AXIS_M * (1.0 + FLATTENING + ratio - 2.0 * FLATTENING * sin_squared)
    return surface * (1.0 - linear * height_m + 3.0 / SEMI_MAJOR_AXIS_M**2 * height_m**2)


@dataclass(frozen=True)
class TangentFrame:
    """North-east-down axes fixed to the earth at one place; the mission is planned and flown in them.

    Being fixed to the earth, positions in it have the earth-fixed velocity and acceleration as plain derivatives.
    """

    lat_rad: float
    lon_rad: float
    height_m: float
    """Above the ellipsoid."""

    @cached_property
    def origin_ecef(self) -> np.ndarray:
        """Place of the origin, (3,) m."""
        return ecef_from_geodetic(self.lat_rad, self.lon_rad, self.height_m)

    @cached_property
    def axes(self) -> np.ndarray:
        """Rotation from this frame to the earth-fixed one, (3, 3)."""
        return ned_axes(self.lat_rad, self.lon_rad)

    @cached_property
    def earth_rate(self) -> np.ndarray:
        """Rotation of the earth in this frame, (3,) rad/s."""
        return np.asarray(self.axes.T @ np.array([0.0, 0.0, EARTH_RATE_RAD_S]))

    def from_geodetic(self, lat_rad: npt.ArrayLike, lon_rad: npt.ArrayLike, height_m: npt.ArrayLike) -> np.ndarray:
        """Position in this frame, (…, 3) m."""
        return np.asarray((ecef_from_geodetic(lat_rad, lon_rad, height_m) - self.origin_ecef) @ self.axes)

    def to_geodetic(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Latitude (rad), longitude (rad) and ellipsoidal height (m) of (…, 3) positions in this frame."""
        return geodetic_from_ecef(self.origin_ecef + position @ self.axes.T)

    def local_axes(self, lat_rad: np.ndarray, lon_rad: np.ndarray) -> np.ndarray:
        """Rotation from local north-east-down at other places to this frame, (…, 3, 3)."""
        return np.asarray(self.axes.T @ ned_axes(lat_rad, lon_rad))

    def gravity(self, position: np.ndarray) -> np.ndarray:
        """Gravity at (N, 3) positions of this frame, (N, 3) m/s², centrifugal part included."""
        lat, lon, height = self.to_geodetic(position)
        return normal_gravity(lat, height)[:, None] * self.local_axes(lat, lon)[..., 2]


def map_projection(
    lat_rad: np.ndarray, lon_rad: np.ndarray, ref_lat_rad: float, ref_lon_rad: float
) -> tuple[np.ndarray, np.ndarray]:
    """North and east (m) of a place on PX4's local map: azimuthal equidistant on a sphere of 6371 km.

    Snyder, Map Projections: A Working Manual (1987), equations 22-4, 22-5 and 25-2.
    """
    difference = lon_rad - ref_lon_rad
    sin_lat, cos_lat, cos_difference = np.sin(lat_rad), np.cos(lat_rad), np.cos(difference)
    north = np.cos(ref_lat_rad) * sin_lat - np.sin(ref_lat_rad) * cos_lat * cos_difference
    east = cos_lat * np.sin(difference)
    # The arc from its sine: near the reference the arc cosine would lose half the digits.
    sine = np.hypot(north, east)
    cosine = np.sin(ref_lat_rad) * sin_lat + np.cos(ref_lat_rad) * cos_lat * cos_difference
    arc = np.arctan2(sine, cosine)
    scale = np.divide(arc, sine, out=np.ones_like(arc), where=sine > 0.0) * MAP_RADIUS_M
    return scale * north, scale * east


def magnetic_field_ned(lat_deg: float, lon_deg: float, height_m: float, date: datetime.date) -> np.ndarray:
    """Earth's magnetic field of the World Magnetic Model, north, east, down, (3,) Gauss."""
    year = date.year + (date - datetime.date(date.year, 1, 1)).days / 365.25
    epoch = min(max(5 * (date.year // 5), 2010), 2025)
    model = GeoMag(coefficients_file="wmm/WMM_2015v2.COF" if epoch == 2015 else f"wmm/WMM_{epoch}.COF")
    field = model.calculate(lat_deg, lon_deg, height_m * 1e-3, year)
    return np.array([field.x, field.y, field.z]) / NANOTESLA_PER_GAUSS
