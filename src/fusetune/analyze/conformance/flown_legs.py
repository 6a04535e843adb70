"""How a flight flew the legs of a mission: beside and above them, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import FlownTrack
from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.analyze.conformance.waypoint_passes import WaypointPass
from fusetune.design.missions.route import RouteLeg

Array = npt.NDArray[np.float64]

_SHORTEST_M = 1.0
"""A leg that is shorter along the horizontal is a vertical one, and one that is shorter in all has no direction."""
_LARGEST_SHARE = 0.4
"""Of a leg that a corner may take away at either end."""
_FEWEST = 5


@dataclass(frozen=True)
class LegFigures:
    """How far a flight was from a leg, m, and its speed, m/s.

    Attributes
    ----------
    cross_track_mean, cross_track_95, cross_track_max : of the distance beside the leg, whatever its side
    cross_track_bias : mean with its sign, right of the leg is above 0; of a vertical leg, which has no sides, the
        length of the mean
    height_error_mean, height_error_max : height less that of the leg at the same place; the largest whatever its sign
    speed : mean along the horizontal, of a vertical leg along the vertical
    """

    cross_track_mean: float
    cross_track_95: float
    cross_track_max: float
    cross_track_bias: float
    height_error_mean: float
    height_error_max: float
    speed: float


@dataclass(frozen=True)
class FlownLeg:
    """A leg of a mission, and what a flight made of it.

    Attributes
    ----------
    planned : the leg
    start, stop : when it was flown, µs since boot; None where it was not
    figures : between the bends at its ends; None where it was not flown
    """

    planned: RouteLeg
    start: int | None = None
    stop: int | None = None
    figures: LegFigures | None = None

    @property
    def is_flown(self) -> bool:
        return self.start is not None


def flown_legs(
    track: FlownTrack,
    place: Array,
    route: Sequence[RouteLeg],
    passes: Sequence[WaypointPass],
    settings: ConformanceSettings,
) -> tuple[FlownLeg, ...]:
    """Each leg between the passes at its ends, if both were made and in order.

    Parameters
    ----------
    place : (N, 3) the track about the mission's home, NED, m
    passes : of all waypoints
    """
    when = _times_at_ends(track, place, route, passes, settings)
    found = []
    for index, leg in enumerate(route):
        start, stop = when[index][1], when[index + 1][0]
        if start is None or stop is None or stop <= start:
            found.append(FlownLeg(leg))
            continue
        rows = np.flatnonzero((track.time >= start) & (track.time <= stop))
        figures = leg_figures(leg, place[rows], track.velocity[rows], bends_of(index, passes), settings)
        found.append(FlownLeg(leg, start, stop, figures))
    return tuple(found)


def bends_of(index: int, passes: Sequence[WaypointPass]) -> tuple[float, float]:
    """Length at the start and end of a leg of the route that belongs to the corners there, m."""
    # legs of waypoints follow the take-off, so the corner that ends leg i is that of waypoint i − 1
    before = passes[index - 2].planned.bends_m[1] if 0 <= index - 2 < len(passes) else 0.0
    after = passes[index - 1].planned.bends_m[0] if 0 <= index - 1 < len(passes) else 0.0
    return before, after


_Times = tuple[int | None, int | None]


def _times_at_ends(
    track: FlownTrack,
    place: Array,
    route: Sequence[RouteLeg],
    passes: Sequence[WaypointPass],
    settings: ConformanceSettings,
) -> list[_Times]:
    """When the flight came to the start of each leg and to the end of the last one, and when it left there."""
    visits = [one.visit if one.in_order else None for one in passes]
    first = next((one.time for one in visits if one is not None), None)
    ends: list[_Times] = [_takeoff(track, first), _top(track, place, route[0], first, settings)]
    for one, visit in zip(passes, visits, strict=True):
        if visit is None:
            ends.append((None, None))
        elif one.planned.is_stop:
            ends.append((visit.enter, visit.leave))
        else:
            ends.append((visit.time, visit.time))
    last = next((one.leave for one in reversed(visits) if one is not None), None)
    if route[-2].kind == "return":
        passed = visits[-1].time if visits[-1] is not None else None
        ends.append(_above_landing(track, place, route[-2], passed, settings))
    ends.append(_touchdown(track, last))
    return ends


def _takeoff(track: FlownTrack, first: int | None) -> _Times:
    """Start of the flight in which the first waypoint was passed."""
    begins = [start for start, stop in track.airborne if first is not None and start <= first <= stop]
    known = begins[0] if begins and track.time[0] <= begins[0] else None
    return known, known


def _top(track: FlownTrack, place: Array, leg: RouteLeg, first: int | None, settings: ConformanceSettings) -> _Times:
    """When the climb reached its height."""
    start = _takeoff(track, first)[0]
    if start is None or first is None:
        return None, None
    high = np.flatnonzero(
        (track.time >= start) & (track.time <= first) & (place[:, 2] <= leg.end[2] + settings.height_m)
    )
    time = int(track.time[high[0]]) if high.size else None
    return time, time


def _above_landing(
    track: FlownTrack, place: Array, leg: RouteLeg, last: int | None, settings: ConformanceSettings
) -> _Times:
    """When the flight came above the place of landing, after the last waypoint, and when it left that height."""
    if last is None:
        return None, None
    flat = np.hypot(*(place[:, :2] - leg.end[:2]).T)
    near = np.flatnonzero((track.time > last) & track.is_airborne & (flat <= settings.crossing_m))
    if not near.size:
        return None, None
    sunk = np.flatnonzero(place[near[0] :, 2] > place[near[0], 2] + settings.height_m)
    left = near[0] + max(int(sunk[0]) - 1, 0) if sunk.size else near[0]
    return int(track.time[near[0]]), int(track.time[left])


def _touchdown(track: FlownTrack, last: int | None) -> _Times:
    stops = [stop for start, stop in track.airborne if last is not None and start <= last <= stop]
    known = stops[0] if stops and stops[0] <= track.time[-1] else None
    return known, known


def leg_figures(
    leg: RouteLeg, place: Array, velocity: Array, bends_m: tuple[float, float], settings: ConformanceSettings
) -> LegFigures | None:
    """Distances from a leg between the bends at its ends; None of a leg shorter than a metre, or with few samples.

    Parameters
    ----------
    place, velocity : (N, 3) NED, m and m/s
    bends_m : length at its start and end that belongs to the corners
    """
    way = np.subtract(leg.end, leg.start)
    is_level = bool(np.hypot(way[0], way[1]) > _SHORTEST_M)
    # along the horizontal where the leg has a course, so that an error of height is none of the course
    line = way * (1.0, 1.0, 0.0) if is_level else way * (0.0, 0.0, 1.0)
    length = float(np.linalg.norm(line))
    if length < _SHORTEST_M:
        return None
    direction = line / length
    along = (place - leg.start) @ direction
    # at the ends of a vertical leg the vehicle comes and goes
    bends = [min(one if is_level else settings.height_m, _LARGEST_SHARE * length) for one in bends_m]
    rows = (along >= bends[0]) & (along <= length - bends[1])
    if np.count_nonzero(rows) < _FEWEST:
        return None
    away = place[rows] - leg.start - along[rows, None] * direction
    if is_level:
        side = away @ np.array([-direction[1], direction[0], 0.0])
        beside, bias = np.abs(side), float(side.mean())
        # where it should be at that part of the way
        height_error = leg.start[2] + way[2] * along[rows] / length - place[rows, 2]
        speed = np.hypot(velocity[rows, 0], velocity[rows, 1])
    else:
        beside, bias = np.hypot(away[:, 0], away[:, 1]), float(np.hypot(*away[:, :2].mean(axis=0)))
        height_error = np.zeros(beside.size)
        speed = np.abs(velocity[rows, 2])
    return LegFigures(
        float(beside.mean()), float(np.quantile(beside, 0.95)), float(beside.max()), bias,
        float(height_error.mean()), float(np.abs(height_error).max()), float(speed.mean()),
    )  # fmt: skip
