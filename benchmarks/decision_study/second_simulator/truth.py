"""The true motion: what follows from the path by differentiation, and the place on the earth where it is flown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

from .path import Path

Array = npt.NDArray[np.float64]

STEP_S = 0.001
LAT_DEG, LON_DEG, ALT_M, UNDULATION_M = -27.47, 153.02, 42.0, 39.5
"""Home: above mean sea level, and the geoid above the ellipsoid."""
GRAVITY_M_S2 = 9.7913
"""Of normal gravity at this latitude (WGS-84)."""
EARTH_RATE = 7.292115e-5 * np.array([np.cos(np.radians(LAT_DEG)), 0.0, -np.sin(np.radians(LAT_DEG))])
MERIDIAN_RADIUS_M, NORMAL_RADIUS_M = 6_349_000.0, 6_382_685.0
"""Radii of curvature of the ellipsoid at this latitude; over a hundred metres the earth is flat but for its turning."""
MAP_RADIUS_M = 6_371_000.0
"""Of the sphere on which PX4 draws its map."""
DRAG_1_S = 0.28
GROUNDTRUTH_EVERY = 20


@dataclass(frozen=True)
class PlaceAboard:
    """Where a place aboard is and how it moves, (N, 3) NED."""

    position: Array
    velocity: Array


@dataclass(frozen=True)
class Truth:
    """The motion at N instants, `STEP_S` apart; frames NED at home and FRD.

    Attributes
    ----------
    position, velocity, acceleration : (N, 3)
    attitude : N rotations, body → NED
    specific_force : (N, 3) m/s² in the body frame
    airspeed : (N,) m/s
    """

    path: Path
    position: Array
    velocity: Array
    acceleration: Array
    attitude: Rotation
    specific_force: Array
    airspeed: Array

    @property
    def time_s(self) -> Array:
        return self.path.time_s

    def beside(self, arm: Array) -> PlaceAboard:
        """Motion of a place aboard, (3,) m from the IMU in the body frame: turning adds to its velocity."""
        if not arm.any():
            return PlaceAboard(self.position, self.velocity)
        arm_ned = self.attitude.apply(arm)
        return PlaceAboard(self.position + arm_ned, self.velocity + np.gradient(arm_ned, STEP_S, axis=0))

    def at(self, time_s: Array, values: Array) -> Array:
        """Values (N,) or (N, D) at other times; linear over a millisecond."""
        if values.ndim == 1:
            return np.interp(time_s, self.time_s, values)
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in values.T])

    def attitude_at(self, time_s: Array) -> Rotation:
        """Attitude at other times."""
        return Slerp(self.time_s, self.attitude)(np.clip(time_s, self.time_s[0], self.time_s[-1]))


def true_motion(path: Path, wind: Array) -> Truth:
    """Differentiate a path; the rotors push along the body's z axis against gravity, inertia and drag.

    Parameters
    ----------
    wind : (3,) NED, m/s
    """
    position, velocity, acceleration = (path.position[:, order].T for order in range(3))
    coriolis = 2.0 * np.cross(EARTH_RATE, velocity)
    force = acceleration + coriolis - np.array([0.0, 0.0, GRAVITY_M_S2])
    through_air = (velocity - wind) * path.lift[:, None]
    thrust = force + DRAG_1_S * through_air
    attitude = _pointing(thrust, path.yaw[0])
    return Truth(
        path,
        position,
        velocity,
        acceleration,
        attitude,
        np.asarray(attitude.inv().apply(force)),
        np.linalg.norm(through_air, axis=1),
    )


def _pointing(thrust: Array, yaw: Array) -> Rotation:
    """The attitude whose z axis points against the thrust, and whose x axis lies over the direction of the yaw."""
    down = -thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    sideways = np.column_stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)])
    forward = np.cross(sideways, down)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([forward, np.cross(down, forward), down], axis=-1))


def geodetic(position: Array) -> tuple[Array, Array, Array]:
    """Latitude and longitude, deg, and altitude above mean sea level, m, of positions (M, 3)."""
    lat = LAT_DEG + np.degrees(position[:, 0] / MERIDIAN_RADIUS_M)
    lon = LON_DEG + np.degrees(position[:, 1] / (NORMAL_RADIUS_M * np.cos(np.radians(LAT_DEG))))
    return lat, lon, ALT_M - position[:, 2]


def on_the_map(position: Array) -> tuple[Array, Array]:
    """x and y of positions (M, 3) on PX4's spherical map about home, m."""
    lat, lon, _ = geodetic(position)
    north = np.radians(lat - LAT_DEG) * MAP_RADIUS_M
    return north, np.radians(lon - LON_DEG) * MAP_RADIUS_M * np.cos(np.radians(LAT_DEG))
