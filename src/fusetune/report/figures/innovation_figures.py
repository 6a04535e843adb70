"""Figures of the innovations over all flights: RMS, box plots, consistency with both bounds, fusion breaks."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from fusetune.analyze.metrics.break_rate import clopper_pearson
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.figures.drawing import PRESENT_COLOUR, empty_figure, label_sets, new_figure, panel_grid
from fusetune.report.figures.set_styles import set_styles, status_colour
from fusetune.report.innovation_tables import (
    BREAK_METRICS,
    CONSISTENT_WHISKER,
    box_figures,
    break_sources,
    consistency_rows,
    pooled_breaks,
    rms_table,
)
from fusetune.report.results import PooledSamples, Results, figure_values

_BREAK_STYLES = (("#56B4E9", -0.22), ("#E69F00", 0.0), ("#D55E00", 0.22))


def rms_by_variable(results: Results) -> Figure:
    """Dot plot of the paper's table 12: RMS innovation of each variable relative to the present set's."""
    table = rms_table(results)
    base = table[results.present]
    shown = [variable for variable in table.index if np.isfinite(base[variable]) and base[variable] > 0.0]
    if not shown:
        return empty_figure("No GNSS, height or magnetometer innovations were scored.")
    figure = new_figure(7.2, 0.9 + 0.36 * len(shown) + 0.14 * (len(results.shown) // 4))
    axes = figure.add_subplot()
    styles = set_styles(results)
    others = [name for name in table.columns if name != results.present]
    offsets = np.linspace(-0.25, 0.25, max(len(others), 1))
    for i, name in enumerate(others):
        ratio = 100.0 * (table.loc[shown, name] / base[shown] - 1.0)
        rows = np.arange(len(shown)) + offsets[i]
        look = styles[name]
        axes.plot(ratio, rows, look.marker, color=look.colour, markersize=4, label=name, alpha=0.9)
    axes.axvline(0.0, color=PRESENT_COLOUR, linewidth=1.0)
    label_sets(axes, shown)
    axes.set_xscale("symlog", linthresh=20.0)
    axes.xaxis.set_major_formatter("{x:+.0f}")
    axes.minorticks_off()
    axes.set_xlabel("RMS innovation against the present set [%]")
    axes.set_title("RMS of the innovations, mean over flights")
    if others:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def boxes(results: Results, pooled: Sequence[PooledSamples], *, normalised: bool) -> Figure:
    """Box plots of the innovations, or of ν/√S, per set, all flights together."""
    if not pooled:
        return empty_figure("No innovations were scored.")
    what = "Innovations divided by their standard deviation" if normalised else "Innovations"
    title = f"{what}, flights that decide: box 25–75 %, whiskers 5–95 %"
    figure, panels = panel_grid(len(pooled), results.shown, 0.17, title)
    for axes, samples in zip(panels, pooled, strict=True):
        _boxes(axes, samples, results, normalised)
    return figure


def _boxes(axes: Axes, samples: PooledSamples, results: Results, normalised: bool) -> None:
    found = box_figures(samples, results.shown, normalised=normalised)
    vetoed = {name for name in results.shown if results.is_ruled_out(name)}
    rows = np.array([row for row, name in enumerate(results.shown) if name in found])
    names = [results.shown[row] for row in rows]
    low, q1, median, q3, high = np.array(list(found.values())).T
    colours = [status_colour(results, name) for name in names]
    axes.hlines(rows, low, high, color=colours, linewidth=1.0)
    boxes = axes.barh(rows, q3 - q1, left=q1, height=0.6, color=colours, edgecolor=colours, linewidth=0.8)
    for box in boxes:
        box.set_alpha(0.45)
    axes.vlines(median, rows - 0.3, rows + 0.3, color=colours, linewidth=1.4)
    # A set that is not eligible may leave the plot; it must not squeeze the others.
    kept = np.array([name not in vetoed for name in names])
    reach = float(max(0.0, q3.max(), -q1.min(), *high[kept], *-low[kept]))
    axes.axvline(0.0, color="#888888", linewidth=0.6)
    if normalised:
        for limit in (-CONSISTENT_WHISKER, CONSISTENT_WHISKER):
            axes.axvline(limit, color="#009E73", linewidth=0.8, linestyle="--")
        reach = max(reach, CONSISTENT_WHISKER)
        axes.set_xlabel("ν / √S [–]")
    else:
        axes.set_xlabel(f"innovation [{AID_SOURCES[samples.source].unit}]")
    axes.set_xlim(-1.15 * reach, 1.15 * reach)
    axes.set_title(samples.label)


def consistency(results: Results) -> Figure:
    """Mean NIS per flight and set, divided by its expectation, with the χ² bounds of both kinds."""
    groups = consistency_rows(results)
    if not groups:
        return empty_figure("No aid source has enough samples for a consistency check.")
    title = "Mean NIS / expectation, a dot per flight (filled: inside its bounds); left: too cautious, right: too sure"
    figure, panels = panel_grid(len(groups), results.shown, 0.17, title)
    for axes, (source, axis, rows) in zip(panels, groups, strict=True):
        _consistency_panel(axes, results, source, axis, rows)
    return figure


def _consistency_panel(axes: Axes, results: Results, source: str, axis: str, rows: pd.DataFrame) -> None:
    dimension = dict(AID_SOURCES[source].groups)[axis]
    expected = float(len(dimension))
    axes.axvspan(
        rows["lower"].median() / expected, rows["upper"].median() / expected, color="#009E73", alpha=0.18, lw=0
    )
    paper = figure_values(results, source, axis, "mean_nis")
    for column in ("lower", "upper"):
        axes.axvline(paper[column].median() / expected, color="#009E73", linewidth=0.9, linestyle=":")
    for row, name in enumerate(results.shown):
        own, colour = rows[rows["set"] == name], status_colour(results, name)
        inside = (own["lower"] <= own["value"]) & (own["value"] <= own["upper"])
        for part, fill in ((own[inside], "full"), (own[~inside], "none")):
            values = part["value"] / expected
            axes.plot(values, np.full(len(part), row), "o", color=colour, markersize=3.8, fillstyle=fill)
    axes.set_xscale("log")
    _plain_log_ticks(axes)
    axes.axvline(1.0, color="#009E73", linewidth=1.0)
    axes.set_title(AID_SOURCES[source].label)
    axes.set_xlabel("mean NIS / dim [–]")


def _plain_log_ticks(axes: Axes) -> None:
    """Ticks as plain figures; 2 and 5 too where the axis holds less than two decades, or it might have none."""
    low, high = axes.get_xlim()
    steps = (1.0,) if high > 100.0 * low else (1.0, 2.0, 5.0) if high < 10.0 * low else (1.0, 3.0)
    axes.xaxis.set_major_locator(LogLocator(subs=steps))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()


def breaks(results: Results) -> Figure:
    """Fusion break rates at 3 σ, 5 σ and the gate per source and set, all flights together, with intervals."""
    sources = break_sources(results)
    if not sources:
        return empty_figure("No fusion breaks could be counted.")
    confidence = results.decision["rule"]["confidence"]
    title = f"Fusion break rate of any axis, {confidence:.0%} Clopper–Pearson interval"
    figure, panels = panel_grid(len(sources), results.shown, 0.2, title)
    for axes, source in zip(panels, sources, strict=True):
        _break_panel(axes, results, source)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=3, borderaxespad=0.1)
    return figure


def _break_panel(axes: Axes, results: Results, source: str) -> None:
    confidence = results.decision["rule"]["confidence"]
    for (metric, label), (colour, offset) in zip(BREAK_METRICS.items(), _BREAK_STYLES, strict=True):
        pooled = pooled_breaks(results, source, metric)
        bounds = [(row + offset, clopper_pearson(*pooled[name], confidence))
                  for row, name in enumerate(results.shown) if name in pooled]  # fmt: skip
        rows = [row for row, _ in bounds]
        low, share, high = (
            [100.0 * float(getattr(one, part)) for _, one in bounds] for part in ("lower", "value", "upper")
        )
        axes.hlines(rows, low, high, color=colour, linewidth=1.6)
        axes.plot(share, rows, "o", color=colour, markersize=3, label="_")
        axes.plot([], [], "o-", color=colour, markersize=3, label=label)
    axes.set_xscale("symlog", linthresh=1.0)
    axes.set_xlim(0.0, 110.0)
    axes.set_xticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    axes.minorticks_off()
    axes.set_title(AID_SOURCES[source].label)
    axes.set_xlabel("samples beyond the limit [%]")
