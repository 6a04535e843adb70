"""The part of the page about the mission that is planned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fusetune.report.markup import Cell, bullets, details, figure, number, paragraph, section, table
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

_HEAD = ("leg", "from [s]", "to [s]", "length [m]", "height [m]", "speed [m/s]", "hold [s]", "heading [°]", "turn")


def mission_section(outlook: AnyPath | None) -> str:
    """Answer, map and profile, legs; empty without an outlook.

    Parameters
    ----------
    outlook : `results/design/<mission>.json`, with the map as `.svg` beside it
    """
    if outlook is None:
        return ""
    found = read_document(outlook)
    parts = [paragraph(found["answer"])]
    if found["description"]:
        parts.append(paragraph(found["description"]))
    parts += [
        figure(
            Path(outlook).with_suffix(".svg"),
            "The mission from above, as it will be flown: fly-by corners are cut, at stops the vehicle rests. Dashed: "
            "straight from waypoint to waypoint.",
        ),
        bullets([f"{note[:1].upper()}{note[1:]}." for note in found["notes"]]) if found["notes"] else "",
        details("Legs", table(_HEAD, [_row(leg) for leg in found["legs"]])),
    ]
    return section("The mission that is planned", *parts)


def _row(leg: dict[str, Any]) -> list[Cell | str]:
    heading = leg["heading_deg"]
    return [
        leg["name"],
        *(Cell(f"{leg[key]:.{digits}f}", "number") for key, digits in _DIGITS.items()),
        Cell(f"{leg['hold_s']:g}" if leg["hold_s"] else "", "number"),
        number(heading) if heading is not None else "",
        leg["turn"].replace("_", " "),
    ]


_DIGITS = {"start_s": 0, "end_s": 0, "length_m": 1, "height_m": 1, "speed_m_s": 1}
