"""The innovations of all flights by set: against the present set, as boxes, their consistency, and fusion breaks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.analyze.metrics.break_rate import clopper_pearson
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.charts.blocks import chart_block, figures_table
from fusetune.report.charts.set_looks import name_classes, set_class, set_entries, set_group, set_marker
from fusetune.report.charts.svg.axes import HEAD, LABEL_ROOM, NARROW, TICK_ROOM, Panel, head, x_axis
from fusetune.report.charts.svg.elements import boxed, dots, group, hinted, line, rectangle, svg
from fusetune.report.charts.svg.legend import Entry, legend, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.rows import Rows, rows_of
from fusetune.report.charts.svg.scales import Linear, Log, figure, percent, signed_figure
from fusetune.report.comparison import robust_reach
from fusetune.report.innovation_tables import (
    BREAK_METRICS,
    CONSISTENT_WHISKER,
    box_figures,
    break_sources,
    consistency_rows,
    pooled_breaks,
    rms_table,
)
from fusetune.report.markup import Cell, number
from fusetune.report.results import PooledSamples, Results, figure_values

Array = npt.NDArray[np.float64]

_ROW = 17.0
_BREAK_ROW = 26.0
_RIGHT = 10.0
_BREAK_LOOKS = (("tone-4", "circle", -7.0), ("tone-3", "square", 0.0), ("tone-0", "triangle", 7.0))
_MOST_MARKS = 10
"""Flights in a row of which each has a mark that says which it is."""
_LEAST_BREAKS = 0.01
"""Percent, where the axis of break rates begins; what is rarer, or never was, stands there."""


def _set_rows(results: Results, names: Sequence[str], height: float) -> Rows:
    return rows_of(names, HEAD + 4.0, height, kinds=name_classes(results, names))


def _chart(name: str, title: str, said: Sequence[str], panel: Panel, parts: Sequence[str]) -> str:
    return svg(name, title, "; ".join(said), NARROW, panel.bottom + TICK_ROOM + LABEL_ROOM, [head(title), *parts], "")


def _told_of(results: Results) -> tuple[str, str]:
    """Sets that the description of a panel tells of; the others are in the table."""
    return results.present, str(results.decision["chosen"])


def rms_chart(results: Results) -> str:
    """RMS innovation of each variable of the paper's table 12 against the present set's; empty where none is known."""
    table = rms_table(results)
    base = table[results.present]
    variables = [str(one) for one in table.index if np.isfinite(base[one]) and base[one] > 0.0]
    others = [name for name in table.columns if name != results.present]
    if not variables or not others:
        return ""
    changes = 100.0 * (table.loc[variables, others].to_numpy(np.float64) / base[variables].to_numpy()[:, None] - 1.0)
    able = np.broadcast_to([not results.is_ruled_out(name) for name in others], changes.shape)
    left, right = robust_reach(changes, changes, able)
    row_height = max(24.0, 3.4 * len(others))
    rows = rows_of(variables, HEAD + 4.0, row_height)
    panel = Panel(Linear(left, right, rows.room, NARROW - _RIGHT), Linear(len(variables), 0.0, rows.bottom, rows.top))
    zero = panel.x.at(0.0)
    title = "RMS of the innovations against now"
    parts = [rectangle(panel.left, panel.top, zero, panel.bottom, "better"), rows.labels()]
    parts.append(x_axis(panel, "RMS innovation, change [%]", words=signed_figure))
    parts += [
        line(panel.left, rows.y(row - 0.5), panel.right, rows.y(row - 0.5), "grid") for row in range(1, len(variables))
    ]
    parts.append(line(zero, panel.top, zero, panel.bottom, "zero"))
    offsets = np.linspace(-0.36, 0.36, len(others)) if len(others) > 1 else np.zeros(1)
    said = []
    for column, (name, offset) in enumerate(zip(others, offsets.tolist(), strict=True)):
        for row, variable in enumerate(variables):
            change = float(changes[row, column])
            if math.isfinite(change):
                x = float(np.clip(panel.x.at(change), panel.left, panel.right))
                hint = f"{name}, {variable}: {percent(change)}"
                parts.append(set_group(results, name, hint, set_marker(results, name, x, rows.y(row + offset), 3.4)))
        if name in _told_of(results):
            told = zip(variables, changes[:, column].tolist(), strict=True)
            said.append(f"{name}: {', '.join(f'{one} {percent(value)}' for one, value in told)}")
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    drawn, height = legend(set_entries(results, others), below)
    chart = svg("rms", title, "; ".join(said), NARROW, below + height, [head(title), *parts, drawn], "")
    return chart_block("", [chart])


def innovations_chart(results: Results, pooled: Sequence[PooledSamples]) -> str:
    """Boxes of the innovations per set, a panel for each source and axis; empty where none was scored."""
    return _boxes(results, pooled, "Innovations of the flights that decide: box 25–75 %, whiskers 5–95 %", False)


def normalised_innovations_chart(results: Results, pooled: Sequence[PooledSamples]) -> str:
    """As `innovations_chart`, divided by the standard deviation that the filter claims."""
    title = "Innovations divided by their standard deviation: box 25–75 %, whiskers 5–95 %; dashed: as they should end"
    return _boxes(results, pooled, title, True)


def _boxes(results: Results, pooled: Sequence[PooledSamples], title: str, normalised: bool) -> str:
    found = [(one, box_figures(one, results.shown, normalised=normalised)) for one in pooled]
    charts = [_box_panel(results, samples, boxes, normalised) for samples, boxes in found if boxes]
    head_words = ("source", "unit", "set", "5 %", "25 %", "median", "75 %", "95 %")
    table: list[list[Cell | str]] = [
        [samples.label, _unit(samples, normalised), name, *(number(float(one)) for one in box)]
        for samples, boxes in found
        for name, box in boxes.items()
    ]
    return chart_block(title, charts, figures_table(head_words, table)) if charts else ""


def _unit(samples: PooledSamples, normalised: bool) -> str:
    return "σ" if normalised else AID_SOURCES[samples.source].unit


def _box_panel(results: Results, samples: PooledSamples, boxes: dict[str, Array], normalised: bool) -> str:
    names, values = list(boxes), np.array(list(boxes.values()))
    rows = _set_rows(results, names, _ROW)
    # A set that is not eligible may leave the plot; it must not squeeze the others.
    kept = np.array([not results.is_ruled_out(name) for name in names])
    reach = float(max(0.0, values[:, 3].max(), -values[:, 1].min(), *values[kept, 4], *-values[kept, 0]))
    reach = 1.12 * max(reach, CONSISTENT_WHISKER if normalised else 0.0, 1e-12)
    panel = Panel(Linear(-reach, reach, rows.room, NARROW - _RIGHT), Linear(len(names), 0.0, rows.bottom, rows.top))
    unit = _unit(samples, normalised)
    parts = [rows.labels(), x_axis(panel, f"innovation [{unit}]", words=signed_figure)]
    zero = panel.x.at(0.0)
    parts.append(line(zero, panel.top, zero, panel.bottom, "axis"))
    for limit in (-CONSISTENT_WHISKER, CONSISTENT_WHISKER) if normalised else ():
        parts.append(line(panel.x.at(limit), panel.top, panel.x.at(limit), panel.bottom, "expected"))
    said = []
    for row, (name, box) in enumerate(boxes.items()):
        low, q1, median, q3, high = np.clip(panel.x(box), panel.left, panel.right).tolist()
        words = f"{name}: median {figure(box[2], 3)} {unit}, 90 % from {figure(box[0], 3)} to {figure(box[4], 3)}"
        said += [words] if name in _told_of(results) else []
        parts.append(set_group(results, name, words, boxed(low, q1, median, q3, high, rows.y(row))))
    return _chart("boxes", samples.label, said, panel, parts)


def consistency_chart(results: Results) -> str:
    """Mean NIS of each flight and set, divided by its expectation, with the χ² bounds of both kinds; empty where no
    source has enough samples."""
    found = consistency_rows(results)
    if not found:
        return ""
    charts = [_consistency_panel(results, *one) for one in found]
    title = (
        "Mean NIS divided by what it should be, a mark for each flight, full within its bounds: left of the line the "
        "filter is too cautious, right too sure"
    )
    table: list[list[Cell | str]] = []
    for source, axis, rows in found:
        dimension = _dimension(source, axis)
        by_set = _by_set(rows)
        for name in results.shown:
            own = by_set.get(name)
            if own is not None:
                ratios = own["value"].to_numpy(np.float64) / dimension
                inside = int(((own["lower"] <= own["value"]) & (own["value"] <= own["upper"])).sum())
                spread = (float(np.median(ratios)), float(ratios.min()), float(ratios.max()))
                table.append([AID_SOURCES[source].label, name, *map(number, spread), f"{inside} of {len(own)}"])
    words = ("source", "set", "median", "smallest", "largest", "flights within bounds")
    return chart_block(title, charts, figures_table(words, table))


def _by_set(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    return {str(name): own for name, own in rows.groupby("set", observed=True)}


def _dimension(source: str, axis: str) -> float:
    return float(len(dict(AID_SOURCES[source].groups)[axis]))


def _consistency_panel(results: Results, source: str, axis: str, found: pd.DataFrame) -> str:
    expected = _dimension(source, axis)
    by_set = _by_set(found)
    names = [name for name in results.shown if name in by_set]
    rows = _set_rows(results, names, _ROW)
    ratios = found["value"].to_numpy(np.float64) / expected
    bounds = [float(found[column].median()) / expected for column in ("lower", "upper")]
    known = ratios[np.isfinite(ratios) & (ratios > 0.0)]
    low, high = min(*bounds, known.min(initial=1.0), 0.5), max(*bounds, known.max(initial=1.0), 2.0)
    panel = Panel(
        Log(max(low / 1.15, 1e-6), high * 1.15, rows.room, NARROW - _RIGHT),
        Linear(len(names), 0.0, rows.bottom, rows.top),
    )
    one, ends = panel.x.at(1.0), [panel.x.at(max(end, panel.x.low)) for end in bounds]
    parts = [rows.labels(), group("good", rectangle(ends[0], panel.top, ends[1], panel.bottom, "band"))]
    parts.append(x_axis(panel, "mean NIS / expected"))
    parts.append(group("good", line(one, panel.top, one, panel.bottom, "line")))
    paper = figure_values(results, source, axis, "mean_nis")
    for column in ("lower", "upper"):
        end = float(paper[column].median()) / expected if len(paper) else math.nan
        if panel.x.holds(end):
            parts.append(line(panel.x.at(end), panel.top, panel.x.at(end), panel.bottom, "expected"))
    said = []
    for row, name in enumerate(names):
        own = by_set[name]
        parts.append(_flight_marks(results, name, own, expected, panel, rows.y(row)))
        if name in _told_of(results):
            said.append(f"{name}: median {figure(float(own['value'].median()) / expected, 3)}")
    return _chart("consistency", AID_SOURCES[source].label, said, panel, parts)


def _flight_marks(results: Results, name: str, own: pd.DataFrame, expected: float, panel: Panel, y: float) -> str:
    """A mark for each flight, full within its bounds; of many flights small ones that say nothing by themselves."""
    values, lower, upper = (own[name].to_numpy(np.float64) for name in ("value", "lower", "upper"))
    inside = (lower <= values) & (values <= upper)
    places = panel.x(values / expected)
    shape = results.styles[name].marker
    if len(own) <= _MOST_MARKS:
        marks = [
            hinted(f"{flight}: {figure(value / expected, 3)}", marker(shape, x, y, 3.2, hollow=not is_inside))
            for flight, value, x, is_inside in zip(own["flight"], values, places, inside, strict=True)
            if math.isfinite(x)
        ]
        return group(set_class(results, name), *marks)
    ratios = f"{figure(float(values.min()) / expected, 3)} to {figure(float(values.max()) / expected, 3)}"
    words = f"{name}: {ratios}, {int(inside.sum())} of {len(own)} flights within bounds"
    outside = dots(places[~inside], y, 2.6, "ring")
    return set_group(results, name, words, outside, dots(places[inside], y, 2.6, "mark"))


def breaks_chart(results: Results) -> str:
    """Fusion break rates at 3 σ, 5 σ and the gate per source and set with intervals; empty where none was counted."""
    confidence = results.decision["rule"]["confidence"]
    charts: list[str] = []
    table: list[list[Cell | str]] = []
    for source in break_sources(results):
        chart, rows = _break_panel(results, source, with_legend=not charts)
        charts.append(chart)
        table += rows
    title = f"Share of samples beyond 3 σ, 5 σ and the gate, any axis, with {confidence:.0%} Clopper–Pearson interval"
    words = ("source", "set", "limit", "beyond", "samples", "share %", "from", "to")
    return chart_block(title, charts, figures_table(words, table)) if charts else ""


def _break_panel(results: Results, source: str, *, with_legend: bool) -> tuple[str, list[list[Cell | str]]]:
    confidence = results.decision["rule"]["confidence"]
    counted = {metric: pooled_breaks(results, source, metric) for metric in BREAK_METRICS}
    names = [name for name in results.shown if any(name in one for one in counted.values())]
    rows = _set_rows(results, names, _BREAK_ROW)
    panel = Panel(Log(_LEAST_BREAKS, 100.0, rows.room, NARROW - _RIGHT), Linear(len(names), 0.0, rows.bottom, rows.top))
    ticks = [0.01, 0.1, 1.0, 10.0, 100.0]
    parts = [rows.labels(), x_axis(panel, "samples beyond the limit [%]", ticks, _break_tick)]
    said: list[str] = []
    table: list[list[Cell | str]] = []
    for (metric, label), (look, shape, shift) in zip(BREAK_METRICS.items(), _BREAK_LOOKS, strict=True):
        marks = []
        for row, name in enumerate(names):
            if name not in counted[metric]:
                continue
            beyond, samples = counted[metric][name]
            bounds = clopper_pearson(beyond, samples, confidence)
            low, share, high = (100.0 * float(one) for one in (bounds.lower, bounds.value, bounds.upper))
            x1, x, x2 = (panel.x.at(max(one, _LEAST_BREAKS)) for one in (low, share, high))
            y = rows.y(row) + shift
            words = f"{label}: {beyond} of {samples}, {figure(share, 3)} %"
            marks.append(hinted(words, line(x1, y, x2, y, "line"), marker(shape, x, y, 2.8)))
            said += [f"{name}, {words}"] if name in _told_of(results) else []
            table.append([AID_SOURCES[source].label, name, label, number(beyond), number(samples), number(share, 3),
                          number(low, 2), number(high, 2)])  # fmt: skip
        parts.append(group(look, *marks))
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    entries = [
        Entry(marker_symbol(look, shape, through="line"), label)
        for label, (look, shape, _) in zip(BREAK_METRICS.values(), _BREAK_LOOKS, strict=True)
    ]
    drawn, height = legend(entries if with_legend else (), below)
    label = AID_SOURCES[source].label
    return svg("breaks", label, "; ".join(said), NARROW, below + height, [head(label), *parts, drawn], ""), table


def _break_tick(value: float) -> str:
    return "0" if value == _LEAST_BREAKS else figure(value)
