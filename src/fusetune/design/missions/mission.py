"""Missions: where the vehicle flies, how fast, and how it turns.

Latitude and longitude are degrees on WGS-84, altitudes of waypoints are metres above home, headings degrees from
true north, clockwise. A mission is read from a file of our own or from a plan of QGroundControl; places that a file
gives in metres from home are latitude and longitude from there on.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from fusetune.design.missions.fence import Fence, breaches
from fusetune.design.missions.plan_reading import PLAN_SUFFIX, MissionPlan, read_mission_plan
from fusetune.design.missions.purpose import Field, shapes_for
from fusetune.design.missions.shapes import Point, shape_points
from fusetune.design.names import NAME_PATTERN, name_problem, one_line
from fusetune.px4.local_map import LocalMap
from fusetune.settings.checking import raise_problems, read_checked, validate
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of

Turn = Literal["fly_by", "fly_over"]
LandingMode = Literal["land", "return", "pilot"]

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

    lat: float = required("latitude, WGS-84", unit="degrees", low=-89.0, high=89.0, filled_in=True)
    lon: float = required("longitude, WGS-84", unit="degrees", low=-180, high=180, filled_in=True)
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
    north_m: float | None = setting(
        None, "north of home, with east_m instead of lat and lon", unit="m", low=-20_000, high=20_000
    )
    east_m: float | None = setting(
        None, "east of home, with north_m instead of lat and lon", unit="m", low=-20_000, high=20_000
    )


@dataclass(frozen=True)
class Landing:
    """How the mission ends."""

    mode: LandingMode = required(
        "land under the last waypoint, return to home and land there, or hover at the last waypoint until the pilot "
        "takes over"
    )
    descent_speed_m_s: float = setting(0.8, "speed of the descent", unit="m/s", above=0, high=5)
    ground_s: float = setting(5.0, "time on the ground after touch-down", unit="s", low=3, high=600)


@dataclass(frozen=True)
class Mission:
    """A mission."""

    name: str = required("name of the mission; becomes a file name", pattern=NAME_PATTERN)
    home: Home = required()
    takeoff: Takeoff = required()
    waypoints: tuple[Waypoint, ...] = required(
        "places to fly to, in order; may be left out where there are shapes or a purpose", at_least=1, filled_in=True
    )
    landing: Landing = required()
    speed_m_s: float = setting(5.0, "horizontal speed between waypoints", unit="m/s", above=0, high=30)
    description: str = setting("", "what the mission is for, in a sentence")
    fence: Fence | None = setting(None, "where it may be flown")
    shapes: tuple[Mapping[str, Any], ...] = setting((), "shapes that are flown behind the waypoints, see below")
    purpose: tuple[str, ...] = setting(
        (), "parameters that the mission is to tell apart: shapes for them are flown behind the other ones"
    )
    field_m: float = setting(
        60.0, "side of the square around home that shapes for a purpose stay in", unit="m", low=20, high=1000
    )
    plan: MissionPlan | None = None
    """The plan that it was read from; None of a file of our own."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What its plan holds beside what is flown."""
        return self.plan.notes if self.plan is not None else ()


def load_mission(path: str | os.PathLike[str]) -> Mission:
    """Read and check a mission file or a plan of QGroundControl.

    Raises
    ------
    UserError
        As of `read_checked` or `read_mission_plan`, and for places that cannot be flown to or lie outside of the fence.
    """
    if Path(path).suffix.casefold() == PLAN_SUFFIX:
        return mission_of_plan(read_mission_plan(path), path)
    return mission_of(read_checked(path, schema_of(Mission)), path)


def mission_of_plan(plan: MissionPlan, path: str | os.PathLike[str]) -> Mission:
    """The mission that a plan flies; `UserError` as of `load_mission`."""
    schema = schema_of(Waypoint)
    for label, waypoint in zip(plan.labels, plan.keys["waypoints"], strict=True):
        validate(waypoint, schema, f"{os.fspath(path)}, {label}")
    validate(plan.keys, schema_of(Mission), path)
    return replace(mission_of(plan.keys, path, plan.labels), plan=plan)


def mission_of(document: Mapping[str, Any], path: str | os.PathLike[str], labels: Sequence[str] = ()) -> Mission:
    """A mission from the keys of a file, which the schema allows; `UserError` as of `load_mission`.

    Parameters
    ----------
    path : named in messages
    labels : what messages call the waypoints that the document holds; without them by their place in it
    """
    home = built(Home, document["home"])
    local, speed = LocalMap(home.lat, home.lon), document.get("speed_m_s", Mission.speed_m_s)
    problems: list[str] = []
    entries = [
        (label, {"speed_m_s": speed} | _placed(entry, local, label, problems))
        for label, entry in zip(
            labels or [f"waypoints[{index}]" for index in range(len(document.get("waypoints", ())))],
            document.get("waypoints", ()),
            strict=True,
        )
    ]
    raise_problems(path, problems, "Give lat and lon, or north_m and east_m")
    shapes = [*document.get("shapes", ()), *_for_purpose(document, path)]
    for label, point in shape_points(shapes, speed, path):
        entry = _entry(point, local)
        # a shape may begin where the one before ended
        if not (entries and _is_no_way(entries[-1][1], entry)):
            entries.append((label, entry))
    if not entries:
        raise_problems(path, ["there is nowhere to fly to"], "Give waypoints, shapes or a purpose")
    keys = {key: value for key, value in document.items() if key != "shapes"}
    mission = built(Mission, {**keys, "waypoints": [one for _, one in entries], **_fence(document, local, path)})
    mission = replace(mission, description=one_line(mission.description))
    problem = name_problem(mission.name)
    raise_problems(path, [f"name: {problem}"] if problem else [], "Choose another name")
    names = [label for label, _ in entries]
    raise_problems(path, _place_problems(mission, names), "Mend the named waypoints")
    raise_problems(path, _fence_problems(mission, names), "Move the named waypoints, or widen the fence")
    return mission


