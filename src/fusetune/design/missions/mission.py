"""Missions: where the vehicle flies, how fast, and how it turns.

Latitude and longitude are degrees on WGS-84, altitudes of waypoints are metres above home, headings degrees from
true north, clockwise.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from fusetune.design.names import NAME_PATTERN, name_problem, one_line
from fusetune.settings.checking import raise_problems, read_checked
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of

Turn = Literal["fly_by", "fly_over"]
LandingMode = Literal["land", "return"]

FARTHEST_WAYPOINT_M = 20_000.0
"""The simulated flight lays a flat map around home; beyond this a small vehicle does not fly anyway."""
NEAREST_WAYPOINTS_M = 0.5
MEAN_EARTH_RADIUS_M = 6_371_008.8


@dataclass(frozen=True)
class Home:
    """The place of take-off."""

    lat: float = required("latitude, WGS-84", unit="degrees", low=-89.0, high=89.0)
    lon: float = required("longitude, WGS-84", unit="degrees", low=-180, high=180)
    alt: float = required("altitude above mean sea level", unit="m", low=-500, high=9000)
    geoid_undulation_m: float = setting(
        0.0, "height of mean sea level above the WGS-84 ellipsoid", unit="m", low=-110, high=90
    )
    heading_deg: float = setting(
        0.0, "heading on the ground, from true north, clockwise", unit="degrees", low=-360, high=360
    )


@dataclass(frozen=True)
class Takeoff:
    """The vertical climb from home."""

    altitude_m: float = required("height of the climb above home", unit="m", low=2, high=500)
    climb_speed_m_s: float = setting(1.5, "speed of the climb", unit="m/s", above=0, high=10)
    ground_s: float = setting(15.0, "time on the ground before take-off", unit="s", low=5, high=600)


@dataclass(frozen=True)
class Waypoint:
    """A place to fly to."""

    lat: float = required("latitude, WGS-84", unit="degrees", low=-89.0, high=89.0)
    lon: float = required("longitude, WGS-84", unit="degrees", low=-180, high=180)
    alt: float = required("altitude above home", unit="m", low=1, high=500)
    speed_m_s: float = required(
        "horizontal speed on the way to this waypoint; without it that of the mission",
        unit="m/s",
        above=0,
        high=30,
        filled_in=True,
    )
    turn: Turn = setting("fly_by", "fly_by cuts the corner, fly_over crosses the waypoint")
    hold_s: float = setting(0.0, "time to hover at the waypoint", unit="s", low=0, high=600)
    heading_deg: float | None = setting(
        None,
        "heading on the way to this waypoint, from true north; without it the course",
        unit="degrees",
        low=-360,
        high=360,
    )


@dataclass(frozen=True)
class Landing:
    """How the mission ends."""

    mode: LandingMode = required("land under the last waypoint, or return to home and land there")
    descent_speed_m_s: float = setting(0.8, "speed of the descent", unit="m/s", above=0, high=5)
    ground_s: float = setting(5.0, "time on the ground after touch-down", unit="s", low=3, high=600)


@dataclass(frozen=True)
class Mission:
    """A mission."""

    name: str = required("name of the mission; becomes a file name", pattern=NAME_PATTERN)
    home: Home = required()
    takeoff: Takeoff = required()
    waypoints: tuple[Waypoint, ...] = required("places to fly to, in order", at_least=1)
    landing: Landing = required()
    speed_m_s: float = setting(5.0, "horizontal speed between waypoints", unit="m/s", above=0, high=30)
    description: str = setting("", "what the mission is for, in a sentence")


def load_mission(path: str | os.PathLike[str]) -> Mission:
    """Read and check a mission file; `UserError` as of `read_checked`, and for places that cannot be flown to."""
    document = read_checked(path, schema_of(Mission))
    mission = _mission_of(document)
    problem = name_problem(mission.name)
    raise_problems(path, [f"name: {problem}"] if problem else [], "Choose another name")
    raise_problems(path, _place_problems(mission), "Mend the named waypoints")
    return mission


def _mission_of(document: Mapping[str, Any]) -> Mission:
    speed = {"speed_m_s": document.get("speed_m_s", Mission.speed_m_s)}
    mission = built(Mission, {**document, "waypoints": [speed | entry for entry in document["waypoints"]]})
    return replace(mission, description=one_line(mission.description))


def _place_problems(mission: Mission) -> Iterable[str]:
    for index, waypoint in enumerate(mission.waypoints):
        distance = distance_m(mission.home.lat, mission.home.lon, waypoint.lat, waypoint.lon)
        if distance > FARTHEST_WAYPOINT_M:
            expected = f"expected at most {FARTHEST_WAYPOINT_M / 1000:.0f} km (check lat and lon)"
            yield f"waypoints[{index}] lies {distance / 1000:.1f} km from home; {expected}"
    for index, (first, second) in enumerate(zip(mission.waypoints, mission.waypoints[1:], strict=False), start=1):
        apart = math.hypot(distance_m(first.lat, first.lon, second.lat, second.lon), second.alt - first.alt)
        if apart < NEAREST_WAYPOINTS_M:
            yield (
                f"waypoints[{index}] lies {apart:.2f} m from the one before; expected at least "
                f"{NEAREST_WAYPOINTS_M} m (use hold_s to wait at a place)"
            )


def distance_m(lat_deg: float, lon_deg: float, other_lat_deg: float, other_lon_deg: float) -> float:
    """Great-circle distance on a sphere, m (haversine formula)."""
    lat, other_lat = math.radians(lat_deg), math.radians(other_lat_deg)
    half_lat = math.sin((other_lat - lat) / 2.0)
    half_lon = math.sin(math.radians(other_lon_deg - lon_deg) / 2.0)
    chord = half_lat**2 + math.cos(lat) * math.cos(other_lat) * half_lon**2
    return 2.0 * MEAN_EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(chord)))
