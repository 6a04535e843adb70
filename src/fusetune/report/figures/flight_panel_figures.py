"""Figures of one flight over time: innovations with their bounds, test ratios, states, uncertainties, flags, track."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fusetune.report.figures.drawing import decades, drawn_rows, new_figure
from fusetune.report.figures.plotted_flight import PlottedFlight
from fusetune.report.figures.publication import INCH_MM
from fusetune.report.figures.set_styles import PRINT_COLOURS
from fusetune.report.flight_data.content import Panel, PlaneTrack, Series
from fusetune.report.flight_data.panel_names import (
    ATTITUDE,
    BIASES,
    POSITION,
    RATIOS,
    SENSORS,
    UNCERTAINTY,
    VELOCITY,
    VIBRATION,
    WIND_AND_FIELD,
)
from fusetune.set_names import AS_FLOWN, ONBOARD

Array = npt.NDArray[np.float64]

_ROW_MM, _HEAD_MM, _FOOT_MM = 23.0, 7.0, 11.0
_FLAG_MM = 3.6
_MOST_ROWS = 6
"""Of a figure: what has more is drawn as several."""
_SMALLEST_RATIO = 1e-4
_NEAR_GATE = 4.0
"""A gate that lies so many times farther than the innovations go would flatten them, and is left out."""
_OTHER_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#b85a8d", "#c27c00", "#2f8fc9", "#8f8300")
_OF_SETS = {ONBOARD: ("#666666", "--"), AS_FLOWN: ("#17202a", "-")}
_REJECTED_COLOUR = "#b03a00"


@dataclass(frozen=True)
class FlightFigure:
    """A figure of a flight that can be asked for, and how it is drawn for a width in mm."""

    name: str
    draw: Callable[[float], Figure]


def flight_figures(flight: PlottedFlight, sets: Sequence[str] = ()) -> list[FlightFigure]:
    """All that can be drawn of a flight, in the order in which PX4's ecl_ekf analysis shows it.

    Parameters
    ----------
    sets : whose curves are drawn; all that the flight has without any
    """
    panels = [_of_sets(one, sets) for one in flight.panels]
    panels = [one for one in panels if one.series]
    found: list[tuple[str, list[Panel]]] = []
    for source in dict.fromkeys(one.source for one in panels if one.kind == "innovation"):
        of_source = [one for one in panels if one.kind == "innovation" and one.source == source]
        found.append((f"innovations_{source}", of_source))
    found.append(("test_ratios", [one for one in panels if one.group == RATIOS]))
    by_group = {
        "attitude": _of_group(panels, ATTITUDE),
        "velocity": _of_group(panels, VELOCITY),
        "position": _of_group(panels, POSITION),
        "biases": _of_group(panels, BIASES),
        "magnetic_field": [one for one in _of_group(panels, WIND_AND_FIELD) if one.id.startswith("mag")],
        "wind": [one for one in _of_group(panels, WIND_AND_FIELD) if not one.id.startswith("mag")],
        "output_predictor": [one for one in _of_group(panels, UNCERTAINTY) if one.id.startswith("output")],
        "uncertainties": [one for one in _of_group(panels, UNCERTAINTY) if not one.id.startswith("output")],
        "vibration": _of_group(panels, VIBRATION),
        "sensors": _of_group(panels, SENSORS),
    }
    figures = [
        FlightFigure(name, _stacked(flight, part))
        for whole, rows in [*found, *by_group.items()]
        for name, part in _parts(whole, rows)
    ]
    if flight.bands:
        figures.append(FlightFigure("flags", lambda width: _flags(flight, width)))
    if flight.track is not None:
        figures.append(FlightFigure("track", lambda width: _track(flight, width)))
    return figures


def _of_group(panels: Iterable[Panel], group: str) -> list[Panel]:
    return [one for one in panels if one.group == group]


def _of_sets(panel: Panel, sets: Sequence[str]) -> Panel:
    """With the curves of some sets, and those that belong to none."""
    if not sets:
        return panel
    kept = tuple(one for one in panel.series if one.set is None or one.set in sets)
    return Panel(**{**panel.__dict__, "series": kept})


def _parts(name: str, panels: Sequence[Panel]) -> list[tuple[str, Sequence[Panel]]]:
    """Panels in figures of a few rows, the later ones with a number."""
    starts = range(0, len(panels), _MOST_ROWS)
    return [(name if not start else f"{name}_{start // _MOST_ROWS + 1}", panels[start : start + _MOST_ROWS])
            for start in starts]  # fmt: skip


def _stacked(flight: PlottedFlight, panels: Sequence[Panel]) -> Callable[[float], Figure]:
    def draw(width_mm: float) -> Figure:
        height = _HEAD_MM + _FOOT_MM + _ROW_MM * len(panels)
        figure = new_figure(width_mm / INCH_MM, height / INCH_MM)
        grid = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for axes, panel in zip(grid, panels, strict=True):
            _panel(axes, flight, panel)
        grid[-1].set_xlabel("time since the log began [s]")
        _legend(figure, list(grid), width_mm)
        return figure

    return draw


def _panel(axes: Axes, flight: PlottedFlight, panel: Panel) -> None:
    for place, one in enumerate(panel.series):
        _series(axes, flight, panel, one, place)
    if panel.log:
        decades(axes)
        axes.set_ylim(bottom=_SMALLEST_RATIO)
    if panel.limit is not None:
        axes.axhline(panel.limit, color=_REJECTED_COLOUR, linewidth=0.7, linestyle="--")
    if panel.kind == "innovation":
        axes.axhline(0.0, color="#888888", linewidth=0.5)
        _limit_to_bulk(axes, panel)
    title = panel.title if not panel.unit else f"{panel.title} [{panel.unit}]"
    axes.set_title(title, fontsize=7.5)
    if not panel.log:
        axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set_xlim(0.0, flight.duration_s)


def _series(axes: Axes, flight: PlottedFlight, panel: Panel, one: Series, place: int) -> None:
    colour, style = _look(flight, one, place)
    values = np.asarray(one.values, np.float64)
    if panel.log:
        values = np.maximum(values, _SMALLEST_RATIO)
    time = (one.time - flight.start_us) * 1e-6
    rows = drawn_rows(values)
    # bounds of one curve alone: several on each other nobody can read
    if one.sigma is not None and place == 0:
        _bounds(axes, time, values, one, colour, is_innovation=panel.kind == "innovation")
    if one.draw == "points":
        axes.plot(time[rows], values[rows], ".", color=colour, markersize=1.8, label=one.label)
    else:
        stepped = "steps-post" if one.draw == "step" else "default"
        axes.plot(
            time[rows], values[rows], color=colour, linestyle=style, linewidth=0.7, drawstyle=stepped, label=one.label
        )
    if one.rejected is not None and bool(np.any(one.rejected)):
        wild = np.flatnonzero(one.rejected)
        wild = wild[drawn_rows(values[wild])]
        axes.plot(
            time[wild], values[wild], "x", color=_REJECTED_COLOUR, markersize=2.5, markeredgewidth=0.6, label="rejected"
        )


def _bounds(
    axes: Axes, time: npt.NDArray[Any], values: Array, one: Series, colour: str, *, is_innovation: bool
) -> None:
    """±1σ, about zero where it is an innovation's, and the gate where the filter is not far more cautious than that."""
    sigma = np.asarray(one.sigma, np.float64)
    wide = drawn_rows(sigma)
    middle = np.zeros_like(sigma) if is_innovation else values
    low, high = middle[wide] - sigma[wide], middle[wide] + sigma[wide]
    axes.fill_between(time[wide], low, high, color=colour, alpha=0.18, linewidth=0, label="±1σ")
    if is_innovation and one.gate is not None and np.nanmedian(sigma) * one.gate < _NEAR_GATE * _reach(values):
        for side in (-1.0, 1.0):
            label = "gate" if side > 0.0 else None
            bound = side * one.gate * sigma[wide]
            axes.plot(time[wide], bound, color=_REJECTED_COLOUR, linewidth=0.6, linestyle=":", label=label)


