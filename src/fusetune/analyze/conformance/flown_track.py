"""Where a flight was, by what its log holds: the vehicle's own estimate, or else its GNSS receiver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.ground_truth import sample_times
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.px4.flight import Flight, TopicTable, select_rows
from fusetune.px4.layouts.estimator_instances import rows_of_primary
from fusetune.px4.local_map import LocalMap

Array = npt.NDArray[np.float64]

TRACK_TOPICS = (
    "vehicle_local_position",
    "estimator_local_position",
    "vehicle_land_detected",
    "estimator_status",
    "estimator_status_flags",
    "estimator_selector_status",
    "vehicle_gps_position",
    "sensor_gps",
)
"""What is read of a saved flight, in the layout of its release."""

TrackSource = Literal["estimate", "gnss", "smoothed", "local"]

STEP_US = 50_000
"""The track is looked at so often: at 20 m/s every metre."""
LONGEST_GAP_US = 2_000_000
"""Between samples further apart nothing is said of the track."""
_BEFORE_TAKEOFF_US = 3_000_000
_FIX_3D = 3
_FEWEST = 10
_NOWHERE_DEG = 1e-9
"""A local origin at 0, 0 is none."""


@dataclass(frozen=True)
class FlownTrack:
    """The track of a flight on an even grid, parted where the log has gaps.

    Attributes
    ----------
    source : `estimate` (vehicle_local_position, estimator_local_position), `gnss`, `smoothed` (`smoothed_track`), or
        `local`, an estimate that has no place on earth
    time : (N,) µs since boot, ascending
    lat, lon : (N,) degrees; NaN of a local estimate
    height : (N,) m above the place of take-off, or above mean sea level where the log begins in the air
    velocity : (N, 3) NED, m/s
    heading : (N,) rad, continuous; NaN where it is not known
    horizontal_sigma, vertical_sigma : (N,) standard deviations that the vehicle claims, m; NaN where it does not
    is_above_takeoff : what `height` is above
    airborne : µs
    """

    source: TrackSource
    time: npt.NDArray[np.int64]
    lat: Array
    lon: Array
    height: Array
    velocity: Array
    heading: Array
    horizontal_sigma: Array
    vertical_sigma: Array
    is_above_takeoff: bool
    airborne: tuple[Interval, ...]

    @cached_property
    def is_airborne(self) -> npt.NDArray[np.bool_]:
        """(N,)"""
        return inside(self.time, self.airborne)

    @property
    def has_place(self) -> bool:
        """Whether it is known where on earth it is."""
        return self.source != "local"

    def about(self, lat_deg: float, lon_deg: float, alt_m: float) -> Array:
        """(N, 3) north, east, down of a home, m; `alt_m` is its altitude, for heights above mean sea level."""
        local = LocalMap(lat_deg, lon_deg)
        places = [local.to_local(*place) for place in zip(self.lat.tolist(), self.lon.tolist(), strict=True)]
        return np.column_stack([places, -(self.height - (0.0 if self.is_above_takeoff else alt_m))])


def parts_of(time: npt.NDArray[np.int64]) -> list[slice]:
    """Rows between the gaps of times (N,), µs."""
    edges = [0, *(np.flatnonzero(np.diff(time) > LONGEST_GAP_US) + 1).tolist(), time.size]
    return [slice(first, stop) for first, stop in pairwise(edges)]


def flown_track(flight: Flight) -> FlownTrack | None:
    """The track of a flight; None where its log holds no place, or never says that it flew.

    Parameters
    ----------
    flight : canonical, with `TRACK_TOPICS`
    """
    airborne = airborne_intervals(flight, rows_of_primary(flight, "estimator_status_flags") or {})
    if not airborne:
        return None
    found = _estimated(flight) or _received(flight) or _estimated(flight, is_global=False)
    return None if found is None else _gridded(found[0], found[1], airborne)


@dataclass(frozen=True)
class _Samples:
    """The columns of `FlownTrack` at the samples of the log; `altitude` is above mean sea level or a local origin."""

    time: npt.NDArray[np.int64]
    lat: Array
    lon: Array
    altitude: Array
    velocity: Array
    heading: Array
    horizontal_sigma: Array
    vertical_sigma: Array


def _estimated(flight: Flight, *, is_global: bool = True) -> tuple[Literal["estimate", "local"], _Samples] | None:
    table = flight.topic("vehicle_local_position")
    if table is None or not table["timestamp"].size:
        table = rows_of_primary(flight, "estimator_local_position")
    if table is None or not {"x", "y", "z", "vx", "vy", "vz", "ref_lat", "ref_lon"} <= set(table):
        return None
    name: Literal["estimate", "local"] = "estimate" if is_global else "local"
    known = np.isfinite(table["x"]) & np.isfinite(table["y"]) & np.isfinite(table["z"])
    if is_global:
        known &= np.abs(table["ref_lat"]) + np.abs(table["ref_lon"]) > _NOWHERE_DEG
    for flag in ("xy_valid", "xy_global") if is_global else ():
        if flag in table:
            known &= table[flag].astype(bool)
    rows = select_rows(table, known)
    if rows["timestamp"].size < _FEWEST:
        return None
    nowhere = np.full(rows["timestamp"].size, np.nan)
    lat, lon = _global_places(rows) if is_global else (nowhere, nowhere)
    altitude = rows["ref_alt"].astype(np.float64) if "ref_alt" in rows else np.zeros(lat.size)
    return name, _Samples(
        sample_times(rows), lat, lon, altitude - rows["z"].astype(np.float64), _columns(rows, "vx", "vy", "vz"),
        _column(rows, "heading"), _column(rows, "eph"), _column(rows, "epv"),
    )  # fmt: skip


def _global_places(rows: TopicTable) -> tuple[Array, Array]:
    """Latitudes and longitudes (N,) of local positions, each about its own reference."""
    lat, lon = (rows[name].astype(np.float64).copy() for name in ("ref_lat", "ref_lon"))
    for ref_lat, ref_lon in {*zip(lat.tolist(), lon.tolist(), strict=True)}:
        one = (rows["ref_lat"] == ref_lat) & (rows["ref_lon"] == ref_lon)
        local = LocalMap(ref_lat, ref_lon)
        places = [local.to_global(x, y) for x, y in zip(rows["x"][one].tolist(), rows["y"][one].tolist(), strict=True)]
        lat[one], lon[one] = np.array(places).T
    return lat, lon


def _received(flight: Flight) -> tuple[Literal["gnss"], _Samples] | None:
    table = flight.topic("vehicle_gps_position")
    if table is None or not {"latitude_deg", "longitude_deg", "altitude_msl_m", "fix_type"} <= set(table):
        return None
    rows = select_rows(table, table["fix_type"] >= _FIX_3D)
    if rows["timestamp"].size < _FEWEST:
        return None
    return "gnss", _Samples(
        rows["timestamp"].astype(np.int64), _column(rows, "latitude_deg"), _column(rows, "longitude_deg"),
        _column(rows, "altitude_msl_m"), _columns(rows, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"),
        np.full(rows["timestamp"].size, np.nan), _column(rows, "eph"), _column(rows, "epv"),
    )  # fmt: skip


def _column(rows: TopicTable, name: str) -> Array:
    return rows[name].astype(np.float64) if name in rows else np.full(rows["timestamp"].size, np.nan)


def _columns(rows: TopicTable, *names: str) -> Array:
    return np.column_stack([_column(rows, name) for name in names])


def _gridded(source: TrackSource, samples: _Samples, airborne: Sequence[Interval]) -> FlownTrack | None:
    first = np.r_[True, np.diff(samples.time) > 0]
    time = samples.time[first]
    grid = np.arange(time[0], time[-1], STEP_US)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, time.size - 1)
    grid = grid[time[after] - time[after - 1] <= LONGEST_GAP_US]
    if grid.size < _FEWEST:
        return None

    def at(values: Array) -> Array:
        return np.interp(grid, time, values[first])

    altitude = at(samples.altitude)
    takeoff = airborne[0][0]
    before = (grid < takeoff) & (grid >= takeoff - _BEFORE_TAKEOFF_US)
    ground = float(np.median(altitude[before])) if before.any() else 0.0
    heading = samples.heading[first]
    known = np.isfinite(heading)
    return FlownTrack(
        source, grid, at(samples.lat), _longitudes(grid, time, samples.lon[first]), altitude - ground,
        np.column_stack([at(axis) for axis in samples.velocity.T]),
        np.interp(grid, time[known], np.unwrap(heading[known])) if known.any() else np.full(grid.size, np.nan),
        at(samples.horizontal_sigma), at(samples.vertical_sigma), bool(before.any()), tuple(airborne),
    )  # fmt: skip


def _longitudes(grid: npt.NDArray[np.int64], time: npt.NDArray[np.int64], lon: Array) -> Array:
    """Interpolated across the date line as well, -180 … 180."""
    return np.asarray((np.interp(grid, time, np.unwrap(lon, period=360.0)) + 180.0) % 360.0 - 180.0)
