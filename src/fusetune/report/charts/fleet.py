"""All flights together: figures of their health in the order of time, and how they are spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from fusetune.apply.fleet.flights import SEVERITIES
from fusetune.report.charts.blocks import chart_block
from fusetune.report.charts.svg.axes import HEAD, LABEL_ROOM, NARROW, TICK_ROOM, Panel, head, x_axis, y_axis, y_room
from fusetune.report.charts.svg.elements import group, hinted, line, path_steps, px, rectangle, svg, text
from fusetune.report.charts.svg.legend import Entry, Symbol, legend, line_symbol, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.scales import Linear, Log, figure, round_values
from fusetune.report.counted import count_words
from fusetune.report.figure_words import figure_words
from fusetune.report.fleet.fleet_results import Document, FleetResults
from fusetune.report.fleet.shown_figures import is_spread, is_within_reach, trend_columns
from fusetune.report.set_styles import MARKERS

Array = npt.NDArray[np.float64]

_HEIGHT = 92.0
_TONES = 7
_DECADES = 50.0
_MARKED = {"fail": "bad", "warning": "warn"}
_HEADROOM = 1.2
_TRENDS = (
    "Figures that changed, and those beyond their limits on most flights; a mark for each flight in the order of time"
)
_HISTOGRAMS = "Flights by value; line: median, grey: the middle 90 %, dashed: the limit where it is near"


def trends_chart(results: FleetResults) -> str:
    """A panel per figure that changed or troubles: its value on each dated flight, a look per vehicle, medians between
    steps; empty with fewer than three dated flights or where no figure changed or lies beyond its limit."""
    dated = np.array([bool(one.date) for one in results.table.flights], bool)
    columns = trend_columns(results)
    rows = np.flatnonzero(dated)
    charts = [_trend(results, column, rows, with_legend=column == columns[0]) for column in columns]
    return chart_block(_TRENDS, charts)


def vehicle_looks(results: FleetResults) -> dict[str, tuple[str, str]]:
    """Class and marker of each of the vehicles that flew most; the rest is grey."""
    order = sorted(results.table.vehicles, key=lambda vehicle: -results.table.rows_of(vehicle).size)
    return {
        vehicle: (f"tone-{place}", MARKERS[place % len(MARKERS)]) if place < _TONES else ("quiet", MARKERS[0])
        for place, vehicle in enumerate(order)
    }


def _trend(results: FleetResults, column: int, rows: npt.NDArray[np.intp], *, with_legend: bool) -> str:
    table, name = results.table, results.table.figures[column]
    values = table.values[rows, column]
    looks = {
        one: look for one, look in vehicle_looks(results).items() if one in {table.flights[r].vehicle for r in rows}
    }
    limit = name.limit if name.limit is not None and is_within_reach(name.limit, values) else None
    y = _value_scale(values, limit)
    panel = Panel(Linear(0.4, rows.size + 0.6, y_room(y, most=4), NARROW - 8.0), y)
    title = figure_words(name.id)
    parts = [head(title), y_axis(panel, f"[{name.unit}]" if name.unit else "", most=4)]
    parts.append(x_axis(panel, "flight, by date", round_values(panel.x.low, panel.x.high, 5, whole=True), grid=False))
    if limit is not None:
        parts.append(
            hinted(f"limit: {figure(limit)}", line(panel.left, y.at(limit), panel.right, y.at(limit), "limit"))
        )
    changes = [one for one in results.changes if (one["id"], one["unit"]) == (name.id, name.unit)]
    parts += _steps(results, rows, values, changes, panel)
    for place, row in enumerate(rows):
        if not np.isfinite(values[place]) or (isinstance(y, Log) and values[place] <= 0.0):
            continue
        flight = table.flights[row]
        kind, shape = looks[flight.vehicle]
        across, down = panel.x.at(place + 1), y.at(float(values[place]))
        severity = SEVERITIES[table.severities[row, column]]
        ring = _MARKED.get(severity, "")
        beyond = _ring(ring)(across, down) if ring else ""
        words = f"{flight.name}: {figure(float(values[place]), 3)} {name.unit}".rstrip() + (
            f", {severity}" if ring else ""
        )
        parts.append(hinted(words, beyond, group(kind, marker(shape, across, down, 2.9))))
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    drawn, height = legend(_vehicle_entries(looks) if with_legend else (), below)
    known = values[np.isfinite(values)]
    said = (
        f"{known.size} flights, {figure(float(known.min()), 3)} to {figure(float(known.max()), 3)} {name.unit}"
        if known.size
        else ""
    )
    return svg("trend", title, said, NARROW, below + height, [*parts, drawn], "")


def _vehicle_entries(looks: Mapping[str, tuple[str, str]]) -> list[Entry]:
    entries = [
        Entry(marker_symbol(kind, shape), vehicle or "unknown vehicle")
        for vehicle, (kind, shape) in looks.items()
        if kind != "quiet"
    ]
    if any(kind == "quiet" for kind, _ in looks.values()):
        entries.append(Entry(marker_symbol("quiet", MARKERS[0]), "other vehicles"))
    rings = {"bad": "failure", "warn": "warning"}
    entries += [Entry(_ring(kind), f"{words}: beyond the limit") for kind, words in rings.items()]
    return [*entries, Entry(line_symbol("ink"), "medians before and after a change")]


def _ring(kind: str) -> Symbol:
    """Around a mark beyond its limit: whole for a failure, dashed for a warning."""
    look = "ring" if kind == "bad" else "ring dashed"
    return lambda x, y: group(kind, f'<circle class="{look}" cx="{px(x)}" cy="{px(y)}" r="5.6"/>')


def _value_scale(values: Array, limit: float | None) -> Linear | Log:
    """Logarithmic where a few flights would press all others onto the axis."""
    top, bottom = HEAD + 20.0, HEAD + 20.0 + _HEIGHT
    known = values[np.isfinite(values)]
    shown = [*known.tolist(), *([] if limit is None else [limit])]
    low, high = (min(shown), max(shown)) if shown else (0.0, 1.0)
    if known.size and low > 0.0 and high > _DECADES * float(np.median(known)):
        return Log(low / 1.3, high * 1.3, bottom, top)
    low = min(low, 0.0) if low > 0.0 and low < 0.5 * high else low
    margin = 0.08 * (high - low) or max(abs(high), 1.0) * 0.1
    return Linear(low - margin if low != 0.0 else 0.0, high + margin, bottom, top)


def _steps(
    results: FleetResults, rows: npt.NDArray[np.intp], values: Array, changes: Sequence[Document], panel: Panel
) -> list[str]:
    """Medians between the steps of a vehicle."""
    parts: list[str] = []
    flights = [results.table.flights[row] for row in rows]
    for vehicle in dict.fromkeys(one["vehicle"] for one in changes):
        of_it = [place for place, one in enumerate(flights) if one.vehicle == vehicle]
        starts = {one["flight"] for one in changes if one["vehicle"] == vehicle}
        edges = [place for place in of_it if flights[place].name in starts]
        for start, stop in zip([of_it[0], *edges], [*edges, of_it[-1] + 1], strict=True):
            inside = np.array([values[place] for place in of_it if start <= place < stop])
            known = inside[np.isfinite(inside)]
            if known.size and panel.y.holds(float(np.median(known))):
                median = float(np.median(known))
                ends = (panel.x.at(start + 0.6), panel.y.at(median), panel.x.at(stop + 0.4), panel.y.at(median))
                parts.append(hinted(f"median: {figure(median, 3)}", group("ink", line(*ends, "line"))))
        parts += [
            line(panel.x.at(edge + 0.5), panel.top, panel.x.at(edge + 0.5), panel.bottom, "now") for edge in edges
        ]
    return parts


def troubled_histograms_chart(results: FleetResults) -> str:
    """Histograms of the figures that lie beyond their limits on some flight; empty where none does."""
    return chart_block(_HISTOGRAMS, [_histogram(one) for one in results.figures if _is_troubled(one)])


def other_histograms_chart(results: FleetResults) -> str:
    """Histograms of all other figures that are spread; empty where there are none."""
    others = [one for one in results.figures if is_spread(one) and not _is_troubled(one)]
    return chart_block(_HISTOGRAMS, [_histogram(one) for one in others])


def _is_troubled(one: Document) -> bool:
    return is_spread(one) and one["verdict"]["worst"] in ("warning", "fail")


def _histogram(one: Document) -> str:
    """A figure of `fleet.json`: counts, median, middle 90 %, limit, and how many lie beyond the bins."""
    found, spread = one["histogram"], one["distribution"]
    edges, counts = [float(edge) for edge in found["edges"]], [int(count) for count in found["counts"]]
    limit = one["limit"] if is_within_reach(one["limit"], np.array([edges[0], edges[-1]])) else None
    shown = [*edges, spread["p05"], spread["p95"], spread["median"], *([] if limit is None else [limit])]
    margin = 0.04 * (max(shown) - min(shown))
    top = HEAD + 16.0
    y = Linear(0.0, _HEADROOM * max(*counts, 1), top + _HEIGHT - 20.0, top)
    ticks = y.ticks(3, whole=True)
    panel = Panel(Linear(min(shown) - margin, max(shown) + margin, 30.0, NARROW - 8.0), y)
    usual = [panel.x.at(spread[end]) for end in ("p05", "p95")]
    title = figure_words(one["id"]) + (f" [{one['unit']}]" if one["unit"] else "")
    parts = [head(title), rectangle(usual[0], panel.top, usual[1], panel.bottom, "ground")]
    parts += [y_axis(panel, ticks=ticks), x_axis(panel, grid=False)]
    bars = "".join(
        path_steps(panel.x([start, start, stop, stop]), y([0.0, count, count, 0.0])) + "Z"
        for start, stop, count in zip(edges, edges[1:], counts, strict=False)
        if count
    )
    low, middle, high = (figure(spread[name], 3) for name in ("p05", "median", "p95"))
    count = count_words(spread["n"], "flight")
    said = f"{count}: median {middle}, middle 90 % {low} to {high} {one['unit']}".rstrip()
    parts.append(group("tone-4", hinted(said, f'<path class="box" d="{bars}"/>')))
    median = panel.x.at(spread["median"])
    parts.append(group("ink", line(median, panel.top, median, panel.bottom, "line")))
    if limit is not None:
        parts.append(
            hinted(
                f"limit: {figure(limit)}", line(panel.x.at(limit), panel.top, panel.x.at(limit), panel.bottom, "limit")
            )
        )
    beyond = [f"{found[side]} {side}" for side in ("below", "above") if found[side]]
    parts.append(
        text(NARROW - 8.0, panel.top - 4.0, ", ".join([count_words(spread["n"], "flight"), *beyond]), "note", "end")
    )
    return svg("histogram", title, said, NARROW, panel.bottom + TICK_ROOM, parts, "")
