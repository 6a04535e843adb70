"""Figures of the comparison with the present set: forest plot, flights by sets, aided against unaided."""

import math
import textwrap

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fusetune.apply.evidence import AIDED, UNAIDED
from fusetune.apply.pareto import pareto_front
from fusetune.report.change_cells import cell_words, colour_reach
from fusetune.report.comparison import (
    AIM_LABELS,
    SCORE,
    aim_changes,
    flight_changes,
    known_ends,
    robust_reach,
    told_aims,
)
from fusetune.report.figures.drawing import GOOD_COLOUR, PRESENT_COLOUR, empty_figure, label_sets, minus, new_figure
from fusetune.report.figures.set_styles import SetStyle, set_styles, status_colour
from fusetune.report.flight_names import short_names
from fusetune.report.results import OUT, Results

Limits = tuple[float, float]

NOTHING_TO_COMPARE = "Only the present set was scored: there is nothing to compare."

_ANNOTATED_CELLS = 240
_TITLE_WIDTH = 18
_LONGEST_NAME = 30


def differences(results: Results) -> Figure:
    """Forest plot: every set's prediction error against the present set's with its interval, in all it is judged by."""
    score = aim_changes(results, SCORE)
    if score.empty:
        return empty_figure(NOTHING_TO_COMPARE)
    names = list(score.index)
    panels = (SCORE, *told_aims(results))
    label_inches = 0.3 + 0.066 * max(len(_row_label(name, results)) for name in names)
    figure = new_figure(label_inches + 2.45 * len(panels), 1.35 + 0.26 * len(names))
    grid = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, aim in zip(grid, panels, strict=True):
        _forest(axes, results, aim, names)
        label_sets(axes, [_row_label(name, results) for name in names])
        axes.tick_params(labelleft=axes is grid[0], left=axes is grid[0])
    confidence = results.decision["rule"]["confidence"]
    figure.suptitle(
        f"Prediction error against the present set, mean over flights with {confidence:.0%} interval",
        fontsize=9.5, x=0.01, ha="left",
    )  # fmt: skip
    figure.supxlabel("change of the prediction error [%]; left of the line is better", fontsize=8.5)
    return figure


def _row_label(name: str, results: Results) -> str:
    return f"{shortened(name)} (not eligible)" if results.is_ruled_out(name) else shortened(name)


def _forest(axes: Axes, results: Results, aim: str, names: list[str]) -> None:
    changes = aim_changes(results, aim).reindex(names)
    able = (~changes["status"].isin(OUT)).to_numpy()
    left, right = robust_reach(*known_ends(changes), able)
    axes.axvspan(left, 0.0, color=GOOD_COLOUR, alpha=0.07, linewidth=0)
    for row, (name, one) in enumerate(changes.iterrows()):
        if not math.isfinite(one["change"]):
            continue
        colour = status_colour(results, str(name))
        low, high = max(left, one["lower"]), min(right, one["upper"])
        if math.isfinite(one["lower"]) and low < high:
            axes.plot([low, high], [row, row], color=colour, linewidth=2.0, solid_capstyle="butt")
        if left <= one["change"] <= right:
            hollow = one["status"] in OUT
            axes.plot(one["change"], row, "o", color=colour, markersize=5, fillstyle="none" if hollow else "full")
        else:
            _beyond(axes, row, one["change"], left, right)
    axes.axvline(0.0, color=PRESENT_COLOUR, linewidth=1.0)
    axes.set_xlim(left, right)
    axes.set_title(textwrap.fill(AIM_LABELS[aim], _TITLE_WIDTH))


def _beyond(axes: Axes, row: int, change: float, left: float, right: float) -> None:
    """A set outside the plot: an arrow at the edge with its figure."""
    edge, arrow, side = (right, "▶", "right") if change > right else (left, "◀", "left")
    text = f"{change:+.0f} % {arrow}" if side == "right" else f"{arrow} {change:+.0f} %"
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    axes.text(edge, row, minus(text), ha=side, va="center", fontsize=7, color="#555555", bbox=box)


