"""The local map of PX4 for arrays of places."""

from __future__ import annotations

import numpy as np

from fusetune.px4.local_map import EARTH_RADIUS_M
from fusetune.report.flight_data.content import Figures


def local_plane(lat: Figures, lon: Figures, home_lat: float, home_lon: float) -> tuple[Figures, Figures]:
    """North and east of a home, m, of places (N,) in degrees: `fusetune.px4.local_map`, whose sources it shares."""
    phi, ref = np.radians(lat), np.radians(home_lat)
    difference = np.radians(lon - home_lon)
    north = np.cos(ref) * np.sin(phi) - np.sin(ref) * np.cos(phi) * np.cos(difference)
    east = np.cos(phi) * np.sin(difference)
    sine = np.hypot(north, east)
    cosine = np.sin(ref) * np.sin(phi) + np.cos(ref) * np.cos(phi) * np.cos(difference)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = EARTH_RADIUS_M * np.where(sine > 0.0, np.arctan2(sine, cosine) / sine, 1.0)
    return scale * north, scale * east
