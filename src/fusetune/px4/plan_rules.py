"""The rules of QGroundControl's plan files (``.plan``), checked on the JSON object of a file.

They are those of its developer guide ("Plan File Format") and of what its own reader refuses; that take-off comes
first and which commands a mission may hold is PX4's own check of a mission (FeasibilityChecker).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeGuard

from fusetune.px4.plan_commands import (
    ALTITUDE_MODES,
    GLOBAL_FRAMES,
    KNOWN_FRAMES,
    WITH_PLACE,
    AltitudeMode,
    Command,
    flat_items,
)

PLAN_VERSION, MISSION_VERSION, FENCE_VERSION, RALLY_VERSION, SHAPE_VERSION = 1, 2, 2, 2, 1

_FINITE_PARAMETERS: Mapping[int, tuple[int, ...]] = {
    Command.WAYPOINT: (0, 1, 2, 4, 5, 6),
    Command.LOITER_TIME: (0, 4, 5, 6),
    Command.LOITER_UNLIMITED: (4, 5, 6),
    Command.TAKEOFF: (6,),
    Command.LAND: (6,),
    Command.DELAY: (0,),
    Command.DO_JUMP: (0, 1),
    Command.CHANGE_SPEED: (0, 1),
}
"""Command → its parameters, counted from 0, that must not be null: yaw may, and the place of take-off and landing."""
_PARAMETERS = 7
_SAME_M = 1e-3
NO_CHANGE_SPEED, DEFAULT_SPEED = -1.0, -2.0


def plan_problems(document: Mapping[str, Any]) -> Iterator[str]:
    """What breaks the rules, each a sentence that begins with the place in the file."""
    if document.get("fileType") != "Plan":
        yield f'fileType is {_shown(document.get("fileType"))}; expected "Plan"'
        return
    yield from _version(document, "", PLAN_VERSION)
    if "groundStation" in document and not isinstance(document["groundStation"], str):
        yield f"groundStation is {_shown(document['groundStation'])}; expected a text"
    mission = document.get("mission")
    if isinstance(mission, Mapping):
        yield from _mission_problems(mission)
    else:
        yield f"mission is {_shown(mission)}; expected an object"
    if "geoFence" in document:
        yield from _fence_problems(document["geoFence"])
    if "rallyPoints" in document:
        yield from _rally_problems(document["rallyPoints"])


def _mission_problems(mission: Mapping[str, Any]) -> Iterator[str]:
    yield from _version(mission, "mission.", MISSION_VERSION)
    if not _is_whole(mission.get("firmwareType")):
        yield f"mission.firmwareType is {_shown(mission.get('firmwareType'))}; expected a number of MAV_AUTOPILOT"
    if "vehicleType" in mission and not _is_whole(mission["vehicleType"]):
        yield f"mission.vehicleType is {_shown(mission['vehicleType'])}; expected a number of MAV_TYPE"
    for key in ("cruiseSpeed", "hoverSpeed"):
        if key in mission and not (_is_number(mission[key]) and mission[key] > 0.0):
            yield f"mission.{key} is {_shown(mission[key])}; expected a number greater than 0"
    mode = mission.get("globalPlanAltitudeMode", AltitudeMode.RELATIVE)
    if not _is_whole(mode) or mode not in (0, *ALTITUDE_MODES):
        yield f"mission.globalPlanAltitudeMode is {_shown(mode)}; expected 0 to {max(ALTITUDE_MODES)}"
    yield from _place_problems(mission.get("plannedHomePosition"), "mission.plannedHomePosition", 3)
    items = mission.get("items")
    if not isinstance(items, list) or not items:
        yield f"mission.items is {_shown(items)}; expected a list of at least one item"
        return
    for number, item in enumerate(items):
        yield from _item_problems(item, f"mission.items[{number}]")
    yield from _order_problems(items)


def _item_problems(item: Any, place: str) -> Iterator[str]:
    if not isinstance(item, Mapping):
        yield f"{place} is {_shown(item)}; expected an object"
    elif item.get("type") == "SimpleItem":
        yield from _simple_problems(item, place)
    elif item.get("type") == "ComplexItem":
        yield from _complex_problems(item, place)
    else:
        yield f'{place}.type is {_shown(item.get("type"))}; expected "SimpleItem" or "ComplexItem"'


def _simple_problems(item: Mapping[str, Any], place: str) -> Iterator[str]:
    command, frame = item.get("command"), item.get("frame")
    if not _is_whole(command) or not 0 <= command <= 65_535:
        yield f"{place}.command is {_shown(command)}; expected a number of MAV_CMD"
        return
    if not _is_whole(frame) or frame not in KNOWN_FRAMES:
        yield f"{place}.frame is {_shown(frame)}; expected a number of MAV_FRAME"
        return
    if not isinstance(item.get("autoContinue"), bool):
        yield f"{place}.autoContinue is {_shown(item.get('autoContinue'))}; expected true or false"
    if "doJumpId" in item and not (_is_whole(item["doJumpId"]) and item["doJumpId"] >= 1):
        yield f"{place}.doJumpId is {_shown(item['doJumpId'])}; expected a whole number from 1"
    parameters = item.get("params")
    if not isinstance(parameters, list) or len(parameters) != _PARAMETERS:
        yield f"{place}.params is {_shown(parameters)}; expected a list of 7 numbers or nulls"
        return
    wrong = [index for index, one in enumerate(parameters) if one is not None and not _is_number(one)]
    if wrong:
        yield f"{place}.params[{wrong[0]}] is {_shown(parameters[wrong[0]])}; expected a number or null"
        return
    for index in _FINITE_PARAMETERS.get(command, ()):
        if parameters[index] is None:
            yield f"{place}.params[{index}] is null; expected a number for command {command}"
    yield from _command_problems(item, command, frame, parameters, place)


def _command_problems(
    item: Mapping[str, Any], command: int, frame: int, parameters: Sequence[float | None], place: str
) -> Iterator[str]:
    if command in WITH_PLACE:
        if frame not in GLOBAL_FRAMES:
            yield f"{place}.frame is {frame}; expected a global one for command {command}, as 3 (above home)"
        yield from _coordinate_problems(parameters[4:6], f"{place}.params", first=4)
        yield from _altitude_problems(item, frame, parameters[6], place)
    if command == Command.CHANGE_SPEED and parameters[1] is not None:
        allowed = parameters[1] > 0.0 or parameters[1] in (NO_CHANGE_SPEED, DEFAULT_SPEED)
        if not allowed:
            yield f"{place}.params[1] is {_shown(parameters[1])}; expected a speed greater than 0 m/s"
        if parameters[0] not in (0, 1, 2, 3):
            yield f"{place}.params[0] is {_shown(parameters[0])}; expected 0 to 3, the kind of speed"
    if command in (Command.WAYPOINT, Command.LOITER_TIME, Command.DELAY) and (parameters[0] or 0.0) < 0.0:
        yield f"{place}.params[0] is {_shown(parameters[0])}; expected a time from 0 s"
    if command == Command.WAYPOINT and (parameters[1] or 0.0) < 0.0:
        yield f"{place}.params[1] is {_shown(parameters[1])}; expected an acceptance radius from 0 m"
    if command == Command.DO_JUMP and parameters[1] is not None and parameters[1] < -1.0:
        yield f"{place}.params[1] is {_shown(parameters[1])}; expected a number of repeats, or -1"


def _altitude_problems(item: Mapping[str, Any], frame: int, altitude: float | None, place: str) -> Iterator[str]:
    keys = ("AltitudeMode", "Altitude", "AMSLAltAboveTerrain")
    if not any(key in item for key in keys):
        return
    missing = [key for key in keys if key not in item]
    if missing:
        yield f"{place}.{missing[0]} is missing; expected all of {', '.join(keys)}, or none"
        return
    mode, shown = item["AltitudeMode"], item["Altitude"]
    if not _is_whole(mode) or mode not in ALTITUDE_MODES:
        yield f"{place}.AltitudeMode is {_shown(mode)}; expected 1 to {max(ALTITUDE_MODES)}"
        return
    if frame not in ALTITUDE_MODES[AltitudeMode(mode)]:
        frames = " or ".join(str(int(one)) for one in ALTITUDE_MODES[AltitudeMode(mode)])
        yield f"{place}.AltitudeMode is {mode} and its frame {frame}; expected frame {frames}"
    if not _is_number(shown):
        yield f"{place}.Altitude is {_shown(shown)}; expected a number"
    elif mode != AltitudeMode.CALCULATED_ABOVE_TERRAIN and altitude is not None and abs(shown - altitude) > _SAME_M:
        yield f"{place}.Altitude is {shown:g} and params[6] {altitude:g}; expected the same: one is shown, one is flown"


def _complex_problems(item: Mapping[str, Any], place: str) -> Iterator[str]:
    if not isinstance(item.get("complexItemType"), str):
        yield f"{place}.complexItemType is {_shown(item.get('complexItemType'))}; expected a text"
        return
    transects = item.get("TransectStyleComplexItem")
    if transects is None:
        return
    if not isinstance(transects, Mapping) or not isinstance(transects.get("Items"), list):
        yield f"{place}.TransectStyleComplexItem has no list Items; expected the waypoints that are flown"
        return
    for number, inner in enumerate(transects["Items"]):
        inner_place = f"{place}.TransectStyleComplexItem.Items[{number}]"
        if isinstance(inner, Mapping) and inner.get("type") == "SimpleItem":
            yield from _simple_problems(inner, inner_place)
        else:
            yield f"{inner_place} is {_shown(inner)}; expected a simple item"


def _order_problems(items: Sequence[Any]) -> Iterator[str]:
    """Numbers of items ascend, jumps lead to one of them, and take-off is the first item with a place."""
    flat = list(flat_items(items))
    numbered = [
        (place, item["doJumpId"]) for place, item in flat if _is_whole(item.get("doJumpId")) and item["doJumpId"] >= 1
    ]
    for (_, before), (place, number) in pairwise(numbered):
        if number <= before:
            yield f"{place}.doJumpId is {number}, after {before}; expected ascending numbers, each once"
    known = {number for _, number in numbered}
    placed = [(place, item) for place, item in flat if item.get("command") in WITH_PLACE]
    for place, item in flat:
        parameters = item.get("params")
        if item.get("command") == Command.DO_JUMP and isinstance(parameters, list) and parameters:
            if parameters[0] not in known:
                yield f"{place}.params[0] is {_shown(parameters[0])}; expected the doJumpId of an item"
        if item.get("command") == Command.TAKEOFF and placed and placed[0][1] is not item:
            yield f"{place} is a take-off behind {placed[0][0]}; expected it to be the first item with a place"


def _fence_problems(fence: Any) -> Iterator[str]:
    if not isinstance(fence, Mapping):
        yield f"geoFence is {_shown(fence)}; expected an object"
        return
    before = len(problems := list(_version(fence, "geoFence.", FENCE_VERSION)))
    yield from problems
    if before:
        return
    for key, one_of in (("circles", _circle_problems), ("polygons", _polygon_problems)):
        entries = fence.get(key)
        if not isinstance(entries, list):
            yield f"geoFence.{key} is {_shown(entries)}; expected a list"
            continue
        for number, entry in enumerate(entries):
            place = f"geoFence.{key}[{number}]"
            if not isinstance(entry, Mapping):
                yield f"{place} is {_shown(entry)}; expected an object"
                continue
            yield from _version(entry, f"{place}.", SHAPE_VERSION)
            if not isinstance(entry.get("inclusion"), bool):
                yield f"{place}.inclusion is {_shown(entry.get('inclusion'))}; expected true or false"
            yield from one_of(entry, place)
    if "breachReturn" in fence:
        yield from _place_problems(fence["breachReturn"], "geoFence.breachReturn", 3)


def _circle_problems(entry: Mapping[str, Any], place: str) -> Iterator[str]:
    circle = entry.get("circle")
    if not isinstance(circle, Mapping):
        yield f"{place}.circle is {_shown(circle)}; expected an object"
        return
    yield from _place_problems(circle.get("center"), f"{place}.circle.center", 2)
    radius = circle.get("radius")
    if not _is_number(radius) or radius <= 0.0:
        yield f"{place}.circle.radius is {_shown(radius)}; expected a number greater than 0 m"


def _polygon_problems(entry: Mapping[str, Any], place: str) -> Iterator[str]:
    corners = entry.get("polygon")
    if not isinstance(corners, list) or len(corners) < 3:
        yield f"{place}.polygon is {_shown(corners)}; expected at least 3 corners"
        return
    for number, corner in enumerate(corners):
        yield from _place_problems(corner, f"{place}.polygon[{number}]", 2)


def _rally_problems(rally: Any) -> Iterator[str]:
    if not isinstance(rally, Mapping):
        yield f"rallyPoints is {_shown(rally)}; expected an object"
        return
    yield from _version(rally, "rallyPoints.", RALLY_VERSION)
    points = rally.get("points")
    if not isinstance(points, list):
        yield f"rallyPoints.points is {_shown(points)}; expected a list"
        return
    for number, point in enumerate(points):
        yield from _place_problems(point, f"rallyPoints.points[{number}]", 3)


def _version(document: Mapping[str, Any], place: str, expected: int) -> Iterator[str]:
    found = document.get("version")
    if not _is_whole(found) or found != expected:
        yield f"{place}version is {_shown(found)}; expected {expected} (open and save it in a present QGroundControl)"


def _place_problems(place: Any, name: str, length: int) -> Iterator[str]:
    if not isinstance(place, list) or len(place) != length or not all(map(_is_number, place)):
        what = "latitude, longitude and altitude" if length == 3 else "latitude and longitude"
        yield f"{name} is {_shown(place)}; expected {what}"
        return
    yield from _coordinate_problems(place[:2], name)


def _coordinate_problems(coordinates: Sequence[float | None], name: str, first: int = 0) -> Iterator[str]:
    for index, (value, limit) in enumerate(zip(coordinates, (90.0, 180.0), strict=True)):
        if value is not None and not -limit <= value <= limit:
            yield f"{name}[{first + index}] is {_shown(value)}; expected {-limit:g} to {limit:g} degrees"


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_whole(value: Any) -> TypeGuard[int]:
    # QGroundControl reads every number as a double: 2.0 is 2
    return _is_number(value) and float(value).is_integer()


def _shown(value: Any) -> str:
    """A value as a message names it, briefly."""
    if value is None:
        return "missing or null"
    if isinstance(value, Mapping):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:40]}…"
