"""The track of a flight on the map and over time, coloured by manoeuvre, over the mission that it flew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fusetune.analyze.conformance.flown_track import LONGEST_GAP_US, FlownTrack
from fusetune.analyze.flight.manoeuvre_classes import CLASSES
from fusetune.report.figures.drawing import label_margins, new_figure

Array = npt.NDArray[np.float64]
Document = Mapping[str, Any]

CLASS_COLOURS = {
    "ground": "#999999",
    "takeoff": "#882255",
    "hover": "#56B4E9",
    "straight": "#0072B2",
    "turn": "#E69F00",
    "climb": "#CC79A7",
    "descent": "#009E73",
    "landing": "#44AA99",
}
"""Colours that the colour-blind tell apart (Okabe and Ito; Tol)."""

_PLAN = "#444444"
_MARKS = {"passed": ("o", "#1B7F3B"), "out of order": ("D", "#D98E04"), "missed": ("X", "#C62828")}
_MOST_POINTS = 4000
_LEVEL_M = 1.0
_MARGINS = {"left": 0.085, "right": 0.985, "bottom": 0.06, "top": 0.935, "hspace": 0.16}
_LEGEND_COLUMNS = 6
"""Two rows fit into the margin above."""


def draw_conformance(track: FlownTrack, document: Document) -> Figure:
    """Draw the map, and the height beneath it.

    Parameters
    ----------
    track : of the flight; has a place on earth
    document : its `conformance.json`
    """
    flown = next((one for one in document["missions"] if one["mission"] == document["flown"]), None)
    home = flown["home"] if flown is not None else {"lat": track.lat[0], "lon": track.lon[0], "alt": 0.0}
    place = track.about(home["lat"], home["lon"], home["alt"])
    figure = new_figure(9.0, 8.6, layout=None)
    grid = figure.add_gridspec(2, 1, height_ratios=(2.6, 1.0), **_MARGINS)
    above, beneath = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    seconds = (track.time - document["start_us"]) * 1e-6
    stretches = _by_class(track.time, document["manoeuvres"])
    _draw_stretches(above, stretches, np.column_stack([place[:, 1], place[:, 0]]))
    _draw_stretches(beneath, stretches, np.column_stack([seconds, -place[:, 2]]))
    if flown is not None:
        _plan(above, beneath, flown, document["start_us"])
    above.set(xlabel="east of home [m]" if flown else "east [m]", ylabel="north of home [m]" if flown else "north [m]")
    above.set_aspect("equal", adjustable="datalim")
    reference = "take-off" if track.is_above_takeoff else "home" if flown else "sea level"
    beneath.set(xlabel="time since the log began [s]", ylabel=f"height above\n{reference} [m]")
    for axes in (above, beneath):
        label_margins(axes, left=0.5)
    kinds = {one["kind"] for one in document["manoeuvres"]}
    _legend(figure, [kind for kind in CLASSES if kind in kinds], flown)
    return figure


def _by_class(time: npt.NDArray[np.int64], manoeuvres: Sequence[Document]) -> list[tuple[str, npt.NDArray[np.int64]]]:
    """Class and rows of each stretch, with the first row of the next, so that the line is whole."""
    step = max(1, time.size // _MOST_POINTS)
    found = []
    for one in manoeuvres:
        first, stop = np.searchsorted(time, (one["start_us"], one["stop_us"]))
        if stop < time.size and time[stop] - one["stop_us"] < LONGEST_GAP_US:
            stop += 1
        if stop - first > 1:
            found.append((one["kind"], np.unique(np.r_[first : stop - 1 : step, stop - 1])))
    return found


def _draw_stretches(axes: Axes, stretches: Sequence[tuple[str, npt.NDArray[np.int64]]], points: Array) -> None:
    """Each in the colour of its class, all as one object of the picture."""
    lines = [points[rows] for _, rows in stretches]
    colours = [CLASS_COLOURS[kind] for kind, _ in stretches]
    axes.add_collection(LineCollection(lines, colors=colours, linewidths=1.8, capstyle="round", joinstyle="round"))
    axes.autoscale_view()


def _plan(above: Axes, beneath: Axes, flown: Document, start_us: int) -> None:
    """Legs dashed, waypoints with their numbers; beneath, the heights between which each level leg was flown."""
    corners = np.array([flown["legs"][0]["start_ned_m"], *(leg["end_ned_m"] for leg in flown["legs"])])
    above.plot(corners[:, 1], corners[:, 0], color=_PLAN, linewidth=0.9, linestyle="--", zorder=1.5)
    at_place: dict[tuple[float, float], list[str]] = {}
    for waypoint in flown["waypoints"]:
        north, east, _ = waypoint["place_ned_m"]
        at_place.setdefault((round(north, 1), round(east, 1)), []).append(str(waypoint["waypoint"] + 1))
    for state, (marker, colour) in _MARKS.items():
        of_state = [one for one in flown["waypoints"] if _state(one) == state]
        # over one that was passed at the same place another time
        size, order = (9.5, 4) if state == "missed" else (6.5, 3)
        look: dict[str, Any] = {"linestyle": "", "marker": marker, "color": colour, "markeredgecolor": "white"}
        north, east, _ = np.reshape([one["place_ned_m"] for one in of_state], (-1, 3)).T
        above.plot(east, north, markersize=size, zorder=order, **look)
        timed = [one for one in of_state if one["time_us"] is not None]
        after = [(one["time_us"] - start_us) * 1e-6 for one in timed]
        beneath.plot(after, [-one["place_ned_m"][2] for one in timed], markersize=5.5, zorder=3, **look)
    for (north, east), numbers in at_place.items():
        above.annotate(
            ", ".join(numbers), (east, north), xytext=(5, 5), textcoords="offset points", fontsize=8, color=_PLAN
        )
    for leg in flown["legs"]:
        way = np.subtract(leg["end_ned_m"], leg["start_ned_m"])
        if leg["start_us"] is not None and np.hypot(way[0], way[1]) > _LEVEL_M:
            times = [(leg[edge] - start_us) * 1e-6 for edge in ("start_us", "stop_us")]
            heights = [-leg[edge][2] for edge in ("start_ned_m", "end_ned_m")]
            beneath.plot(times, heights, color=_PLAN, linewidth=0.9, linestyle="--", zorder=1.5)


def _state(waypoint: Document) -> str:
    return "missed" if not waypoint["passed"] else "passed" if waypoint["in_order"] else "out of order"


def _legend(figure: Figure, kinds: Sequence[str], flown: Document | None) -> None:
    handles = [Line2D([], [], color=CLASS_COLOURS[kind], linewidth=2.0, label=kind) for kind in kinds]
    if flown is not None:
        handles.append(Line2D([], [], color=_PLAN, linewidth=0.9, linestyle="--", label=f"mission {flown['mission']}"))
        states = {_state(one) for one in flown["waypoints"]}
        handles += [
            Line2D([], [], color=colour, marker=marker, linestyle="", label=f"waypoint {state}")
            for state, (marker, colour) in _MARKS.items()
            if state in states
        ]
    figure.legend(
        handles=handles, loc="upper center", ncols=min(len(handles), _LEGEND_COLUMNS), fontsize=8, borderaxespad=0.3
    )
