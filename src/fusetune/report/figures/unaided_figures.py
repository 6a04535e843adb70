"""The drift of every set against the seconds without GNSS, in metres and against the present set."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusetune.report.comparison import robust_reach
from fusetune.report.figures.drawing import PRESENT_COLOUR, empty_figure, minus, new_figure
from fusetune.report.figures.set_styles import SetStyle, set_styles
from fusetune.report.results import Results
from fusetune.report.withheld import POSITION, VELOCITY, Withheld, drift_summary

_HOPELESS = 3.0
_DODGE = 0.55
"""Share of the space between two horizons over which the sets are spread, so that their bars do not hide each other."""


def drift_figure(results: Results) -> Figure:
    """Drift of horizontal position and velocity, mean over the flights, above; against the present set, below."""
    columns = [(one, summary) for one in (POSITION, VELOCITY) if len(summary := drift_summary(results, one))]
    if not columns:
        return empty_figure("GNSS was not withheld often enough on any flight that counts to show a drift.")
    with_change = len(results.shown) > 1
    longest = max(len(_label(name, results)) for name in results.shown)
    width = 3.1 * len(columns) + 0.5 + 0.07 * longest
    figure = new_figure(width, 5.6 if with_change else 3.0)
    grid = figure.subplots(2 if with_change else 1, len(columns), squeeze=False)
    styles = set_styles(results)
    for column, (withheld, summary) in enumerate(columns):
        _absolute(grid[0, column], results, withheld, summary, styles)
        if with_change:
            _relative(grid[1, column], results, summary, styles)
        grid[-1, column].set_xlabel("time without GNSS [s]")
    if with_change:
        grid[1, 0].set_ylabel(f"change against {results.present} [%]")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper")
    return figure


def _absolute(
    axes: Axes, results: Results, withheld: Withheld, summary: pd.DataFrame, styles: dict[str, SetStyle]
) -> None:
    # A set that drifts so much further may leave the plot, and must not squeeze the others.
    hopeless = _HOPELESS * float(_curve(summary, results.present)["mean"].max())
    reach = 0.0
    for name in _present_last(results):
        curve = _curve(summary, name)
        if curve.empty:
            continue
        style = styles[name]
        axes.plot(
            curve.index, curve["mean"], color=style.colour, marker=style.marker, markersize=3.5, linewidth=style.width,
            alpha=0.45 if results.is_ruled_out(name) else 1.0, label=_label(name, results),
        )  # fmt: skip
        if float(curve["mean"].max()) <= hopeless:
            reach = max(reach, float(curve["mean"].max()))
        if name in (results.present, results.decision["chosen"]):
            axes.fill_between(curve.index, curve["low"], curve["high"], color=style.colour, alpha=0.13, linewidth=0)
            reach = max(reach, float(curve["high"].max()))
    axes.set_ylim(0.0, 1.08 * reach if reach > 0.0 else 1.0)
    _horizons(axes, summary)
    axes.set_ylabel(f"drift [{withheld.unit}]")
    axes.set_title(withheld.label[0].upper() + withheld.label[1:])


def _relative(axes: Axes, results: Results, summary: pd.DataFrame, styles: dict[str, SetStyle]) -> None:
    others = [name for name in results.shown if name != results.present]
    horizons = _horizons(axes, summary)
    step = float(np.min(np.diff(horizons))) if len(horizons) > 1 else horizons[0]
    offsets = np.linspace(-0.5, 0.5, len(others)) * _DODGE * step if len(others) > 1 else np.zeros(1)
    shown = summary.loc[summary.index.get_level_values("set").isin(others)]
    able = [not results.is_ruled_out(name) for name in shown.index.get_level_values("set")]
    bottom, top = robust_reach(shown["change_low"], shown["change_high"], able)
    for name, offset in zip(others, offsets, strict=True):
        curve, style = _curve(summary, name), styles[name]
        time = curve.index.to_numpy(np.float64) + offset
        alpha = 0.45 if results.is_ruled_out(name) else 1.0
        axes.vlines(time, curve["change_low"], curve["change_high"], color=style.colour, linewidth=1.2, alpha=alpha)
        axes.plot(time, curve["change"], style.marker, color=style.colour, markersize=4, alpha=alpha)
    axes.axhline(0.0, color=PRESENT_COLOUR, linewidth=1.0)
    axes.set_ylim(bottom, top)
    axes.yaxis.set_major_formatter(lambda value, _: minus(f"{value:+.4g}") if value else "0")
    axes.set_xlim(horizons[0] - 0.5 * step, horizons[-1] + 0.5 * step)


def _horizons(axes: Axes, summary: pd.DataFrame) -> list[float]:
    horizons = sorted(set(summary.index.get_level_values("horizon_s")))
    axes.set_xticks(horizons, [f"{seconds:g}" for seconds in horizons])
    return horizons


def _curve(summary: pd.DataFrame, name: str) -> pd.DataFrame:
    names = summary.index.get_level_values("set")
    return summary.loc[names == name].droplevel("set").sort_index()


def _present_last(results: Results) -> list[str]:
    """The present set is drawn over the others, which keep their order."""
    return [*(name for name in results.shown if name != results.present), results.present]


def _label(name: str, results: Results) -> str:
    if name == results.present:
        return f"{name} (flies now)"
    return f"{name} (not eligible)" if results.is_ruled_out(name) else name
