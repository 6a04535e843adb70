"""Where a mission may be flown: circles and polygons as of a geofence, and how far and how high at most.

What leaves a fence is told as a sentence; the places are metres from home (`fusetune.px4.local_map`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from fusetune.px4.local_map import LocalMap
from fusetune.settings.declaration import required, setting

Metres = tuple[float, float]
"""North and east of home."""


@dataclass(frozen=True)
class FenceCircle:
    """A circle that the vehicle stays within, or out of."""

    lat: float = required("latitude of the centre, WGS-84", unit="degrees", low=-89.0, high=89.0, filled_in=True)
    lon: float = required("longitude of the centre, WGS-84", unit="degrees", low=-180, high=180, filled_in=True)
    radius_m: float = required("radius", unit="m", above=0, high=100_000)
    inside: bool = setting(True, "true: the vehicle stays within; false: out of it")
    north_m: float | None = setting(
        None, "north of home, instead of lat and lon; home where neither is given", unit="m", low=-20_000, high=20_000
    )
    east_m: float | None = setting(None, "east of home, likewise", unit="m", low=-20_000, high=20_000)


@dataclass(frozen=True)
class FencePolygon:
    """A polygon that the vehicle stays within, or out of."""

    points: tuple[tuple[float, float], ...] = required(
        "corners in order, each latitude and longitude", unit="degrees", at_least=3, filled_in=True
    )
    inside: bool = setting(True, "true: the vehicle stays within; false: out of it")
    points_m: tuple[tuple[float, float], ...] = setting(
        (), "corners as metres north and east of home, instead of `points`", unit="m", low=-20_000, high=20_000
    )


@dataclass(frozen=True)
class Fence:
    """Limits of place and height; those of distance and height are no part of a plan, PX4 has them as parameters."""

    max_distance_m: float | None = setting(
        None, "largest horizontal distance from home (GF_MAX_HOR_DIST)", unit="m", above=0, high=20_000
    )
    max_height_m: float | None = setting(
        None, "largest height above home (GF_MAX_VER_DIST)", unit="m", above=0, high=1000
    )
    circles: tuple[FenceCircle, ...] = setting((), "circles")
    polygons: tuple[FencePolygon, ...] = setting((), "polygons")


@dataclass(frozen=True)
class Breach:
    """A place outside of a fence.

    Attributes
    ----------
    index : of the place among those that were looked at
    limit : what it breaks, in words
    by_m : how far it is beyond
    """

    index: int
    limit: str
    by_m: float


def breaches(fence: Fence, home: LocalMap, places: Sequence[tuple[float, float, float]]) -> tuple[Breach, ...]:
    """The place that is farthest outside, of each limit that is broken.

    Parameters
    ----------
    places : north, east, down from home, m
    """
    found = []
    for limit, beyond in _limits(fence, home):
        by_m, index = max(((beyond(north, east, -down), i) for i, (north, east, down) in enumerate(places)))
        if by_m > ROUNDING_M:
            found.append(Breach(index, limit, by_m))
    return tuple(found)


ROUNDING_M = 1e-3


def _limits(fence: Fence, home: LocalMap) -> Iterator[tuple[str, _Beyond]]:
    if fence.max_distance_m is not None:
        yield f"{fence.max_distance_m:g} m from home", _Distance(fence.max_distance_m)
    if fence.max_height_m is not None:
        yield f"{fence.max_height_m:g} m above home", _Height(fence.max_height_m)
    for number, circle in enumerate(fence.circles):
        words = f"fence.circles[{number}] ({'within' if circle.inside else 'out of'} {circle.radius_m:g} m)"
        yield words, _Circle(home.to_local(circle.lat, circle.lon), circle.radius_m, circle.inside)
    for number, polygon in enumerate(fence.polygons):
        corners = tuple(home.to_local(lat, lon) for lat, lon in polygon.points)
        words = f"fence.polygons[{number}] ({'within' if polygon.inside else 'out of'} it)"
        yield words, _Polygon(corners, polygon.inside)


@dataclass(frozen=True)
class _Distance:
    limit_m: float

    def __call__(self, north: float, east: float, height: float) -> float:
        return math.hypot(north, east) - self.limit_m


@dataclass(frozen=True)
class _Height:
    limit_m: float

    def __call__(self, north: float, east: float, height: float) -> float:
        return height - self.limit_m


@dataclass(frozen=True)
class _Circle:
    centre: Metres
    radius_m: float
    inside: bool

    def __call__(self, north: float, east: float, height: float) -> float:
        beyond = math.hypot(north - self.centre[0], east - self.centre[1]) - self.radius_m
        return beyond if self.inside else -beyond


@dataclass(frozen=True)
class _Polygon:
    corners: tuple[Metres, ...]
    inside: bool

    def __call__(self, north: float, east: float, height: float) -> float:
        edge = polygon_distance_m(self.corners, (north, east))
        beyond = -edge if is_within(self.corners, (north, east)) else edge
        return beyond if self.inside else -beyond


_Beyond = _Distance | _Height | _Circle | _Polygon


def is_within(corners: Sequence[Metres], place: Metres) -> bool:
    """Whether a place lies in a polygon: a ray from it crosses the edges an odd number of times."""
    inside = False
    for (north, east), (other_north, other_east) in _edges(corners):
        if (east > place[1]) != (other_east > place[1]):
            crossing = north + (place[1] - east) * (other_north - north) / (other_east - east)
            inside ^= place[0] < crossing
    return inside


def polygon_distance_m(corners: Sequence[Metres], place: Metres) -> float:
    """Distance of a place from the nearest edge."""
    return min(_from_edge(place, first, second) for first, second in _edges(corners))


def _edges(corners: Sequence[Metres]) -> Iterable[tuple[Metres, Metres]]:
    return zip(corners, [*corners[1:], corners[0]], strict=True)


def _from_edge(place: Metres, first: Metres, second: Metres) -> float:
    along = (second[0] - first[0], second[1] - first[1])
    length = along[0] ** 2 + along[1] ** 2
    offset = (place[0] - first[0], place[1] - first[1])
    share = 0.0 if length == 0.0 else min(max((offset[0] * along[0] + offset[1] * along[1]) / length, 0.0), 1.0)
    return math.hypot(offset[0] - share * along[0], offset[1] - share * along[1])
