"""All sets that were tried in two aims at once: accuracy with all sensors, and drift without GNSS."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fusetune.apply.evidence import AIDED, SMOOTHED
from fusetune.apply.pareto import pareto_front, two_aims
from fusetune.apply.trials import Trials
from fusetune.report.comparison import percent_change
from fusetune.report.figures.drawing import (
    CHOSEN_COLOUR,
    GOOD_COLOUR,
    PRESENT_COLOUR,
    VETOED_COLOUR,
    empty_figure,
    minus,
    new_figure,
)

Array = npt.NDArray[np.float64]

_FRONT_COLOUR = "#00694C"
_SHOWN_SHARE = 0.6
_LEAST_REACH = 2.0
_ACCURACY = {
    AIDED: "errors of one-step predictions, % less than now",
    SMOOTHED: "errors of the smoothed velocity, % less than now",
}
_MIXED = "errors of one-step predictions (or smoothed velocity), % less than now"


def pareto_figure(trials: Trials, chosen: str | None = None, label: str = "chosen") -> Figure:
    """The front of the sets that may be flown, the present set and the chosen one; what others beat is pale.

    Parameters
    ----------
    chosen : name of the set that is chosen; None, or a name that was not tried, marks none
    label : what it is called
    """
    differences, accuracy = two_aims(trials)
    gains = -percent_change(differences)
    known = np.isfinite(gains).all(axis=1)
    if not known.any():
        return empty_figure("No flights tell about both: predictions with all sensors, and without GNSS.")
    allowed = trials.allowed.all(axis=1)
    able = known & allowed
    places = np.vstack([gains[able], np.zeros((1, 2))])
    on_front = pareto_front(-places)
    front = places[on_front]
    figure = new_figure(6.6, 4.6)
    axes = figure.add_subplot()
    (left, right), (bottom, top) = _reach(gains[known, 0], front[:, 0]), _reach(gains[known, 1], front[:, 1])
    axes.add_patch(Rectangle((0.0, 0.0), right, top, facecolor=GOOD_COLOUR, alpha=0.10, linewidth=0))
    axes.axhline(0.0, color="#888888", linewidth=0.7)
    axes.axvline(0.0, color="#888888", linewidth=0.7)
    _cloud(axes, gains[known & ~allowed], "x", "tried, ruled out", 0.5)
    _cloud(axes, places[:-1][~on_front[:-1]], ".", "tried, beaten in both", 0.75)
    _stairs(axes, front, left, bottom)
    axes.plot(front[:, 0], front[:, 1], "o", color=_FRONT_COLOUR, markersize=4.5, linestyle="none", zorder=3)
    axes.plot(0.0, 0.0, "s", color=PRESENT_COLOUR, markersize=7, label="flies now", linestyle="none", zorder=5)
    if chosen in trials.names:
        here = gains[trials.names.index(chosen)]
        axes.plot(*here, "D", color=CHOSEN_COLOUR, markersize=8, label=label, linestyle="none", zorder=6)
    axes.annotate("better in both", (0.0, 0.0), (8, 4), textcoords="offset points", color=_FRONT_COLOUR, fontsize=8,
                  ha="left", va="bottom")  # fmt: skip
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xlabel(_ACCURACY.get(accuracy, _MIXED))
    axes.set_ylabel("drift after seconds without GNSS, % less than now")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _: minus(f"{value:+.4g}") if value else "0")
    figure.suptitle(_title(front), fontsize=9.5, x=0.01, ha="left")
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def _title(front: Array) -> str:
    """The answer first: whether any set is better in both, and by how much."""
    better = front[np.all(front > 0.0, axis=1)]
    if not len(better):
        return "No set is better than now both with all sensors and without GNSS"
    best = better[np.argmax(better.min(axis=1))]
    accuracy, drift = (f"{value:.0f} %" for value in best)
    return f"Two aims: a set has {accuracy} smaller errors with all sensors and {drift} less drift without GNSS"


def _cloud(axes: Axes, places: Array, marker: str, label: str, alpha: float) -> None:
    if len(places):
        axes.plot(
            places[:, 0], places[:, 1], marker, color=VETOED_COLOUR, markersize=4, alpha=alpha, linestyle="none",
            label=label, zorder=1,
        )  # fmt: skip


def _stairs(axes: Axes, front: Array, left: float, bottom: float) -> None:
    """What no set surpasses: from the top left of the front to its bottom right."""
    ordered = front[np.argsort(front[:, 0])]
    x = np.concatenate([[left], ordered[:, 0], [ordered[-1, 0]]])
    y = np.concatenate([[ordered[0, 1]], ordered[:, 1], [bottom]])
    axes.plot(x, y, drawstyle="steps-pre", color=_FRONT_COLOUR, linewidth=1.2, label="Pareto front", zorder=2)


def _reach(values: Array, front: Array) -> tuple[float, float]:
    """Limits that hold the front, the present set and most of the others, not the hopeless ones."""
    best = max(float(front.max()), _LEAST_REACH)
    worst = min(float(np.quantile(values, 1.0 - _SHOWN_SHARE)), float(front.min()), -_LEAST_REACH)
    margin = 0.07 * (best - worst)
    return worst - margin, best + margin
