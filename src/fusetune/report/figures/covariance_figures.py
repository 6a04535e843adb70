"""Figures of a covariance design: what each alternative does to each state, and curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fusetune.design.covariance.changes import Sweep
from fusetune.design.covariance.evaluation import BETTER, WITHOUT, Evaluation
from fusetune.design.names import one_line
from fusetune.px4.aid_sources import SENSORS
from fusetune.report.figures.drawing import (
    BAD_COLOUR,
    GOOD_COLOUR,
    PRESENT_COLOUR,
    figure_style,
    minus,
    new_figure,
    save_svg,
)
from fusetune.storage.files import AnyPath

TORNADO = "tornado.svg"
MOST_ROWS = 10
_TALL_COLUMNS, _COLUMNS = 2, 3
_NO_CHANGE = 0.5
"""Percent; what does less is left out."""
_MANIFOLD = 1000.0
"""Percent from which on a change is told as a multiple."""
_WIDE = 8.0
"""Ratio from which on an axis is logarithmic."""
_MARKERS = (("o", "-"), ("s", "--"), ("^", "-."), ("D", ":"), ("v", "-"))


@dataclass(frozen=True)
class TornadoRow:
    """Changes (%) of a state by one property of one sensor."""

    label: str
    better: float = 0.0
    worse: float = 0.0
    without: float | None = None

    @property
    def reach(self) -> float:
        """By which rows are ordered."""
        return max(abs(self.better), abs(self.worse))


def draw_evaluation(evaluation: Evaluation, folder: AnyPath) -> list[Path]:
    """Draw all figures of a design into a folder; their files."""
    files = []
    with figure_style():
        if any(one.alternative for one in evaluation.evaluated):
            files.append(Path(folder) / TORNADO)
            save_svg(tornado_figure(evaluation), files[-1])
        for sweep in evaluation.sweeps:
            files.append(Path(folder) / f"sweep_{sweep.name}.svg")
            save_svg(sweep_figure(evaluation, sweep), files[-1])
    return files


def tornado_rows(evaluation: Evaluation, state: str) -> list[TornadoRow]:
    """What each property of each sensor does to a state, the most first; not those that do nothing."""
    rows: dict[tuple[str, str], dict[str, float]] = {}
    without: dict[str, float] = {}
    for one in evaluation.evaluated:
        of = one.alternative
        if of is None:
            continue
        change = 100.0 * one.change(evaluation.base, state)
        if of.subject == WITHOUT:
            without[of.sensor] = change
        else:
            side = "better" if of.what == BETTER[of.subject] else "worse"
            rows.setdefault((of.sensor, of.subject), {})[side] = change
    found = [
        TornadoRow(f"{_sensor(sensor)}, {subject}", sides.get("better", 0.0), sides.get("worse", 0.0))
        for (sensor, subject), sides in rows.items()
    ]
    found += [TornadoRow(f"without {_sensor(sensor)}", without=change) for sensor, change in without.items()]
    found.sort(key=lambda row: (row.without is not None, -row.reach, -(row.without or 0.0)))
    return [row for row in found if row.reach >= _NO_CHANGE or abs(row.without or 0.0) >= _NO_CHANGE]


def tornado_figure(evaluation: Evaluation) -> Figure:
    """A panel for each judged state: what halving and doubling each property does, and doing without."""
    states = evaluation.judged
    rows = {state: tornado_rows(evaluation, state) for state in states}
    columns = min(_TALL_COLUMNS, len(states))
    deepest = [
        max(_shown(rows[state]) for state in states[first : first + columns])
        for first in range(0, len(states), columns)
    ]
    figure = new_figure(4.6 * columns, 0.6 + sum(0.75 + 0.22 * max(depth, 2) for depth in deepest))
    grid = figure.subplots(
        len(deepest), columns, squeeze=False, gridspec_kw={"height_ratios": [max(depth, 2) + 1 for depth in deepest]}
    )
    for index, axes in enumerate(grid.flat):
        axes.set_visible(index < len(states))
        if index < len(states):
            _draw_tornado(axes, rows[states[index]], _title(evaluation, states[index]))
    figure.suptitle(
        f"{evaluation.design}: √P {_when(evaluation)} if one thing is better (noise ÷2, rate ×2, delay ÷2) or worse",
        fontsize=9.5,
        x=0.01,
        ha="left",
    )
    return figure


def _shown(rows: Sequence[TornadoRow]) -> int:
    return min(sum(row.without is None for row in rows), MOST_ROWS) + sum(row.without is not None for row in rows)


def _title(evaluation: Evaluation, state: str) -> str:
    told = evaluation.base[state]
    return f"{_words(state)}: √P {told.judged:.3g} {_unit(told.unit)}"


def _sensor(name: str) -> str:
    return SENSORS[name].label if name in SENSORS else _words(name)


def _words(name: str) -> str:
    """Names of words lose their underscores; `p_x` is a sign and keeps it."""
    parts = name.split("_")
    return " ".join(parts) if all(len(part) > 1 for part in parts) else name


def _change_words(change: float) -> str:
    return minus(f"{change:+.0f} %") if change < _MANIFOLD else f"×{1.0 + change / 100.0:.0f}"


def _when(evaluation: Evaluation) -> str:
    at_present = any(told.now is not None for told in evaluation.base.values())
    return "at present" if at_present else "just before correction"


def _unit(unit: str) -> str:
    return {"deg": "°", "m/s^2": "m/s²", "gauss": "G"}.get(unit, _as_written(unit))


def _as_written(text: str) -> str:
    """On one line, and with dollars that begin no formula."""
    return one_line(text).replace("$", r"\$")


def _draw_tornado(axes: Axes, rows: Sequence[TornadoRow], title: str) -> None:
    bars = [row for row in rows if row.without is None][:MOST_ROWS]
    absent = [row for row in rows if row.without is not None]
    axes.set_title(title, fontsize=9, loc="left")
    if not bars and not absent:
        axes.text(0.5, 0.5, "nothing changes it", ha="center", va="center", transform=axes.transAxes, color="#666666")
        axes.set_axis_off()
        return
    reach = 1.08 * max([row.reach for row in bars] + [5.0])
    for place, row in enumerate(bars):
        for change in sorted((row.better, row.worse), key=abs, reverse=True):
            axes.barh(place, change, height=0.7, color=GOOD_COLOUR if change < 0.0 else BAD_COLOUR)
    for place, row in enumerate(absent, len(bars)):
        change = row.without or 0.0
        axes.barh(place, math.copysign(min(abs(change), reach), change), height=0.7, color="#B0B0B0")
        if abs(change) > 0.35 * reach:
            axes.annotate(_change_words(change), (0.0, place), (3 if change > 0 else -3, 0), fontsize=7.5,
                          textcoords="offset points", va="center", ha="left" if change > 0 else "right")  # fmt: skip
    axes.axvline(0.0, color=PRESENT_COLOUR, linewidth=0.8)
    axes.set_yticks(range(len(bars) + len(absent)), [row.label for row in (*bars, *absent)])
    axes.set_ylim(len(bars) + len(absent) - 0.4, -0.6)
    axes.set_xlim(-reach, reach)
    axes.grid(visible=False, axis="y")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(lambda value, _: minus(f"{value:+.4g} %") if value else "0")


def sweep_figure(evaluation: Evaluation, sweep: Sweep) -> Figure:
    """A panel for each state, a curve for each thing that changes."""
    states = sweep.states or evaluation.judged
    columns = _COLUMNS if len(states) % _COLUMNS == 0 else min(_TALL_COLUMNS, len(states))
    rows = -(-len(states) // columns)
    figure = new_figure(3.3 * columns, 0.9 + 2.4 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for index, axes in enumerate(grid.flat):
        axes.set_visible(index < len(states))
        if index < len(states):
            _draw_sweep(axes, evaluation, sweep, states[index])
            if index + columns >= len(states):
                axes.set_xlabel(_as_written(sweep.label) or ("factor" if sweep.factors else sweep.lines[0]))
                axes.tick_params(labelbottom=True)
    if len(sweep.lines) > 1:
        figure.legend(
            *grid.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=min(len(sweep.lines), 4)
        )
    figure.suptitle(f"{evaluation.design}: √P {_when(evaluation)}", fontsize=9.5, x=0.01, ha="left")
    return figure


def _draw_sweep(axes: Axes, evaluation: Evaluation, sweep: Sweep, state: str) -> None:
    base = evaluation.base[state]
    told = []
    for line, (marker, style) in zip(sweep.lines, cycle(_MARKERS)):
        points = [(one.point, one.deviations[state].judged) for one in evaluation.points
                  if one.sweep == sweep.name and one.line == line]  # fmt: skip
        told += [value for _, value in points]
        axes.plot(*zip(*points, strict=True), marker=marker, linestyle=style, markersize=4, label=_line_words(line))
    axes.axhline(base.judged, color="#888888", linewidth=0.8, linestyle=":")
    axes.annotate("as designed", (0.0, base.judged), (3, 3), xycoords=("axes fraction", "data"),
                  textcoords="offset points", ha="left", fontsize=7, color="#666666")  # fmt: skip
    low, high = min(sweep.points), max(sweep.points)
    if low > 0.0 and high / low > _WIDE:
        axes.set_xscale("log")
        axes.set_xticks(sweep.points, [f"{point:g}" for point in sweep.points])
        axes.minorticks_off()
    if min(told) > 0.0 and max(told) / min(told) > _WIDE:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0.0, 1.08 * max(told))
    axes.set_title(_words(state), fontsize=9, loc="left")
    axes.set_ylabel(_unit(base.unit))


def _line_words(line: str) -> str:
    words = {"sd": "noise", "rate_hz": "rate", "delay_ms": "delay"}
    parts = [name.partition(".") for name in line.split(" + ")]
    return " and ".join(f"{_sensor(name)} {words.get(what, what)}".strip() for name, _, what in parts)
