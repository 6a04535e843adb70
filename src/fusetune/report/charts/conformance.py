"""The track of a flight on the map and over time, by manoeuvre, over the mission that it flew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import LONGEST_GAP_US, FlownTrack
from fusetune.analyze.flight.manoeuvre_classes import CLASSES
from fusetune.report.charts.blocks import chart_block
from fusetune.report.charts.svg.axes import HEAD, LABEL_ROOM, NARROW, TICK_ROOM, Panel, head, x_axis, y_axis, y_room
from fusetune.report.charts.svg.elements import group, hinted, path, svg, text
from fusetune.report.charts.svg.legend import Entry, legend, line_symbol, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.scales import Linear, signed_figure

Array = npt.NDArray[np.float64]
Document = Mapping[str, Any]

_TONES = dict(
    zip(CLASSES, ("quiet", "tone-2", "tone-3", "tone-5", "tone-0", "tone-6", "tone-1", "tone-4"), strict=True)
)
_STATES = {"passed": ("good", "circle"), "out of order": ("warn", "diamond"), "missed": ("bad", "cross")}
_TOP = HEAD + 20.0
_LOWEST, _HIGHEST = 140.0, 300.0
"""Height of a map, between which it follows from what was flown."""
_HEIGHT = 110.0
_STEP = 1.2
"""Pixels: points of a line are no nearer."""
_LEVEL_M = 1.0


def conformance_chart(track: FlownTrack | None, document: Document) -> str:
    """A map from above, and the height over time; empty where no place on earth is known.

    Parameters
    ----------
    track : of the flight
    document : its `conformance.json`
    """
    if track is None or not track.has_place:
        return ""
    flown = next((one for one in document["missions"] if one["mission"] == document["flown"]), None)
    home = flown["home"] if flown is not None else {"lat": track.lat[0], "lon": track.lon[0], "alt": 0.0}
    place = track.about(home["lat"], home["lon"], home["alt"])
    stretches = _by_class(track.time, document["manoeuvres"])
    kinds = [kind for kind in CLASSES if any(one == kind for one, _ in stretches)]
    entries = [Entry(line_symbol(_TONES[kind]), kind) for kind in kinds]
    if flown is not None:
        entries.append(Entry(line_symbol("quiet", "dashed"), f"mission {flown['mission']}"))
        states = {_state(one) for one in flown["waypoints"]}
        entries += [Entry(marker_symbol(*look), f"waypoint {one}") for one, look in _STATES.items() if one in states]
    seconds = (track.time - document["start_us"]) * 1e-6
    reference = "take-off" if track.is_above_takeoff else "home" if flown else "sea level"
    charts = [
        _map(place[:, :2], stretches, flown, entries),
        _heights(seconds, -place[:, 2], stretches, flown, document["start_us"], reference),
    ]
    return chart_block("", charts)


def _by_class(time: npt.NDArray[np.int64], manoeuvres: Sequence[Document]) -> list[tuple[str, slice]]:
    """Class and rows of each stretch, with the first row of the next, so that the line is whole."""
    found = []
    for one in manoeuvres:
        first, stop = (int(row) for row in np.searchsorted(time, (one["start_us"], one["stop_us"])))
        if stop < time.size and time[stop] - one["stop_us"] < LONGEST_GAP_US:
            stop += 1
        if stop - first > 1:
            found.append((one["kind"], slice(first, stop)))
    return found


def _line(x: Array, y: Array, kind: str) -> str:
    """A line through points some pixels apart, with the first and the last one."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    rows = np.unique(np.floor(way / _STEP), return_index=True)[1]
    rows = np.unique(np.append(rows, x.size - 1))
    return path(x[rows], y[rows], kind)


def _drawn(panel: Panel, x: Array, y: Array, stretches: Sequence[tuple[str, slice]]) -> str:
    across, down = panel.x(x), panel.y(y)
    return "".join(
        group(_TONES[kind], hinted(kind, _line(across[rows], down[rows], "line"))) for kind, rows in stretches
    )


