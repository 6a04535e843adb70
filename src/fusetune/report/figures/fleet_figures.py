"""Figures of a fleet: each over the flights in the order of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from fusetune.apply.fleet.flights import SEVERITIES, FleetTable
from fusetune.report.figure_words import figure_words
from fusetune.report.figures.drawing import decades, label_margins, new_figure
from fusetune.report.fleet.shown_figures import is_within_reach
from fusetune.report.severity_words import SEVERITY_COLOURS

Array = npt.NDArray[np.float64]

_OTHERS_COLOUR = "#8F9BA8"
_LIMIT_COLOUR = "#CC0000"
_COLUMNS = 3
_PANEL_INCH = (3.35, 1.75)
_TITLE_WIDTH = 52
_MARKED = ("fail", "warning")
_DECADES = 50.0


def draw_trends(table: FleetTable, columns: Sequence[int], changes: Sequence[Mapping[str, Any]]) -> Figure:
    """A panel per figure: its value on each dated flight, a colour per vehicle, steps as lines.

    Parameters
    ----------
    columns : of the table, which figures
    changes : of `fleet.json`
    """
    rows = np.flatnonzero([bool(one.date) for one in table.flights])
    shown = {table.flights[row].vehicle for row in rows}
    colours = {vehicle: colour for vehicle, colour in vehicle_colours(table).items() if vehicle in shown}
    figure, panels = _panels(len(columns), foot=0.16 * -(-min(len(colours), 8) // 4))
    for axes, column in zip(panels, columns, strict=True):
        name = table.figures[column]
        values = table.values[rows, column]
        axes.set_title(_title(name.id, name.unit), fontsize=7.5)
        for vehicle, colour in colours.items():
            of_it = np.array([table.flights[row].vehicle == vehicle for row in rows], dtype=bool)
            axes.plot(np.flatnonzero(of_it), values[of_it], "o", color=colour, markersize=3.2)
        for severity in _MARKED:
            beyond = table.severities[rows, column] == SEVERITIES.index(severity)
            axes.plot(np.flatnonzero(beyond), values[beyond], "o", markerfacecolor="none", markersize=7,
                      markeredgecolor=SEVERITY_COLOURS[severity], markeredgewidth=1.2)  # fmt: skip
        _steps(axes, table, rows, column, [one for one in changes if (one["id"], one["unit"]) == (name.id, name.unit)])
        if name.limit is not None and is_within_reach(name.limit, values):
            axes.axhline(name.limit, color=_LIMIT_COLOUR, linewidth=0.9, linestyle="--")
        axes.set_xlim(-0.6, rows.size - 0.4)
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        if _spans_decades(values):
            decades(axes)
        else:
            axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.set_xlabel("flight, by date")
        label_margins(axes, below=0.24)
    _legend(figure, colours)
    return figure


def _spans_decades(values: Array) -> bool:
    """Whether a few flights would press all others onto the axis."""
    known = values[np.isfinite(values)]
    return known.size > 0 and bool(known.min() > 0.0) and bool(known.max() > _DECADES * np.median(known))


def _legend(figure: Figure, colours: Mapping[str, str]) -> None:
    """Vehicles in a line at the bottom; those that share a colour as one."""
    named = {colour: vehicle for vehicle, colour in reversed(list(colours.items()))}
    labels = {colour: vehicle if colour != _OTHERS_COLOUR else "others" for colour, vehicle in named.items()}
    points = [Line2D([], [], marker="o", linestyle="", color=colour, markersize=4) for colour in reversed(labels)]
    words = list(reversed(labels.values()))
    figure.legend(points, words, loc="lower center", ncols=4, fontsize=7, borderaxespad=0.3)


def vehicle_colours(table: FleetTable) -> dict[str, str]:
    """A colour for each of the vehicles that flew most, grey for the rest."""
    cycle = [entry["color"] for entry in matplotlib.rcParams["axes.prop_cycle"]]
    order = sorted(table.vehicles, key=lambda vehicle: -table.rows_of(vehicle).size)
    named = {vehicle: cycle[place] if place < len(cycle) - 1 else _OTHERS_COLOUR for place, vehicle in enumerate(order)}
    return {vehicle: colour if colour.startswith("#") else f"#{colour}" for vehicle, colour in named.items()}


def _steps(
    axes: Axes, table: FleetTable, rows: npt.NDArray[np.intp], column: int, changes: Sequence[Mapping[str, Any]]
) -> None:
    """Medians between the steps of a vehicle."""
    for vehicle in dict.fromkeys(one["vehicle"] for one in changes):
        of_it = [place for place, row in enumerate(rows) if table.flights[row].vehicle == vehicle]
        starts = {one["flight"] for one in changes if one["vehicle"] == vehicle}
        edges = [place for place in of_it if table.flights[rows[place]].name in starts]
        for start, stop in zip([of_it[0], *edges], [*edges, of_it[-1] + 1], strict=True):
            inside = [place for place in of_it if start <= place < stop]
            median = np.nanmedian(table.values[rows[inside], column])
            axes.plot([start - 0.4, stop - 0.6], [median, median], color="#222222", linewidth=1.3)
        for edge in edges:
            axes.axvline(edge - 0.5, color="#222222", linewidth=0.8, linestyle=":")


def _title(figure: str, unit: str) -> str:
    words = figure_words(figure) + (f" [{unit}]" if unit else "")
    return words if len(words) <= _TITLE_WIDTH else words[: _TITLE_WIDTH - 1].rstrip() + "…"


def _panels(count: int, foot: float = 0.0) -> tuple[Figure, list[Axes]]:
    """So many panels; `foot` is room below them, inch."""
    rows = -(-count // _COLUMNS)
    width, height = _COLUMNS * _PANEL_INCH[0], rows * _PANEL_INCH[1] + 0.1 + foot
    figure = new_figure(width, height, layout=None)
    margins = {"left": 0.05, "right": 0.99, "top": 1.0 - 0.25 / height, "bottom": (0.42 + foot) / height}
    grid = figure.subplots(rows, _COLUMNS, squeeze=False, gridspec_kw=margins | {"hspace": 0.62, "wspace": 0.2})
    for place, axes in enumerate(grid.flat):
        axes.set_visible(place < count)
        axes.tick_params(labelsize=7)
        axes.xaxis.label.set_size(7)
    return figure, list(grid.flat)[:count]