def _for_purpose(document: Mapping[str, Any], path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    if not document.get("purpose"):
        return []
    side_m = document.get("field_m", Mission.field_m)
    return shapes_for(document["purpose"], Field(side_m, document["takeoff"]["altitude_m"]), path)


def _placed(entry: Mapping[str, Any], local: LocalMap, label: str, problems: list[str]) -> dict[str, Any]:
    """An entry with latitude and longitude."""
    rest = {key: value for key, value in entry.items() if key not in ("north_m", "east_m")}
    given = [key for key in ("lat", "lon", "north_m", "east_m") if entry.get(key) is not None]
    if given == ["north_m", "east_m"]:
        lat, lon = local.to_global(entry["north_m"], entry["east_m"])
        return rest | {"lat": lat, "lon": lon}
    if given != ["lat", "lon"]:
        problems.append(
            f"{label} gives {' and '.join(given) or 'no place'}; expected lat and lon, or north_m and east_m"
        )
    return rest


def _is_no_way(first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    """Whether an entry asks for nothing after another: it neither leads elsewhere nor waits nor turns."""
    stays = second.get("heading_deg") is None and not second.get("hold_s")
    return stays and _apart_m(first, second) < NEAREST_WAYPOINTS_M


def _apart_m(first: Mapping[str, Any], second: Mapping[str, Any]) -> float:
    along = distance_m(first["lat"], first["lon"], second["lat"], second["lon"])
    return math.hypot(along, second["alt"] - first["alt"])


def _entry(point: Point, local: LocalMap) -> dict[str, Any]:
    keys = asdict(point)
    lat, lon = local.to_global(keys.pop("north_m"), keys.pop("east_m"))
    return {"lat": lat, "lon": lon, "alt": keys.pop("height_m")} | keys


def _fence(document: Mapping[str, Any], local: LocalMap, path: str | os.PathLike[str]) -> dict[str, Any]:
    """The fence with latitude and longitude; nothing where there is none."""
    fence = document.get("fence")
    if fence is None:
        return {}
    problems: list[str] = []
    circles, polygons = [], []
    for number, circle in enumerate(fence.get("circles", ())):
        about_home = {} if set(circle) & {"lat", "lon", "north_m", "east_m"} else {"north_m": 0.0, "east_m": 0.0}
        circles.append(_placed(circle | about_home, local, f"fence.circles[{number}]", problems))
    for number, polygon in enumerate(fence.get("polygons", ())):
        corners = polygon.get("points_m", ())
        if bool(corners) == bool(polygon.get("points")):
            problems.append(f"fence.polygons[{number}]: expected either points or points_m")
        elif corners and len(corners) < 3:
            problems.append(f"fence.polygons[{number}].points_m has {len(corners)} corners; expected at least 3")
        points = [local.to_global(*corner) for corner in corners] if corners else polygon.get("points", ())
        polygons.append({"points": points, "inside": polygon.get("inside", True)})
    raise_problems(path, problems, "Mend the fence")
    return {"fence": {**fence, "circles": circles, "polygons": polygons}}


def _place_problems(mission: Mission, labels: Sequence[str]) -> Iterable[str]:
    for label, waypoint in zip(labels, mission.waypoints, strict=True):
        distance = distance_m(mission.home.lat, mission.home.lon, waypoint.lat, waypoint.lon)
        if distance > FARTHEST_WAYPOINT_M:
            expected = f"expected at most {FARTHEST_WAYPOINT_M / 1000:.0f} km (check lat and lon)"
            yield f"{label} lies {distance / 1000:.1f} km from home; {expected}"
    pairs = zip(labels[1:], mission.waypoints, mission.waypoints[1:], strict=False)
    for label, first, second in pairs:
        if _is_no_way(vars(first), vars(second)):
            yield (
                f"{label} lies {_apart_m(vars(first), vars(second)):.2f} m from the one before; expected at least "
                f"{NEAREST_WAYPOINTS_M} m (use hold_s to wait at a place, heading_deg to turn)"
            )


def _fence_problems(mission: Mission, labels: Sequence[str]) -> Iterator[str]:
    """Waypoints outside of the fence; whether the way between them leaves it follows from how it is flown."""
    if mission.fence is None:
        return
    local = LocalMap(mission.home.lat, mission.home.lon)
    places = [(*local.to_local(one.lat, one.lon), -one.alt) for one in mission.waypoints]
    for breach in breaches(mission.fence, local, [(0.0, 0.0, -mission.takeoff.altitude_m), *places]):
        where = labels[breach.index - 1] if breach.index else "take-off"
        yield f"{where} lies {breach.by_m:.1f} m outside of {breach.limit}"


def distance_m(lat_deg: float, lon_deg: float, other_lat_deg: float, other_lon_deg: float) -> float:
    """Great-circle distance on a sphere, m (haversine formula)."""
    lat, other_lat = math.radians(lat_deg), math.radians(other_lat_deg)
    half_lat = math.sin((other_lat - lat) / 2.0)
    half_lon = math.sin(math.radians(other_lon_deg - lon_deg) / 2.0)
    chord = half_lat**2 + math.cos(lat) * math.cos(other_lat) * half_lon**2
    return 2.0 * MEAN_EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(chord)))
