"""A mission asked for in a few words: shapes, a purpose and a home, alone or beside a mission file."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from fusetune.design.missions.mission import Mission, load_mission, mission_of
from fusetune.design.missions.plan_reading import PLAN_SUFFIX
from fusetune.errors import UserError
from fusetune.settings.checking import read_checked, validate
from fusetune.settings.schema import schema_of

USUAL_ALTITUDE_M = 10.0
USUAL_NAME = "mission"
_COMMAND_LINE = "the command line"


def asked_mission(
    file: str | os.PathLike[str] | None,
    shapes: Sequence[str] = (),
    purpose: Sequence[str] = (),
    home: Sequence[float] | None = None,
    **keys: Any,
) -> Mission:
    """The mission of a file, with shapes behind its waypoints, or one of shapes alone.

    Parameters
    ----------
    file : mission or plan; None for shapes alone, which return to home and land there
    shapes : each as the keys of an entry of `shapes`, ``kind: hover, altitude_m: 10, duration_s: 60``
    purpose : parameters to be told apart
    home : latitude, longitude (degrees), altitude above mean sea level (m); to be given without a file
    keys : of a mission file that count before those of the file: name, speed_m_s, field_m

    Raises
    ------
    UserError
        As of `load_mission`; words do not make a mission.
    """
    entries = [_entry(text) for text in shapes]
    if file is not None and home is not None:
        raise UserError(_COMMAND_LINE, "home stands in the file already", "Leave --home out, or change the file")
    if file is not None and not entries and not purpose and not keys:
        return load_mission(file)
    if file is not None and Path(file).suffix.casefold() == PLAN_SUFFIX:
        raise UserError(file, "is a plan, which stays as it is", "Give shapes with a mission file (.yaml), or alone")
    document = read_checked(file, schema_of(Mission)) if file is not None else _about(home, entries)
    document |= {**keys, "shapes": [*document.get("shapes", ()), *entries]}
    if purpose:
        document["purpose"] = list(purpose)
    where = file if file is not None else _COMMAND_LINE
    validate(document, schema_of(Mission), where)
    return mission_of(document, where)


def _about(home: Sequence[float] | None, entries: Sequence[dict[str, Any]]) -> dict[str, Any]:
    if home is None or len(home) != 3 or not all(map(math.isfinite, home)):
        raise UserError(_COMMAND_LINE, "says no home", "Give --home LAT,LON,ALT (ALT above mean sea level), or a file")
    heights = [entry["altitude_m"] for entry in entries if isinstance(entry.get("altitude_m"), int | float)]
    return {
        "name": USUAL_NAME,
        "home": dict(zip(("lat", "lon", "alt"), home, strict=True)),
        "takeoff": {"altitude_m": max(min(heights, default=USUAL_ALTITUDE_M), 2.0)},
        "landing": {"mode": "return"},
    }


def _entry(text: str) -> dict[str, Any]:
    """An entry of `shapes` from its keys, written as YAML writes them in one line."""
    try:
        entry = yaml.safe_load("{" + text.strip().removeprefix("{").removesuffix("}") + "}")
    except yaml.YAMLError:
        entry = None
    if not isinstance(entry, dict) or not all(isinstance(key, str) for key in entry):
        raise UserError(
            _COMMAND_LINE,
            f"--shape {text!r} is no list of keys and values",
            'Write it as in a mission file: --shape "kind: hover, altitude_m: 10, duration_s: 60"',
        )
    return entry
