"""The track of a flight on a plain map, with the fixes of its receiver, its mission and what was flown when."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import LONGEST_GAP_US, FlownTrack
from fusetune.px4.flight import Flight
from fusetune.px4.local_map import LocalMap
from fusetune.px4.local_tracks import all_to_local
from fusetune.report.flight_data.content import PlaneTrack, Span, TrackView
from fusetune.report.flight_data.position_frame import PositionFrame
from fusetune.report.flight_data.state_panels import Teller

_FIX_3D = 3


def track_view(
    track: FlownTrack | None,
    conformance: Mapping[str, Any] | None,
    flight: Flight,
    told: Sequence[Teller] = (),
    frame: PositionFrame | None = None,
) -> TrackView | None:
    """What is shown on the map; None where the flight has no track.

    North and east are about the home of the mission that was flown, else about where the track begins.

    Parameters
    ----------
    conformance : `conformance.json`; None where there is none
    flight : canonical
    told, frame : who else tells of the vehicle's place, of a set or the vehicle's own filter, and the frame of that
    """
    if track is None or not track.time.size:
        return None
    compared = conformance or {"missions": (), "flown": None, "manoeuvres": ()}
    mission = next((one for one in compared["missions"] if one["mission"] == compared["flown"]), None)
    manoeuvres = tuple(Span(one["start_us"], one["stop_us"], one["kind"]) for one in compared["manoeuvres"])
    if not track.has_place:
        return TrackView(_local(track, flight), manoeuvres=manoeuvres)
    home = (track.lat[0], track.lon[0]) if mission is None else (mission["home"]["lat"], mission["home"]["lon"])
    north, east = all_to_local(LocalMap(*home), track.lat, track.lon).T
    flown = _parted(PlaneTrack(track.time, north, east, track.height, track.heading))
    fixes = _fixes(flight, home)
    sets = {} if frame is None or frame.origin is None else dict(_places(told, frame.origin, home))
    if track.is_above_takeoff:
        fixes = None if fixes is None else _above(fixes, flown)
        sets = {name: _above(one, flown) for name, one in sets.items()}
    return TrackView(flown, fixes, sets, _corners(mission), manoeuvres)


def _places(
    told: Sequence[Teller], origin: tuple[float, float, float], home: tuple[float, float]
) -> Iterator[tuple[str, PlaneTrack]]:
    """About the home, heights above mean sea level, of all who are of a set."""
    north, east = LocalMap(*home).to_local(*origin[:2])
    for one in told:
        if one.set is not None and np.any(np.isfinite(one.position)):
            place = one.position + np.array([north, east, 0.0])
            nowhere = np.full(one.time.size, np.nan)
            yield one.set, _parted(PlaneTrack(one.time, place[:, 0], place[:, 1], origin[2] - place[:, 2], nowhere))


def _local(track: FlownTrack, flight: Flight) -> PlaneTrack:
    """By the local position of the vehicle, whose origin has no place on earth."""
    table = flight.topic("vehicle_local_position")
    if table is None:
        nowhere = np.full(track.time.size, np.nan)
        return _parted(PlaneTrack(track.time, nowhere, nowhere, track.height, track.heading))
    time = table["timestamp"].astype(np.int64)
    north, east, down = (table[name].astype(np.float64) for name in ("x", "y", "z"))
    heading = table["heading"].astype(np.float64) if "heading" in table else np.full(time.size, np.nan)
    return _parted(PlaneTrack(time, north, east, -down, heading))


def _fixes(flight: Flight, home: tuple[float, float]) -> PlaneTrack | None:
    table = flight.topic("vehicle_gps_position")
    if table is None or not {"latitude_deg", "longitude_deg", "altitude_msl_m", "fix_type"} <= set(table):
        return None
    rows = table["fix_type"] >= _FIX_3D
    if not rows.any():
        return None
    lat, lon, height = (
        table[name][rows].astype(np.float64) for name in ("latitude_deg", "longitude_deg", "altitude_msl_m")
    )
    time = table["timestamp"][rows].astype(np.int64)
    north, east = all_to_local(LocalMap(*home), lat, lon).T
    return PlaneTrack(time, north, east, height, np.full(time.size, np.nan))


def _above(fixes: PlaneTrack, flown: PlaneTrack) -> PlaneTrack:
    """Fixes with heights above take-off: shifted by what lies between both tracks in the median."""
    known = np.isfinite(flown.height)
    inside = (fixes.time >= flown.time[0]) & (fixes.time <= flown.time[-1])
    if not known.any() or not inside.any():
        return fixes
    height = np.interp(fixes.time[inside], flown.time[known], flown.height[known])
    shift = float(np.nanmedian(fixes.height[inside] - height))
    return PlaneTrack(fixes.time, fixes.north, fixes.east, fixes.height - shift, fixes.heading)


def _parted(track: PlaneTrack) -> PlaneTrack:
    """With a row of NaN where nothing is said of the track for long."""
    behind = np.flatnonzero(np.diff(track.time) > LONGEST_GAP_US) + 1
    if not behind.size:
        return track

    def column(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.insert(values.astype(np.float64), behind, np.nan)

    time = np.insert(track.time, behind, track.time[behind - 1] + 100)
    return PlaneTrack(time, *(column(one) for one in (track.north, track.east, track.height, track.heading)))


def _corners(mission: Mapping[str, Any] | None) -> tuple[tuple[float, float], ...]:
    if mission is None or not mission["legs"]:
        return ()
    places = [mission["legs"][0]["start_ned_m"], *(leg["end_ned_m"] for leg in mission["legs"])]
    return tuple((round(north, 3), round(east, 3)) for north, east, _ in places)
