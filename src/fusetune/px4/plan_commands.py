"""Words of plans: commands (MAV_CMD), frames (MAV_FRAME), ways to count altitude, and the items of a plan in a row."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from typing import Any


class Command(IntEnum):
    """MAVLink mission commands (MAV_CMD) that are known by name here."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
    LOITER_TO_ALTITUDE = 31
    VTOL_TAKEOFF = 84
    VTOL_LAND = 85
    DELAY = 93
    CONDITION_DELAY = 112
    CONDITION_YAW = 115
    DO_JUMP = 177
    CHANGE_SPEED = 178
    SET_HOME = 179
    SET_ROI_LOCATION = 195
    SET_ROI_NEXT = 196
    SET_ROI_NONE = 197
    SET_ROI = 201
    VTOL_TRANSITION = 3000


WITH_PLACE = frozenset(
    (
        Command.WAYPOINT,
        Command.LOITER_UNLIMITED,
        Command.LOITER_TURNS,
        Command.LOITER_TIME,
        Command.LAND,
        Command.TAKEOFF,
        Command.LOITER_TO_ALTITUDE,
        Command.VTOL_TAKEOFF,
        Command.VTOL_LAND,
    )
)
"""Commands that lead to a place."""

BY_PX4 = frozenset(
    (
        16, 17, 19, 20, 21, 22, 31, 84, 85, 93, 177, 178, 179, 183, 189, 195, 196, 197, 200, 201, 203, 204, 205, 206,
        211, 214, 260, 530, 531, 532, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000, 4501, 42600,
    )
)  # fmt: skip
"""Commands that PX4 (v1.15, v1.16) takes in a mission; it refuses a mission with any other."""


class Frame(IntEnum):
    """MAVLink frames (MAV_FRAME) of mission items."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALTITUDE = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALTITUDE_INT = 6
    GLOBAL_TERRAIN_ALTITUDE = 10
    GLOBAL_TERRAIN_ALTITUDE_INT = 11


ABOVE_SEA = (Frame.GLOBAL, Frame.GLOBAL_INT)
ABOVE_HOME = (Frame.GLOBAL_RELATIVE_ALTITUDE, Frame.GLOBAL_RELATIVE_ALTITUDE_INT)
ABOVE_TERRAIN = (Frame.GLOBAL_TERRAIN_ALTITUDE, Frame.GLOBAL_TERRAIN_ALTITUDE_INT)
GLOBAL_FRAMES = frozenset((*ABOVE_SEA, *ABOVE_HOME, *ABOVE_TERRAIN))
KNOWN_FRAMES = range(22)


class AltitudeMode(IntEnum):
    """How QGroundControl counts the altitude of an item."""

    RELATIVE = 1
    ABSOLUTE = 2
    CALCULATED_ABOVE_TERRAIN = 3
    TERRAIN_FRAME = 4


ALTITUDE_MODES: Mapping[AltitudeMode, tuple[Frame, ...]] = {
    AltitudeMode.RELATIVE: ABOVE_HOME,
    AltitudeMode.ABSOLUTE: ABOVE_SEA,
    AltitudeMode.CALCULATED_ABOVE_TERRAIN: ABOVE_SEA,
    AltitudeMode.TERRAIN_FRAME: ABOVE_TERRAIN,
}
"""Mode → frames that such an item may have; what QGroundControl calculates above terrain is sent above sea level."""


def flat_items(items: Sequence[Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Simple items in the order of flight, those within surveys and corridors too, each with its place in the file."""
    for number, item in enumerate(items):
        if not isinstance(item, Mapping):
            continue
        place = f"mission.items[{number}]"
        if item.get("type") == "SimpleItem":
            yield place, item
            continue
        transects = item.get("TransectStyleComplexItem")
        inner = transects.get("Items") if isinstance(transects, Mapping) else None
        for index, one in enumerate(inner if isinstance(inner, list) else ()):
            if isinstance(one, Mapping):
                yield f"{place}.TransectStyleComplexItem.Items[{index}]", one
