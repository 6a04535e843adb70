"""One frame for all positions of a flight: that of the replay, else that of the vehicle's own local position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.px4.flight import TopicTable
from fusetune.px4.local_map import LocalMap
from fusetune.px4.local_tracks import all_to_local
from fusetune.report.flight_data.content import Figures, Times

_FIX_3D = 3
_ORIGIN = ("latitude_deg", "longitude_deg", "altitude_m")
_FIX = ("latitude_deg", "longitude_deg", "altitude_msl_m")
_SPEED = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")


@dataclass(frozen=True)
class Measured:
    """What the receiver measured, at the times for which it holds; NED, (N,) and (N, 3)."""

    time: Times
    velocity: Figures
    position: Figures | None


@dataclass(frozen=True)
class PositionFrame:
    """North, east, down of an origin.

    Attributes
    ----------
    origin : latitude and longitude, deg, and altitude above mean sea level, m; None where it is not known
    """

    origin: tuple[float, float, float] | None

    def of_reference(self, position: Figures, reference: tuple[float, float, float] | None) -> Figures:
        """Positions (N, 3) about another origin; as they are where one of both is not known."""
        if self.origin is None or reference is None or not np.isfinite(reference).all():
            return position
        north, east = LocalMap(*self.origin[:2]).to_local(*reference[:2])
        return position + np.array([north, east, self.origin[2] - reference[2]])

    def of_vehicle(self, local: TopicTable) -> Figures:
        """Of `vehicle_local_position` (N, 3); a row whose origin the log does not tell is taken to have this one."""
        position = np.column_stack([local[name] for name in ("x", "y", "z")]).astype(np.float64)
        if self.origin is None or not {"ref_lat", "ref_lon", "ref_alt"} <= set(local):
            return position
        lat, lon, altitude = (local[name].astype(np.float64) for name in ("ref_lat", "ref_lon", "ref_alt"))
        told = np.isfinite(lat) & np.isfinite(lon) & ((lat != 0.0) | (lon != 0.0))
        if "xy_global" in local:
            told &= local["xy_global"].astype(bool)
        position[told, :2] += all_to_local(LocalMap(*self.origin[:2]), lat[told], lon[told])
        high = np.isfinite(altitude) & (local["z_global"].astype(bool) if "z_global" in local else told)
        position[high, 2] += self.origin[2] - altitude[high]
        return position

    def measured(self, gnss: TopicTable, delay_us: int) -> Measured | None:
        """Fixes of `vehicle_gps_position`, shifted by the delay that EKF2 is told; None without any."""
        if not {"fix_type", *_SPEED} <= set(gnss):
            return None
        rows = gnss["fix_type"] >= _FIX_3D
        if not rows.any():
            return None
        time = gnss["timestamp"][rows].astype(np.int64) - delay_us
        velocity = np.column_stack([gnss[name][rows] for name in _SPEED]).astype(np.float64)
        if self.origin is None or not set(_FIX) <= set(gnss):
            return Measured(time, velocity, None)
        lat, lon, altitude = (gnss[name][rows].astype(np.float64) for name in _FIX)
        places = all_to_local(LocalMap(*self.origin[:2]), lat, lon)
        position = np.column_stack([places, self.origin[2] - altitude])
        return Measured(time, velocity, position)


def position_frame(summary: Mapping[str, Any] | None, local: TopicTable | None) -> PositionFrame:
    """The frame of a flight.

    Parameters
    ----------
    summary : of the replay; None where there is none
    local : `vehicle_local_position`, likewise
    """
    told = (summary or {}).get("origin")
    if told and all(told.get(name) is not None for name in _ORIGIN):
        return PositionFrame((float(told[_ORIGIN[0]]), float(told[_ORIGIN[1]]), float(told[_ORIGIN[2]])))
    if local is None or not {"ref_lat", "ref_lon", "ref_alt"} <= set(local):
        return PositionFrame(None)
    known = np.isfinite(local["ref_lat"]) & (local["ref_lat"] != 0.0)
    if not known.any():
        return PositionFrame(None)
    row = int(np.flatnonzero(known)[-1])
    return PositionFrame((float(local["ref_lat"][row]), float(local["ref_lon"][row]), float(local["ref_alt"][row])))
