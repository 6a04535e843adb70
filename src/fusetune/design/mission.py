"""Missions: where the vehicle flies, how fast, and how it turns.

Latitude and longitude are degrees on WGS-84, altitudes of waypoints are metres above home, headings degrees from
true north, clockwise.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from fusetune.design.config_file import load_schema, raise_problems, validate
from fusetune.design.names import name_problem, one_line
from fusetune.design.yaml_reader import read_yaml

Turn = Literal["fly_by", "fly_over"]
LandingMode = Literal["land", "return"]

FARTHEST_WAYPOINT_M = 20_000.0
"""The simulated flight lays a flat map around home; beyond this a small vehicle does not fly anyway."""
NEAREST_WAYPOINTS_M = 0.5
MEAN_EARTH_RADIUS_M = 6_371_008.8


@dataclass(frozen=True)
class Home:
    """Place of take-off."""

    lat: float
    lon: float
    alt: float
    """Above mean sea level, m."""
    geoid_undulation_m: float = 0.0
    heading_deg: float = 0.0


@dataclass(frozen=True)
class Takeoff:
    """Vertical climb from home."""

    altitude_m: float
    climb_speed_m_s: float = 1.5
    ground_s: float = 15.0
    """Time on the ground before take-off."""


@dataclass(frozen=True)
class Waypoint:
    """A place to fly to."""

    lat: float
    lon: float
    alt: float
    """Above home, m."""
    speed_m_s: float
    """Horizontal speed on the way to the waypoint."""
    turn: Turn = "fly_by"
    hold_s: float = 0.0
    heading_deg: float | None = None
    """Heading on the way to the waypoint; `None` is the course."""


@dataclass(frozen=True)
class Landing:
    """End of the mission."""

    mode: LandingMode
    descent_speed_m_s: float = 0.8
    ground_s: float = 5.0
    """Time on the ground after touch-down."""


@dataclass(frozen=True)
class Mission:
    """A mission."""

    name: str
    home: Home
    takeoff: Takeoff
    waypoints: tuple[Waypoint, ...]
    landing: Landing
    speed_m_s: float = 5.0
    description: str = ""


def load_mission(path: str | os.PathLike[str]) -> Mission:
    """Read and check a mission file.

    Raises
    ------
    UserError
        The file is broken; the message names every key at fault and what was expected.
    """
    document = read_yaml(path)
    validate(document, load_schema("fusetune.design", "mission"), path)
    mission = _mission_of(document)
    problem = name_problem(mission.name)
    raise_problems(path, [f"name: {problem}"] if problem else [], "Choose another name")
    raise_problems(path, _place_problems(mission), "Mend the named waypoints")
    return mission


def _mission_of(document: Mapping[str, Any]) -> Mission:
    speed = float(document.get("speed_m_s", 5.0))
    return Mission(
        name=document["name"],
        home=Home(**document["home"]),
        takeoff=Takeoff(**document["takeoff"]),
        waypoints=tuple(Waypoint(**{"speed_m_s": speed, **entry}) for entry in document["waypoints"]),
        landing=Landing(**document["landing"]),
        speed_m_s=speed,
        description=one_line(document.get("description", "")),
    )


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
