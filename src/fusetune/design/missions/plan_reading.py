"""What a QGroundControl plan flies, in the words of a mission file.

Items are followed as PX4 follows them: one after the other, through surveys and corridors, and back where one jumps.
What a mission does not say (camera, gimbal, region of interest, rally points) is told in a note; it stays in the plan,
which is written as it was read (`MissionPlan.document`).
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusetune.errors import UserError
from fusetune.px4.local_map import LocalMap
from fusetune.px4.plan_commands import ABOVE_SEA, ABOVE_TERRAIN, BY_PX4, Command, flat_items
from fusetune.px4.plan_file import FIRMWARE_PX4, read_plan
from fusetune.px4.plan_rules import DEFAULT_SPEED

PLAN_SUFFIX = ".plan"

FLY_OVER_ACCEPTANCE_M = 0.5
"""PX4 turns once it is this near, so a small radius makes it cross the waypoint; 0 leaves the vehicle's own."""
DEFAULT_HOVER_SPEED_M_S = 5.0
"""Where a plan does not say it; MPC_XY_CRUISE of PX4."""
SAME_PLACE_M = 1.0
MOST_STEPS = 20_000

_MULTICOPTERS = (0, 2, 13, 14, 15, 29, 35)
"""MAV_TYPE: generic, quadrotor, hexarotor, octorotor, tricopter, dodecarotor, decarotor."""
_OTHER_FIRMWARE = {3: "ArduPilot"}
_OTHER_VEHICLES = {1: "a fixed-wing aircraft", 4: "a helicopter", 10: "a rover", 11: "a boat", 12: "a submarine"}
_VTOL = range(19, 26)
_FIXED_WING_PATTERNS = ("fwLandingPattern", "vtolLandingPattern")
_LOOKS = {Command.SET_ROI, Command.SET_ROI_LOCATION, Command.SET_ROI_NEXT}
_ANSWERS = {
    Command.CONDITION_YAW: "give the waypoint a heading instead",
    Command.CONDITION_DELAY: "give the waypoint a hold instead",
    Command.LOITER_TURNS: "multicopters do not circle; hold instead",
}
_FIXED_WING_COMMANDS = {
    Command.VTOL_TAKEOFF, Command.VTOL_LAND, Command.VTOL_TRANSITION, Command.LOITER_TO_ALTITUDE,
}  # fmt: skip


@dataclass(frozen=True)
class MissionPlan:
    """A plan as it was read, and what it flies.

    Attributes
    ----------
    document : the JSON object of the file
    keys : home, takeoff, waypoints, landing, speed_m_s, fence and name as a mission file has them
    labels : of each waypoint, the place in the plan that it comes from
    notes : what the plan holds and a mission does not say, in sentences
    """

    document: Mapping[str, Any]
    keys: dict[str, Any]
    labels: tuple[str, ...]
    notes: tuple[str, ...]


def read_mission_plan(path: str | os.PathLike[str]) -> MissionPlan:
    """Read a plan.

    Raises
    ------
    UserError
        As of `read_plan`; the plan is for another vehicle or autopilot, follows terrain, or holds what PX4 refuses or
        what never ends.
    """
    return followed_plan(read_plan(path), path)


def followed_plan(document: Mapping[str, Any], path: str | os.PathLike[str]) -> MissionPlan:
    """What the JSON object of a plan flies, which keeps the rules; `UserError` as of `read_mission_plan`."""
    _check_vehicle(document["mission"], path)
    return _Follower(document, path).followed()


