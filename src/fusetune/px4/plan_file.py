"""QGroundControl's mission files (``.plan``): read and checked by its rules, made and written."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.errors import UserError
from fusetune.px4.plan_commands import AltitudeMode, Command, Frame
from fusetune.px4.plan_rules import (
    FENCE_VERSION,
    MISSION_VERSION,
    PLAN_VERSION,
    RALLY_VERSION,
    SHAPE_VERSION,
    plan_problems,
)
from fusetune.settings.checking import raise_problems
from fusetune.storage.files import atomic_path

FIRMWARE_PX4 = 12
"""MAV_AUTOPILOT_PX4."""
_VEHICLE_QUADROTOR = 2

LARGEST_BYTES = 20_000_000
"""A survey of a large field takes some hundred kilobytes."""
MEND = "Open it in QGroundControl, mend it there and save it again"


@dataclass(frozen=True)
class PlanPosition:
    """A place; altitude in metres above home for items, above mean sea level for the home position itself."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True)
class PlanItem:
    """One mission item: a command with its four parameters, and a place where the command has one.

    `None` as a parameter means "unset" (NaN in MAVLink, null in the file).
    """

    command: Command
    parameters: tuple[float | None, float | None, float | None, float | None] = (0.0, 0.0, 0.0, None)
    position: PlanPosition | None = None


@dataclass(frozen=True)
class PlanCircle:
    """A circle of the geofence; `inclusion` keeps the vehicle within, else out."""

    latitude_deg: float
    longitude_deg: float
    radius_m: float
    inclusion: bool = True


@dataclass(frozen=True)
class PlanPolygon:
    """A polygon of the geofence, its corners as latitude and longitude (degrees)."""

    corners: tuple[tuple[float, float], ...]
    inclusion: bool = True


@dataclass(frozen=True)
class Plan:
    """A mission with the speeds QGroundControl plans with (m/s), and a geofence."""

    home: PlanPosition
    items: tuple[PlanItem, ...]
    cruise_speed_m_s: float = 15.0
    hover_speed_m_s: float = 5.0
    circles: tuple[PlanCircle, ...] = ()
    polygons: tuple[PlanPolygon, ...] = ()


def take_off(position: PlanPosition, pitch_deg: float = 0.0) -> PlanItem:
    """Take-off to the altitude of `position`, heading left as it is."""
    return PlanItem(Command.TAKEOFF, (pitch_deg, 0.0, 0.0, None), position)


def waypoint(
    position: PlanPosition, hold_s: float = 0.0, acceptance_radius_m: float = 0.0, yaw_deg: float | None = None
) -> PlanItem:
    """Waypoint; an acceptance radius of 0 takes the vehicle's own."""
    return PlanItem(Command.WAYPOINT, (hold_s, acceptance_radius_m, 0.0, yaw_deg), position)


def change_speed(ground_speed_m_s: float) -> PlanItem:
    """Ground speed from here on, throttle unchanged."""
    return PlanItem(Command.CHANGE_SPEED, (1.0, ground_speed_m_s, -1.0, 0.0))


def return_to_launch() -> PlanItem:
    """Return to the launch point and land there."""
    return PlanItem(Command.RETURN_TO_LAUNCH, (0.0, 0.0, 0.0, 0.0))


def land(position: PlanPosition) -> PlanItem:
    """Land at a place."""
    return PlanItem(Command.LAND, (0.0, 0.0, 0.0, None), position)