def flights_by_sets(results: Results) -> Figure:
    """Heat map: on each flight, how much larger or smaller the prediction error is than the present set's."""
    changes = flight_changes(results)
    if changes.empty or not len(changes.columns):
        return empty_figure(NOTHING_TO_COMPARE)
    values = changes.to_numpy()
    labels = list(short_names(map(str, changes.index)).values())
    numbered = [f"{label}  {i}" for i, label in enumerate(labels, start=1)]
    label_inches = 0.3 + 0.066 * max(map(len, numbered))
    # no narrower than its title
    width = max(label_inches + 1.2 + 0.6 * len(changes.columns), 3.8)
    figure = new_figure(width, max(1.3 + 0.25 * len(numbered), 2.3))
    axes = figure.add_subplot()
    limit = colour_reach(values)
    image = axes.imshow(values, cmap="PuOr_r", vmin=-limit, vmax=limit, aspect="auto")
    names = [shortened(name) for name in changes.columns]
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(numbered)), numbered)
    axes.grid(visible=False)
    if values.size <= _ANNOTATED_CELLS:
        for (row, column), value in np.ndenumerate(values):
            colour = "white" if abs(value) > 0.7 * limit else "black"
            axes.text(column, row, cell_words(value), ha="center", va="center", fontsize=7, color=colour)
    beyond = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(
        (bool(np.nanmin(values) < -limit), bool(np.nanmax(values) > limit)), "neither"
    )
    figure.colorbar(image, ax=axes, label="change [%]", extend=beyond)
    figure.suptitle("Per flight against the present set; below 0 is better", fontsize=9, x=0.01, ha="left")
    return figure


def pareto(results: Results) -> Figure:
    """Aided against unaided error, each relative to the present set, with interval crosses."""
    aided, unaided = aim_changes(results, AIDED), aim_changes(results, UNAIDED)
    both = aided.add_suffix("_aided").join(unaided.add_suffix("_unaided"), how="inner")
    both = both[both.index.isin(results.shown)]
    if both.empty:
        return empty_figure("No flights tell about both: predictions with all sensors, and without GNSS.")
    figure = new_figure(7.2, max(4.2, 1.4 + 0.21 * (len(both) + 1)))
    axes = figure.add_subplot()
    limits = _pareto_limits(both)
    (left, right), (bottom, top) = limits
    axes.add_patch(Rectangle((left, bottom), -left, -bottom, facecolor=GOOD_COLOUR, alpha=0.12, linewidth=0))
    axes.text(0.015, 0.02, "better in both", transform=axes.transAxes, color="#00694C", fontsize=8)
    axes.axhline(0.0, color="#888888", linewidth=0.7)
    axes.axvline(0.0, color="#888888", linewidth=0.7)
    _front(axes, both, results, right, top)
    styles = set_styles(results)
    for name, one in both.iterrows():
        _cross(axes, one, styles[str(name)], _row_label(str(name), results), limits)
    axes.plot(0.0, 0.0, "o", color=PRESENT_COLOUR, markersize=7, label=f"{results.present} (flies now)", zorder=5)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xlabel("one step ahead, all sensors in use: change of the error [%]")
    axes.set_ylabel("after seconds without GNSS: change of the error [%]")
    axes.set_title("Two aims: left and down is better")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.3)
    return figure


def _pareto_limits(both: pd.DataFrame) -> tuple[Limits, Limits]:
    able = (~both["status_aided"].isin(OUT)).to_numpy()
    return (
        robust_reach(*known_ends(both, "_aided"), able),
        robust_reach(*known_ends(both, "_unaided"), able),
    )


def _front(axes: Axes, both: pd.DataFrame, results: Results, right: float, top: float) -> None:
    """Stairs through the sets that no eligible set beats in both; the present set is one of them if none beats it."""
    able = both[[not results.is_ruled_out(str(name)) for name in both.index]]
    points = np.array([(0.0, 0.0), *zip(able["change_aided"], able["change_unaided"], strict=True)], dtype=np.float64)
    front = sorted({(float(x), float(y)) for x, y in points[pareto_front(points)]})
    x, y = zip((front[0][0], max(top, front[0][1])), *front, (max(right, front[-1][0]), front[-1][1]), strict=True)
    axes.plot(x, y, drawstyle="steps-post", color="#00694C", linewidth=0.9, linestyle=":", label="Pareto front")


def _cross(axes: Axes, one: pd.Series, style: SetStyle, label: str, limits: tuple[Limits, Limits]) -> None:
    (left, right), (bottom, top) = limits
    x, y = float(one["change_aided"]), float(one["change_unaided"])
    if not (left <= x <= right and bottom <= y <= top):
        label += minus(f", outside: {x:+.0f} %, {y:+.0f} %")
    axes.plot([one["lower_aided"], one["upper_aided"]], [y, y], color=style.colour, linewidth=1.0, alpha=0.75)
    axes.plot([x, x], [one["lower_unaided"], one["upper_unaided"]], color=style.colour, linewidth=1.0, alpha=0.75)
    fill = "none" if one["status_aided"] in OUT else "full"
    axes.plot(x, y, style.marker, color=style.colour, markersize=6, fillstyle=fill, label=label, linestyle="none")


def shortened(name: str, longest: int = _LONGEST_NAME) -> str:
    """A name that leaves room for the plot: its middle goes, as flights often differ at the end."""
    if len(name) <= longest:
        return name
    head = (longest - 1) // 3
    return f"{name[:head]}…{name[-(longest - 1 - head) :]}"
