"""QGroundControl's mission files (``.plan``)."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from fusetune.storage.files import atomic_path

_FIRMWARE_PX4 = 12
_VEHICLE_QUADROTOR = 2
_ALTITUDE_RELATIVE = 1


class Command(IntEnum):
    """MAVLink mission commands (MAV_CMD) that plans use."""

    WAYPOINT = 16
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
    CHANGE_SPEED = 178


class Frame(IntEnum):
    """MAVLink frames (MAV_FRAME) that plans use."""

    MISSION = 2
    GLOBAL_RELATIVE_ALTITUDE = 3


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
class Plan:
    """A mission with the speeds QGroundControl plans with (m/s)."""

    home: PlanPosition
    items: tuple[PlanItem, ...]
    cruise_speed_m_s: float = 15.0
    hover_speed_m_s: float = 5.0


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


def write_plan(path: str | os.PathLike[str], plan: Plan) -> None:
    """Write a plan that QGroundControl opens.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    text = json.dumps(plan_document(plan), indent=4, sort_keys=True, allow_nan=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plan_document(plan: Plan) -> dict[str, Any]:
    """The plan as the JSON object of the file."""
    home = plan.home
    return {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": plan.cruise_speed_m_s,
            "firmwareType": _FIRMWARE_PX4,
            "globalPlanAltitudeMode": _ALTITUDE_RELATIVE,
            "hoverSpeed": plan.hover_speed_m_s,
            "items": _items(plan.items),
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.altitude_m],
            "vehicleType": _VEHICLE_QUADROTOR,
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }


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
        document |= {"AMSLAltAboveTerrain": None, "Altitude": place.altitude_m, "AltitudeMode": _ALTITUDE_RELATIVE}
    return document


def _json_number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
