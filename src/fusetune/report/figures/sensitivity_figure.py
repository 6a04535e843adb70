"""One small curve per parameter: how the prediction error goes along it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from fusetune.apply.sensitivity.result import (
    FLAT,
    MATTERS,
    NOT_TOLD,
    UNSURE,
    Curve,
    ParameterSensitivity,
    Sensitivity,
)
from fusetune.apply.sensitivity.wording import NOTHING_VARIED, listed
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
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

_COLUMNS = 3
_MOST_TICKS = 5
_LEAST_WIDTH = 6.4
_LETTERS_PER_INCH = 12.0
_LEAST_REACH = 2.0
_FURTHEST_WORSE = 25.0
"""Percent: how much worse no longer matters, and must not squeeze what does."""

_VERDICT_WORDS = {MATTERS: "matters", FLAT: "flat", UNSURE: "not sure"}
_VERDICT_COLOURS = {MATTERS: CHOSEN_COLOUR, FLAT: "#00694C", UNSURE: "#777777"}


def sensitivity_figure(found: Sensitivity | None) -> Figure:
    """Small multiples of the told parameters, those that matter first, all with the same axis of errors."""
    if found is None:
        return empty_figure(NOTHING_VARIED)
    told = [one for verdict in (MATTERS, UNSURE, FLAT) for one in found.of_verdict(verdict)]
    if not told:
        return empty_figure("These sets do not tell what any one parameter does: they change them together.")
    columns = min(_COLUMNS, len(told))
    rows = -(-len(told) // columns)
    width = max(2.75 * columns, _LEAST_WIDTH)
    figure = new_figure(width, 1.0 + 2.15 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    limits = _limits(told)
    for index, axes in enumerate(grid.flat):
        axes.set_visible(index < len(told))
        if index < len(told):
            _panel(axes, told[index], found, limits)
    figure.supylabel("prediction errors smaller by [%]", fontsize=8.5)
    figure.suptitle(_title(found, width), fontsize=9.5, x=0.01, ha="left")
    entries: dict[str, Any] = {}
    for axes in grid.flat[: len(told)]:
        handles, labels = axes.get_legend_handles_labels()
        entries = dict(zip(labels, handles, strict=True)) | entries
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=4)
    return figure


def _title(found: Sensitivity, width: float) -> str:
    """The answer, then what is drawn, in lines for a width in inches."""
    matter = [one.parameter for one in found.of_verdict(MATTERS)]
    answer = f"What matters here: {listed(matter)}" if matter else "No parameter is shown to matter here"
    untold = [one.parameter for one in found.parameters if one.verdict == NOT_TOLD]
    rest = f". Not told apart, so not drawn: {listed(untold)}" if untold else ""
    return textwrap.fill(answer + rest, round(_LETTERS_PER_INCH * width))


def _gain(differences: Sequence[float]) -> Array:
    """By how much smaller the errors are than now, percent."""
    return -percent_change(differences)


def _limits(told: Sequence[ParameterSensitivity]) -> tuple[float, float]:
    curves = [_gain(one.curve.differences) for one in told if one.curve is not None]
    best = max(max(float(one.max()) for one in curves), _LEAST_REACH)
    worst = min(min(float(one.min()) for one in curves), -_LEAST_REACH)
    worst = max(worst, -max(_FURTHEST_WORSE, 1.5 * best))
    margin = 0.12 * (best - worst)
    return worst - margin, best + margin


def _panel(axes: Axes, one: ParameterSensitivity, found: Sensitivity, limits: tuple[float, float]) -> None:
    curve = one.curve
    assert curve is not None, "what is told of has a curve"
    colour = _VERDICT_COLOURS[one.verdict]
    if one.scale == "log":
        axes.set_xscale("log")
    if one.same_within is not None:
        axes.axvspan(*one.same_within, color=GOOD_COLOUR, alpha=0.10, linewidth=0, label="errors hardly change")
    _tried_sets(axes, one, found)
    if curve.lower:
        axes.fill_between(
            curve.values, _gain(curve.upper), _gain(curve.lower), color=colour, alpha=0.18, linewidth=0,
            label=f"{found.confidence:.0%} interval of the change",
        )  # fmt: skip
    axes.plot(curve.values, _gain(curve.differences), color=colour, linewidth=1.8, label="others as chosen")
    if curve.others_at_best:
        axes.plot(
            curve.values, _gain(curve.others_at_best), color="#555555", linewidth=0.9, linestyle="--",
            label="others at their best",
        )  # fmt: skip
    axes.axhline(0.0, color="#888888", linewidth=0.7)
    axes.axvline(one.present, color=PRESENT_COLOUR, linewidth=1.0, linestyle=":", label="flies now")
    if not math.isclose(one.incumbent, one.present, rel_tol=1e-5):
        here = float(np.interp(one.incumbent, curve.values, _gain(curve.differences)))
        axes.plot(one.incumbent, here, "D", color=colour, markersize=5.5, label="chosen", zorder=5)
    axes.set_ylim(*limits)
    _ticks(axes, one, curve)
    unit = PARAMETERS[one.parameter].unit if one.parameter in PARAMETERS else ""
    axes.set_title(one.parameter, fontsize=8.5, color=colour, fontweight="bold" if one.verdict == MATTERS else "normal")
    axes.set_title(_VERDICT_WORDS[one.verdict], fontsize=8, loc="right", color=colour)
    axes.set_xlabel(unit, fontsize=7.5)
    axes.yaxis.set_major_formatter(lambda value, _: minus(f"{value:+.4g}") if value else "0")


def _tried_sets(axes: Axes, one: ParameterSensitivity, found: Sensitivity) -> None:
    """Sets that change this parameter: those that change it alone as circles, the others pale."""
    index = [other.parameter for other in found.parameters].index(one.parameter)
    present = np.array([other.present for other in found.parameters])
    others = np.arange(len(present)) != index
    values = np.array([tried.values for tried in found.tried])
    gains = _gain([tried.difference for tried in found.tried])
    varied = ~np.isclose(values[:, index], present[index], rtol=1e-5)
    values, gains = values[varied], gains[varied]
    alone = np.all(np.isclose(values[:, others], present[others], rtol=1e-5), axis=1)
    if not alone.all():
        axes.plot(
            values[~alone, index], gains[~alone], ".", color=VETOED_COLOUR, markersize=3, alpha=0.55, zorder=1,
            label="sets tried",
        )  # fmt: skip
    if alone.any():
        axes.plot(
            values[alone, index], gains[alone], "o", color=PRESENT_COLOUR, markersize=3.5, fillstyle="none", zorder=4,
            label="sets that change this alone",
        )  # fmt: skip


def _ticks(axes: Axes, one: ParameterSensitivity, curve: Curve) -> None:
    """Few round values on a logarithmic axis, written out."""
    low, high = min(curve.values), max(curve.values)
    if one.scale != "log":
        axes.locator_params(axis="x", nbins=_MOST_TICKS)
        return
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1, 3), (1,)):
        ticks = [step * 10.0**power for power in decades for step in steps]
        shown = [tick for tick in ticks if 0.97 * low <= tick <= 1.03 * high]
        if len(shown) <= _MOST_TICKS:
            break
    axes.xaxis.set_major_locator(FixedLocator(shown))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:.4g}")