def _reach(values: Array) -> float:
    """How far nearly all values go, so that single wild ones may leave the axes."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.quantile(known, 0.995)) if known.size else 0.0


def _look(flight: PlottedFlight, one: Series, place: int) -> tuple[str, str]:
    """Colour and line of a curve: a set's own, or those of its place."""
    return _set_look(flight, one.set, place)


def _set_look(flight: PlottedFlight, name: str | None, place: int) -> tuple[str, str]:
    if name in _OF_SETS:
        return _OF_SETS[name]
    told = next((shown for shown in flight.sets if shown.name == name), None)
    return (PRINT_COLOURS[told.style], "-") if told is not None else (_OTHER_COLOURS[place % len(_OTHER_COLOURS)], "-")


def _limit_to_bulk(axes: Axes, panel: Panel) -> None:
    """The innovations and a few σ must be seen; single wild samples may leave the axes."""
    reach = max(_reach(np.asarray(one.values, np.float64)) for one in panel.series)
    sigma = [np.asarray(one.sigma, np.float64) for one in panel.series[:1] if one.sigma is not None]
    claimed = max((float(np.nanmedian(one)) for one in sigma if np.isfinite(one).any()), default=0.0)
    gate = panel.series[0].gate
    is_near = gate is not None and claimed * gate < _NEAR_GATE * _reach(np.asarray(panel.series[0].values, np.float64))
    limit = 1.15 * max(reach, claimed * (gate if gate is not None and is_near else 1.5))
    if limit > 0.0:
        axes.set_ylim(-limit, limit)