def mission_name(path: str | os.PathLike[str]) -> str:
    """The name of a file as that of a mission: other characters become ``_``."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", Path(path).stem).strip("_-")[:64]
    return name or "plan"


def _check_vehicle(mission: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    firmware, vehicle = int(mission["firmwareType"]), int(mission.get("vehicleType", 2))
    if firmware not in (0, FIRMWARE_PX4):
        whose = _OTHER_FIRMWARE.get(firmware, "another autopilot")
        raise UserError(
            path,
            f"is a plan for {whose} (firmwareType {firmware}); expected PX4 ({FIRMWARE_PX4})",
            "Plan it for PX4 in QGroundControl: commands and their meaning differ",
        )
    if vehicle not in _MULTICOPTERS:
        whose = "a VTOL" if vehicle in _VTOL else _OTHER_VEHICLES.get(vehicle, "another kind of vehicle")
        raise UserError(
            path, f"is a plan for {whose} (vehicleType {vehicle}); expected a multicopter", "Plan it for a multicopter"
        )


@dataclass
class _Follower:
    """Follows the items of a plan."""

    document: Mapping[str, Any]
    path: str | os.PathLike[str]
    waypoints: list[dict[str, Any]] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    takeoff_m: float | None = None
    landing: str | None = None

    def __post_init__(self) -> None:
        mission = self.document["mission"]
        self.home = [float(one) for one in mission["plannedHomePosition"]]
        self.hover_speed_m_s = float(mission.get("hoverSpeed", DEFAULT_HOVER_SPEED_M_S))
        self.speed_m_s = self.hover_speed_m_s
        self.place = (self.home[0], self.home[1])

    def followed(self) -> MissionPlan:
        """All that the plan flies."""
        self._check_complex_items()
        for label, item in self._in_order():
            self._fly(label, item)
            if self.landing is not None:
                break
        self._check_end()
        keys: dict[str, Any] = {
            "name": mission_name(self.path),
            "home": dict(zip(("lat", "lon", "alt"), self.home, strict=True)),
            "speed_m_s": self.hover_speed_m_s,
            "takeoff": {"altitude_m": self.takeoff_m},
            "waypoints": self.waypoints,
            "landing": {"mode": self.landing or "pilot"},
        }
        if fence := _fence(self.document.get("geoFence", {})):
            keys["fence"] = fence
        points = len(self.document.get("rallyPoints", {}).get("points", ()))
        if points:
            self.notes.append(f"{points} rally point{'s' if points > 1 else ''}: a return may lead there")
        return MissionPlan(self.document, keys, tuple(self.labels), tuple(dict.fromkeys(self.notes)))

    def _check_complex_items(self) -> None:
        for number, item in enumerate(self.document["mission"]["items"]):
            if item["type"] != "ComplexItem":
                continue
            kind, label = item["complexItemType"], f"item {number + 1}"
            if kind in _FIXED_WING_PATTERNS:
                raise UserError(
                    self.path, f"{label} is a {kind}, for aircraft with wings", "Plan the landing of a multicopter"
                )
            transects = item.get("TransectStyleComplexItem")
            if transects is None:
                raise UserError(
                    self.path,
                    f"{label} is a {kind}, whose waypoints stand in no plan: QGroundControl makes them as it sends it",
                    "Send it to a vehicle or to SITL, read it back, and save that as a plan",
                )
            if transects.get("FollowTerrain"):
                self.notes.append(f"{label} ({kind}) has altitudes that QGroundControl took from its terrain")

    def _in_order(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Items as they come, jumps followed."""
        items = list(flat_items(self.document["mission"]["items"]))
        numbers = {int(item["doJumpId"]): index for index, (_, item) in enumerate(items) if "doJumpId" in item}
        left: dict[int, float] = {}
        index = 0
        for _ in range(MOST_STEPS):
            if index >= len(items):
                return
            _, item = items[index]
            number = int(item.get("doJumpId", index + 1))
            label = f"item {number} (command {int(item['command'])})"
            if item["command"] == Command.DO_JUMP:
                repeats = left.get(index, float(item["params"][1]))
                if repeats < 0.0:
                    raise UserError(self.path, f"{label} jumps back without end", "Give the number of repeats")
                left[index] = repeats - 1.0
                index = numbers[int(item["params"][0])] if repeats > 0.0 else index + 1
                if repeats <= 0.0:
                    del left[index - 1]
                continue
            yield label, item
            index += 1
        raise UserError(self.path, f"takes more than {MOST_STEPS} items to its end", "Take jumps out, or repeats")

    def _fly(self, label: str, item: Mapping[str, Any]) -> None:
        command = int(item["command"])
        parameters = [None if one is None else float(one) for one in item["params"]]
        if command not in BY_PX4:
            answer = _ANSWERS.get(Command(command), "take it out") if command in set(Command) else "take it out"
            raise UserError(self.path, f"{label}: PX4 refuses a mission with this command", answer.capitalize())
        if command in _FIXED_WING_COMMANDS:
            raise UserError(self.path, f"{label} is for aircraft with wings", "Plan it for a multicopter")
        if not item["autoContinue"]:
            raise UserError(
                self.path,
                f"{label} waits there until it is told to go on (autoContinue is false)",
                "Let it go on, or end the plan there",
            )
        if command == Command.TAKEOFF:
            self._take_off(label, item, parameters)
        elif command in (Command.WAYPOINT, Command.LOITER_TIME):
            self._pass(label, item, parameters)
        elif command == Command.LOITER_UNLIMITED:
            self._pass(label, item, parameters)
            self.landing = "pilot"
        elif command == Command.LAND:
            self._land(label, item, parameters)
        elif command == Command.RETURN_TO_LAUNCH:
            self.landing = "return"
        elif command == Command.DELAY:
            self._wait(label, parameters[0] or 0.0)
        elif command == Command.CHANGE_SPEED:
            self._change_speed(label, parameters)
        elif command == Command.SET_HOME:
            raise UserError(self.path, f"{label} moves home while flying", "Take it out: distances are from home")
        else:
            looks = ": it decides where the vehicle looks, which is not planned" if command in _LOOKS else ""
            self.notes.append(f"{label} is kept as it is{looks}")

    def _take_off(self, label: str, item: Mapping[str, Any], parameters: list[float | None]) -> None:
        self.takeoff_m = self._height(label, item, parameters)
        place = _place(parameters)
        if place is None or self._metres(place) < SAME_PLACE_M:
            return
        self._add(label, place, self.takeoff_m, parameters[3])

    def _pass(self, label: str, item: Mapping[str, Any], parameters: list[float | None]) -> None:
        lat, lon = parameters[4], parameters[5]
        assert lat is not None
        assert lon is not None
        if self.takeoff_m is None:
            raise UserError(self.path, f"{label} comes without a take-off before it", "Put a take-off first")
        keys: dict[str, Any] = {}
        if item["command"] == Command.WAYPOINT:
            radius = parameters[1] or 0.0
            keys = {"hold_s": parameters[0], "turn": "fly_over" if 0.0 < radius <= FLY_OVER_ACCEPTANCE_M else "fly_by"}
        elif item["command"] == Command.LOITER_TIME:
            keys = {"hold_s": parameters[0]}
        self._add(label, (lat, lon), self._height(label, item, parameters), parameters[3], **keys)

    def _add(
        self, label: str, place: tuple[float, float], height_m: float, heading_deg: float | None, **keys: Any
    ) -> None:
        self.place = place
        self.labels.append(label)
        entry = {"lat": place[0], "lon": place[1], "alt": height_m, "speed_m_s": self.speed_m_s, **keys}
        if heading_deg is not None:
            entry["heading_deg"] = heading_deg
        self.waypoints.append(entry)

    def _land(self, label: str, item: Mapping[str, Any], parameters: list[float | None]) -> None:
        place = _place(parameters)
        height = self.waypoints[-1]["alt"] if self.waypoints else self.takeoff_m
        if height is None:
            raise UserError(self.path, f"{label} comes without a take-off before it", "Put a take-off first")
        if place is not None and self._metres(place, self.place) >= SAME_PLACE_M:
            self._add(label, place, height, parameters[3])
        self.landing = "land"

    def _wait(self, label: str, seconds: float) -> None:
        if not self.waypoints:
            raise UserError(self.path, f"{label} waits before the first waypoint", "Put it behind a waypoint")
        self.waypoints[-1]["hold_s"] = self.waypoints[-1].get("hold_s", 0.0) + max(seconds, 0.0)

    def _change_speed(self, label: str, parameters: list[float | None]) -> None:
        speed = parameters[1] or 0.0
        if parameters[0] in (2.0, 3.0):
            self.notes.append(f"{label} sets a speed of climb or descent: kept, not planned with")
        elif speed == DEFAULT_SPEED:
            self.speed_m_s = self.hover_speed_m_s
        elif speed > 0.0:
            self.speed_m_s = speed

    def _height(self, label: str, item: Mapping[str, Any], parameters: list[float | None]) -> float:
        altitude = parameters[6]
        assert altitude is not None
        if item["frame"] in ABOVE_TERRAIN:
            raise UserError(
                self.path,
                f"{label} counts its altitude above terrain, which PX4 does not follow in missions",
                "Choose altitudes above launch, or “calculated above terrain”",
            )
        return altitude - self.home[2] if item["frame"] in ABOVE_SEA else altitude

    def _metres(self, place: tuple[float, float], other: tuple[float, float] | None = None) -> float:
        return math.hypot(*LocalMap(*(other or (self.home[0], self.home[1]))).to_local(*place))

    def _check_end(self) -> None:
        if self.takeoff_m is None:
            raise UserError(self.path, "has no take-off", "Put a take-off first")
        if not self.waypoints:
            raise UserError(self.path, "flies to no waypoint", "Add waypoints between take-off and landing")
        if self.landing in (None, "pilot"):
            self.notes.append("the plan ends in the air: the pilot takes over there and lands")


def _place(parameters: list[float | None]) -> tuple[float, float] | None:
    """Latitude and longitude of take-off and landing; None where there is none: null, or zero and zero."""
    lat, lon = parameters[4], parameters[5]
    if lat is None or lon is None or (lat == 0.0 and lon == 0.0):
        return None
    return lat, lon


def _fence(fence: Mapping[str, Any]) -> dict[str, Any]:
    circles = [
        {
            "lat": one["circle"]["center"][0],
            "lon": one["circle"]["center"][1],
            "radius_m": one["circle"]["radius"],
            "inside": one["inclusion"],
        }
        for one in fence.get("circles", ())
    ]
    polygons = [{"points": one["polygon"], "inside": one["inclusion"]} for one in fence.get("polygons", ())]
    return {key: value for key, value in (("circles", circles), ("polygons", polygons)) if value}
