"""Plans as QGroundControl saves them, put together by hand, and a schema of what its developer guide documents."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

HOME = [47.397742, 8.545594, 488.0]

_PLACE_2 = {
    "type": "array",
    "prefixItems": [
        {"type": "number", "minimum": -90, "maximum": 90},
        {"type": "number", "minimum": -180, "maximum": 180},
    ],
    "minItems": 2,
    "maxItems": 2,
    "items": False,
}
_PLACE_3 = _PLACE_2 | {
    "prefixItems": [*_PLACE_2["prefixItems"], {"type": "number"}],
    "minItems": 3,
    "maxItems": 3,
}
SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "type": "object",
    "required": ["fileType", "version", "groundStation", "mission", "geoFence", "rallyPoints"],
    "properties": {
        "fileType": {"const": "Plan"},
        "version": {"const": 1},
        "groundStation": {"const": "QGroundControl"},
        "mission": {
            "type": "object",
            "required": [
                "version", "firmwareType", "globalPlanAltitudeMode", "vehicleType", "cruiseSpeed", "hoverSpeed",
                "items", "plannedHomePosition",
            ],
            "properties": {
                "version": {"const": 2},
                "firmwareType": {"const": 12},
                "vehicleType": {"const": 2},
                "globalPlanAltitudeMode": {"enum": [0, 1, 2, 3, 4]},
                "cruiseSpeed": {"type": "number", "exclusiveMinimum": 0},
                "hoverSpeed": {"type": "number", "exclusiveMinimum": 0},
                "plannedHomePosition": _PLACE_3,
                "items": {
                    "type": "array",
                    "minItems": 1,
                    "items": {
                        "type": "object",
                        "required": ["type", "autoContinue", "command", "doJumpId", "frame", "params"],
                        "properties": {
                            "type": {"const": "SimpleItem"},
                            "autoContinue": {"const": True},
                            "command": {"enum": [16, 20, 21, 22, 178]},
                            "doJumpId": {"type": "integer", "minimum": 1},
                            "frame": {"enum": [2, 3]},
                            "params": {
                                "type": "array", "minItems": 7, "maxItems": 7, "items": {"type": ["number", "null"]}
                            },
                            "Altitude": {"type": "number"},
                            "AltitudeMode": {"const": 1},
                            "AMSLAltAboveTerrain": {"type": ["number", "null"]},
                        },
                        "additionalProperties": False,
                        "if": {"properties": {"command": {"enum": [16, 21, 22]}}},
                        "then": {"required": ["Altitude", "AltitudeMode", "AMSLAltAboveTerrain"]},
                    },
                },
            },
            "additionalProperties": False,
        },
        "geoFence": {
            "type": "object",
            "required": ["version", "circles", "polygons"],
            "properties": {
                "version": {"const": 2},
                "circles": {
                    "type": "array",
                    "items": {
                        "type": "object",
                        "required": ["circle", "inclusion", "version"],
                        "properties": {
                            "circle": {
                                "type": "object",
                                "required": ["center", "radius"],
                                "properties": {"center": _PLACE_2, "radius": {"type": "number", "exclusiveMinimum": 0}},
                                "additionalProperties": False,
                            },
                            "inclusion": {"type": "boolean"},
                            "version": {"const": 1},
                        },
                        "additionalProperties": False,
                    },
                },
                "polygons": {
                    "type": "array",
                    "items": {
                        "type": "object",
                        "required": ["polygon", "inclusion", "version"],
                        "properties": {
                            "polygon": {"type": "array", "minItems": 3, "items": _PLACE_2},
                            "inclusion": {"type": "boolean"},
                            "version": {"const": 1},
                        },
                        "additionalProperties": False,
                    },
                },
            },
            "additionalProperties": False,
        },
        "rallyPoints": {
            "type": "object",
            "required": ["version", "points"],
            "properties": {"version": {"const": 2}, "points": {"type": "array", "items": _PLACE_3}},
            "additionalProperties": False,
        },
    },
    "additionalProperties": False,
}  # fmt: skip
"""What we write, by the tables of the guide's page "Plan File Format"; no code of ours made it."""


def simple(
    command: int, params: Sequence[float | None], frame: int = 3, mode: int | None = 1, *, number: int = 0
) -> dict[str, Any]:
    """A simple item; `number` 0 is given by `plan`."""
    item: dict[str, Any] = {
        "autoContinue": True,
        "command": command,
        "doJumpId": number,
        "frame": frame,
        "params": list(params),
        "type": "SimpleItem",
    }
    if mode is not None:
        item |= {"AMSLAltAboveTerrain": None, "Altitude": params[6], "AltitudeMode": mode}
    return item


def take_off(height: float = 20.0) -> dict[str, Any]:
    return simple(22, [15, 0, 0, None, *HOME[:2], height])


def to(
    north: float, east: float, height: float = 20.0, hold: float = 0.0, radius: float = 0.0, yaw: float | None = None
):
    """A waypoint about so many metres from home (111.2 km a degree, on a sphere)."""
    return simple(16, [hold, radius, 0, yaw, HOME[0] + north / 111_195.0, HOME[1] + east / 75_270.0, height])


def speed(metres_a_second: float) -> dict[str, Any]:
    return simple(178, [1, metres_a_second, -1, 0, 0, 0, 0], frame=2, mode=None)


def back() -> dict[str, Any]:
    return simple(20, [0, 0, 0, 0, 0, 0, 0], frame=2, mode=None)


def survey(*items: dict[str, Any], kind: str = "survey") -> dict[str, Any]:
    """A complex item that flies some simple ones, which have no altitude mode of their own."""
    flown = [{key: value for key, value in item.items() if not key.startswith(("A", "AMSL"))} for item in items]
    return {
        "TransectStyleComplexItem": {
            "CameraCalc": {"CameraName": "Manual (no camera specs)", "version": 2},
            "CameraShots": 12,
            "CameraTriggerInTurnAround": True,
            "HoverAndCapture": False,
            "Items": flown,
            "Refly90Degrees": False,
            "TurnAroundDistance": 10,
            "VisualTransectPoints": [[item["params"][4], item["params"][5]] for item in items if item["command"] == 16],
            "version": 2,
        },
        "angle": 0,
        "complexItemType": kind,
        "entryLocation": 0,
        "flyAlternateTransects": False,
        "polygon": [[47.398, 8.545], [47.398, 8.546], [47.399, 8.546]],
        "type": "ComplexItem",
        "version": 5,
    }


def plan(*items: dict[str, Any], **mission: Any) -> dict[str, Any]:
    """A plan of items, numbered as QGroundControl numbers them."""
    numbered, number = copy.deepcopy(list(items)), 0
    for item in numbered:
        inner = item.get("TransectStyleComplexItem", {}).get("Items", ()) if item["type"] == "ComplexItem" else [item]
        for one in inner:
            number += 1
            one["doJumpId"] = one["doJumpId"] or number
    return {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": 12,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": numbered,
            "plannedHomePosition": HOME,
            "vehicleType": 2,
            "version": 2,
        }
        | mission,
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }


def write(folder: Path, document: object, name: str = "field one.plan") -> Path:
    path = folder / name
    path.write_text(json.dumps(document), encoding="utf-8")
    return path