def _legend(figure: Figure, grid: Sequence[Axes], width_mm: float) -> None:
    entries: dict[str, Any] = {}
    for axes in grid:
        handles, labels = axes.get_legend_handles_labels()
        entries |= {label: handle for label, handle in zip(labels, handles, strict=True) if label not in entries}
    if entries:
        columns = max(int(width_mm // 42.0), 2)
        figure.legend(list(entries.values()), list(entries), loc="outside upper left", ncols=columns)


def _flags(flight: PlottedFlight, width_mm: float) -> Figure:
    """Flight modes, states and alarms as bars over time, with their words."""
    rows = len(flight.bands)
    figure = new_figure(width_mm / INCH_MM, (_HEAD_MM + _FOOT_MM + _FLAG_MM * rows) / INCH_MM)
    axes = figure.add_subplot()
    for row, band in enumerate(flight.bands):
        for start, stop, words in band.spans:
            since, until = ((edge - flight.start_us) * 1e-6 for edge in (start, stop))
            axes.barh(row, until - since, 0.7, left=since, color=_OTHER_COLOURS[row % 2 * 5], alpha=0.75, linewidth=0)
            if words and band.id == "nav_state" and until - since > 0.06 * flight.duration_s:
                axes.text(0.5 * (since + until), row, words, ha="center", va="center", fontsize=6, color="white")
    axes.set_yticks(range(rows), [band.label for band in flight.bands], fontsize=6.5)
    axes.set_ylim(rows - 0.4, -0.6)
    axes.set_xlim(0.0, flight.duration_s)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("time since the log began [s]")
    return figure


def _track(flight: PlottedFlight, width_mm: float) -> Figure:
    """From above: what the receiver says, every replay, and the mission."""
    track = flight.track
    assert track is not None
    figure = new_figure(width_mm / INCH_MM, 0.8 * min(width_mm, 120.0) / INCH_MM)
    axes = figure.add_subplot()
    if track.mission:
        north, east = zip(*track.mission, strict=True)
        axes.plot(east, north, color="#666666", linestyle="--", linewidth=0.7, label="mission")
    if track.gnss is not None:
        axes.plot(track.gnss.east, track.gnss.north, ".", color="#d55e00", markersize=2.0, label="GNSS")
    shown: Mapping[str, PlaneTrack] = track.sets or {"estimate": track.flown}
    for place, (name, one) in enumerate(shown.items()):
        colour, style = _set_look(flight, name, place)
        axes.plot(
            one.east, one.north, color=colour, linestyle=style, linewidth=0.9, label=flight.labels.get(name, name)
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="east [m]", ylabel="north [m]")
    axes.legend(loc="best")
    return figure
