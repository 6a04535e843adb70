"""Whole tracks in the local map of PX4: `LocalMap.to_local` for many places at once.

Apart from the map itself, which the rules of the workflow read without NumPy.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from fusetune.px4.local_map import EARTH_RADIUS_M, LocalMap


def all_to_local(local: LocalMap, lat_deg: npt.ArrayLike, lon_deg: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """North and east (m), (N, 2), of places (N,), degrees."""
    lat, ref = np.radians(np.asarray(lat_deg, np.float64)), math.radians(local.lat_deg)
    difference = np.radians(np.asarray(lon_deg, np.float64) - local.lon_deg)
    north = math.cos(ref) * np.sin(lat) - math.sin(ref) * np.cos(lat) * np.cos(difference)
    east = np.cos(lat) * np.sin(difference)
    sine = np.hypot(north, east)
    cosine = math.sin(ref) * np.sin(lat) + math.cos(ref) * np.cos(lat) * np.cos(difference)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = EARTH_RADIUS_M * np.where(sine > 0.0, np.arctan2(sine, cosine) / sine, 1.0)
    return np.column_stack([scale * north, scale * east])