def _map(place: Array, stretches: Sequence[tuple[str, slice]], flown: Document | None, entries: Sequence[Entry]) -> str:
    shown = [place]
    if flown is not None:
        shown.append(np.array([one["place_ned_m"][:2] for one in flown["waypoints"]]).reshape(-1, 2))
        shown.append(np.array([one["end_ned_m"][:2] for one in flown["legs"]]).reshape(-1, 2))
    known = np.concatenate(shown)
    known = known[np.isfinite(known).all(axis=1)]
    (south, west), (north, east) = known.min(axis=0), known.max(axis=0)
    left, right = 46.0, NARROW - 10.0
    width = max(east - west, 1.0) * 1.1
    height = max(north - south, 1.0) * 1.1
    tall = min(max((right - left) * height / width, _LOWEST), _HIGHEST)
    # metres per pixel, the same along both axes
    scale = max(width / (right - left), height / tall)
    middle_x, middle_y = 0.5 * (west + east), 0.5 * (south + north)
    half_x, half_y = 0.5 * scale * (right - left), 0.5 * scale * tall
    panel = Panel(
        Linear(middle_x - half_x, middle_x + half_x, left, right),
        Linear(middle_y - half_y, middle_y + half_y, _TOP + tall, _TOP),
    )
    home = " of home" if flown else ""
    parts = [head("From above"), y_axis(panel, f"north{home} [m]"), x_axis(panel, f"east{home} [m]")]
    if flown is not None:
        corners = np.array([flown["legs"][0]["start_ned_m"], *(leg["end_ned_m"] for leg in flown["legs"])])
        parts.append(group("quiet", path(panel.x(corners[:, 1]), panel.y(corners[:, 0]), "dashed")))
    parts.append(_drawn(panel, place[:, 1], place[:, 0], stretches))
    if flown is not None:
        parts += _waypoints(panel, flown)
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    drawn, room = legend(entries, below)
    said = f"{width / 1.1:.0f} m from west to east, {height / 1.1:.0f} m from south to north"
    return svg("map", "The track from above", said, NARROW, below + room, [*parts, drawn], "")


def _waypoints(panel: Panel, flown: Document) -> list[str]:
    parts, at_place = [], dict[tuple[float, float], list[str]]()
    # those that were missed lie on those that were passed at the same place another time
    for one in sorted(flown["waypoints"], key=lambda one: list(_STATES).index(_state(one))):
        north, east, _ = one["place_ned_m"]
        kind, shape = _STATES[_state(one)]
        x, y = panel.x.at(east), panel.y.at(north)
        hint = f"waypoint {one['waypoint'] + 1}: {_state(one)}"
        parts.append(group(kind, hinted(hint, marker(shape, x, y, 5.0 if _state(one) == "missed" else 4.0))))
    for one in flown["waypoints"]:
        north, east, _ = one["place_ned_m"]
        at_place.setdefault((round(north, 1), round(east, 1)), []).append(str(one["waypoint"] + 1))
    parts += [
        text(panel.x.at(east) + 6.0, panel.y.at(north) - 5.0, ", ".join(numbers), "note over")
        for (north, east), numbers in at_place.items()
    ]
    return parts


def _heights(
    seconds: Array,
    height: Array,
    stretches: Sequence[tuple[str, slice]],
    flown: Document | None,
    start_us: int,
    reference: str,
) -> str:
    known = height[np.isfinite(height)]
    low, high = float(known.min(initial=0.0)), float(known.max(initial=1.0))
    margin = 0.08 * (high - low)
    y = Linear(low - margin, high + margin, _TOP + _HEIGHT, _TOP)
    x = Linear(float(seconds[0]), float(seconds[-1]), y_room(y, signed_figure), NARROW - 10.0)
    panel = Panel(x, y)
    title = f"Height above {reference}"
    parts = [head(title), y_axis(panel, "[m]"), x_axis(panel, "time since the log began [s]")]
    for leg in () if flown is None else flown["legs"]:
        way = np.subtract(leg["end_ned_m"], leg["start_ned_m"])
        if leg["start_us"] is not None and np.hypot(way[0], way[1]) > _LEVEL_M:
            times = np.array([(leg[edge] - start_us) * 1e-6 for edge in ("start_us", "stop_us")])
            heights = np.array([-leg[edge][2] for edge in ("start_ned_m", "end_ned_m")])
            parts.append(group("quiet", path(x(times), y(heights), "dashed")))
    parts.append(_drawn(panel, seconds, height, stretches))
    for one in () if flown is None else flown["waypoints"]:
        if one["time_us"] is not None and y.holds(-one["place_ned_m"][2]):
            kind, shape = _STATES[_state(one)]
            at = (x.at((one["time_us"] - start_us) * 1e-6), y.at(-one["place_ned_m"][2]))
            parts.append(group(kind, hinted(f"waypoint {one['waypoint'] + 1}: {_state(one)}", marker(shape, *at, 3.4))))
    said = f"{low:.0f} m to {high:.0f} m"
    return svg("height", title, said, NARROW, panel.bottom + TICK_ROOM + LABEL_ROOM, parts, "")


def _state(waypoint: Document) -> str:
    return "missed" if not waypoint["passed"] else "passed" if waypoint["in_order"] else "out of order"