def read_plan(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a plan and check it by QGroundControl's rules.

    Returns
    -------
    The JSON object of the file.

    Raises
    ------
    UserError
        The file cannot be read, is no JSON, or breaks a rule.
    """
    file = Path(path)
    try:
        with file.open("rb") as opened:
            content = opened.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror}", "Check the path and the permissions") from error
    if len(content) > LARGEST_BYTES:
        raise UserError(path, f"is larger than {LARGEST_BYTES // 1_000_000} MB", "Check that it is the right file")
    try:
        document = json.loads(content.decode("utf-8-sig"), parse_constant=_refused, object_pairs_hook=_without_twins)
    except (ValueError, RecursionError) as error:
        reason = "nests too deeply" if isinstance(error, RecursionError) else f"is no JSON that can be meant: {error}"
        raise UserError(path, reason, "Check that it is a plan saved by QGroundControl") from error
    if not isinstance(document, dict):
        raise UserError(path, "holds no JSON object", "Check that it is a plan saved by QGroundControl")
    raise_problems(path, plan_problems(document), MEND)
    return document


def _refused(constant: str) -> None:
    raise ValueError(f"it holds {constant}, which is no JSON number")


def _without_twins(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"the key {next(key for key in keys if keys.count(key) > 1)!r} stands twice in one object")
    return found


def write_plan(path: str | os.PathLike[str], plan: Plan) -> None:
    """Write a plan that QGroundControl opens.

    Raises
    ------
    ValueError
        A number is not finite, or the plan breaks a rule of `plan_problems`.
    """
    write_plan_document(path, plan_document(plan))


def write_plan_document(path: str | os.PathLike[str], document: Mapping[str, Any]) -> None:
    """Write the JSON object of a plan; `ValueError` as of `write_plan`."""
    text = json.dumps(document, indent=4, sort_keys=True, allow_nan=False, ensure_ascii=False)
    problem = next(iter(plan_problems(document)), None)
    if problem is not None:
        raise ValueError(problem)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plan_document(plan: Plan) -> dict[str, Any]:
    """The plan as the JSON object of the file."""
    home = plan.home
    return {
        "fileType": "Plan",
        "geoFence": {
            "circles": [_circle(one) for one in plan.circles],
            "polygons": [_polygon(one) for one in plan.polygons],
            "version": FENCE_VERSION,
        },
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": plan.cruise_speed_m_s,
            "firmwareType": FIRMWARE_PX4,
            "globalPlanAltitudeMode": int(AltitudeMode.RELATIVE),
            "hoverSpeed": plan.hover_speed_m_s,
            "items": _items(plan.items),
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.altitude_m],
            "vehicleType": _VEHICLE_QUADROTOR,
            "version": MISSION_VERSION,
        },
        "rallyPoints": {"points": [], "version": RALLY_VERSION},
        "version": PLAN_VERSION,
    }


def _circle(circle: PlanCircle) -> dict[str, Any]:
    return {
        "circle": {"center": [circle.latitude_deg, circle.longitude_deg], "radius": circle.radius_m},
        "inclusion": circle.inclusion,
        "version": SHAPE_VERSION,
    }


def _polygon(polygon: PlanPolygon) -> dict[str, Any]:
    corners = [list(corner) for corner in polygon.corners]
    return {"inclusion": polygon.inclusion, "polygon": corners, "version": SHAPE_VERSION}


def _items(items: Sequence[PlanItem]) -> list[dict[str, Any]]:
    return [_item(item, number) for number, item in enumerate(items, start=1)]


def _item(item: PlanItem, number: int) -> dict[str, Any]:
    place = item.position
    coordinates = [0.0, 0.0, 0.0] if place is None else [place.latitude_deg, place.longitude_deg, place.altitude_m]
    document: dict[str, Any] = {
        "autoContinue": True,
        "command": int(item.command),
        "doJumpId": number,
        "frame": int(Frame.MISSION if place is None else Frame.GLOBAL_RELATIVE_ALTITUDE),
        "params": [*(_json_number(value) for value in item.parameters), *coordinates],
        "type": "SimpleItem",
    }
    if place is not None:
        document |= {
            "AMSLAltAboveTerrain": None,
            "Altitude": place.altitude_m,
            "AltitudeMode": int(AltitudeMode.RELATIVE),
        }
    return document


def _json_number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
