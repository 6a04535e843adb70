"""The drift of every set against the seconds without GNSS, in metres and against the present set."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from fusetune.report.charts.blocks import chart_block
from fusetune.report.charts.set_looks import set_class, set_entries, set_group, set_marker
from fusetune.report.charts.svg.axes import LABEL_ROOM, NARROW, TICK_ROOM, Panel, head, x_axis, y_axis, y_room
from fusetune.report.charts.svg.elements import area, group, line, path, rectangle, svg
from fusetune.report.charts.svg.legend import legend
from fusetune.report.charts.svg.scales import Linear, figure, percent, signed_figure
from fusetune.report.comparison import robust_reach
from fusetune.report.counted import count_words
from fusetune.report.results import Results
from fusetune.report.withheld import POSITION, VELOCITY, Withheld, drift_summary

_TOP, _HEIGHT = 38.0, 150.0
_HOPELESS = 3.0
_DODGE = 0.6
"""Share of the space between two horizons over which the sets are spread, so that their bars do not hide each other."""


def drift_chart(results: Results) -> str:
    """Drift of horizontal position and velocity, mean over the flights, and its change against the present set; empty
    where GNSS was not withheld often enough."""
    charts: list[str] = []
    for withheld in (POSITION, VELOCITY):
        summary = drift_summary(results, withheld)
        if len(summary):
            charts.append(_absolute(results, withheld, summary, with_legend=not charts))
            if len(results.shown) > 1:
                charts.append(_relative(results, withheld, summary))
    return chart_block("Drift while GNSS was withheld, mean over the flights", charts)


def _label(withheld: Withheld) -> str:
    return withheld.label[0].upper() + withheld.label[1:]


def _horizons(summary: pd.DataFrame) -> list[float]:
    return sorted(set(summary.index.get_level_values("horizon_s")))


def _curves(results: Results, summary: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Of each set that has one, the present one last, so that it lies on top."""
    order = [*(name for name in results.shown if name != results.present), results.present]
    found = {str(name): rows.droplevel("set").sort_index() for name, rows in summary.groupby(level="set")}
    return {name: found[name] for name in order if name in found}


def _absolute(results: Results, withheld: Withheld, summary: pd.DataFrame, *, with_legend: bool) -> str:
    curves, horizons = _curves(results, summary), _horizons(summary)
    # A set that drifts so much further may leave the plot, and must not squeeze the others.
    present = curves.get(results.present)
    hopeless = math.inf if present is None else _HOPELESS * float(present["mean"].max())
    reach = max((most for one in curves.values() if (most := float(one["mean"].max())) <= hopeless), default=1.0)
    shaded = [name for name in curves if name in (results.present, results.decision["chosen"])]
    reach = max([reach, *(float(curves[name]["high"].max()) for name in shaded)]) or 1.0
    y = Linear(0.0, 1.05 * reach, _TOP + _HEIGHT, _TOP)
    x = Linear(min(horizons) - 0.4, max(horizons) + 0.4, y_room(y), NARROW - 10.0)
    panel = Panel(x, y)
    parts = [head(_label(withheld)), y_axis(panel, f"drift [{withheld.unit}]")]
    parts.append(x_axis(panel, "time without GNSS [s]", ticks=horizons))
    for name in shaded:
        one = curves[name]
        band = area(x(one.index), y(np.minimum(one["low"], y.high)), y(np.minimum(one["high"], y.high)), "band")
        parts.append(group(set_class(results, name), band))
    said = []
    for name, one in curves.items():
        last = float(one["mean"].iloc[-1])
        words = f"{name}: {figure(last, 3)} {withheld.unit} after {one.index[-1]:g} s"
        said.append(words)
        down = np.where(one["mean"] <= y.high, y(one["mean"]), np.nan)
        marks = [set_marker(results, name, float(a), float(b), 3.2)
                 for a, b in zip(x(one.index), down, strict=True) if math.isfinite(b)]  # fmt: skip
        kind = "line" if name in shaded else "thin"
        parts.append(set_group(results, name, words, path(x(one.index), down, kind), *marks))
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    names = [name for name in results.shown if name in curves]
    drawn, height = legend(set_entries(results, names, "thin") if with_legend else (), below)
    return svg("drift", _label(withheld), "; ".join(said), NARROW, below + height, [*parts, drawn], "")


def _relative(results: Results, withheld: Withheld, summary: pd.DataFrame) -> str:
    curves, horizons = _curves(results, summary), _horizons(summary)
    curves.pop(results.present, None)
    others = [name for name in results.shown if name in curves]
    step = float(np.min(np.diff(horizons))) if len(horizons) > 1 else 1.0
    offsets = np.linspace(-0.5, 0.5, len(others)) * _DODGE * step if len(others) > 1 else np.zeros(len(others))
    shown = summary[summary.index.get_level_values("set").isin(others)]
    able = [not results.is_ruled_out(name) for name in shown.index.get_level_values("set")]
    limits = robust_reach(shown["change_low"], shown["change_high"], able)
    y = Linear(*limits, _TOP + _HEIGHT, _TOP)
    x = Linear(horizons[0] - 0.5 * step, horizons[-1] + 0.5 * step, y_room(y, signed_figure), NARROW - 10.0)
    panel, title = Panel(x, y), f"{_label(withheld)}, against now"
    zero = y.at(0.0)
    parts = [head(title), rectangle(panel.left, zero, panel.right, panel.bottom, "better")]
    parts.append(y_axis(panel, "change [%], below 0 is better; ± 1 standard error", words=signed_figure))
    parts.append(x_axis(panel, "time without GNSS [s]", ticks=horizons, grid=False))
    parts.append(line(panel.left, zero, panel.right, zero, "zero"))
    said = []
    for name, offset in zip(others, offsets.tolist(), strict=True):
        one = curves[name]
        for seconds, change, low, high, flights in zip(
            one.index, one["change"], one["change_low"], one["change_high"], one["flights"], strict=True
        ):
            words = f"{name}: {percent(change)} after {seconds:g} s, {count_words(int(flights), 'flight')}"
            place = x.at(seconds + offset)
            bottom, top = (float(np.clip(y.at(end), panel.top, panel.bottom)) for end in (low, high))
            mark = set_marker(results, name, place, y.at(change), 3.4) if y.holds(change) else ""
            if mark or top < bottom:
                parts.append(set_group(results, name, words, line(place, bottom, place, top, "line"), mark))
        said.append(f"{name}: {percent(float(one['change'].iloc[-1]))} after {one.index[-1]:g} s")
    height = panel.bottom + TICK_ROOM + LABEL_ROOM
    return svg("drift-change", title, "; ".join(said), NARROW, height, parts, "")
