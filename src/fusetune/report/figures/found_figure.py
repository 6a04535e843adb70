"""Each parameter of a search: from where to where, and how far the searches without a part of the flights agree."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from fusetune.report.figures.drawing import (
    CHOSEN_COLOUR,
    PRESENT_COLOUR,
    VETOED_COLOUR,
    empty_figure,
    minus,
    new_figure,
)
from fusetune.report.search_results import SearchResults
from fusetune.report.searched_parameters import axis_groups, found_title, from_to_words

_FOLD_COLOUR = "#E69F00"
_ROW = 0.36


def found_figure(results: SearchResults) -> Figure:
    """A row for each parameter: ratios to what flies now on a logarithmic axis, delays and lever arms on their own."""
    parameters: Mapping[str, Mapping[str, Any]] = results.search["parameters"]
    if not parameters:
        return empty_figure("No parameter was searched.")
    groups = axis_groups(parameters)
    rows = [len(names) for names in groups.values()]
    figure = new_figure(7.4, 1.05 + _ROW * sum(rows) + 0.55 * len(groups))
    panels = figure.subplots(len(groups), 1, squeeze=False, height_ratios=[count + 0.6 for count in rows])[:, 0]
    for axes, (unit, names) in zip(panels, groups.items(), strict=True):
        for place, name in enumerate(names):
            _row(axes, place, parameters[name], [one["values"][name] for one in results.parts], is_ratio=unit is None)
        _finish(axes, names, parameters, unit)
    figure.suptitle(found_title(parameters), fontsize=9.5, x=0.01, ha="left")
    entries: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=5, markerscale=0.85)
    return figure


def _row(axes: Axes, place: int, one: Mapping[str, Any], folds: Sequence[float], *, is_ratio: bool) -> None:
    def position(value: float) -> float:
        return math.log2(value / one["present"]) if is_ratio else value - one["present"]

    low, high, found = position(one["low"]), position(one["high"]), position(one["found"])
    axes.plot([low, high], [place, place], color="#e3e3e3", linewidth=7, solid_capstyle="butt", zorder=1)
    axes.plot([low, high], [place, place], "|", color="#999999", markersize=10, linestyle="none", label="bounds",
              zorder=2)  # fmt: skip
    if found:
        axes.annotate("", (found, place), (0.0, place), arrowprops={"arrowstyle": "-", "color": CHOSEN_COLOUR,
                      "linewidth": 1.6}, zorder=3)  # fmt: skip
    axes.plot(0.0, place, "s", color=PRESENT_COLOUR, markersize=5.5, label="flies now", linestyle="none", zorder=4)
    colour = CHOSEN_COLOUR if one["is_changed"] else VETOED_COLOUR
    if one["is_changed"]:
        axes.plot(found, place, "D", color=colour, markersize=7, label="found on all flights", linestyle="none",
                  zorder=5)  # fmt: skip
    for value, count in Counter(folds).items():
        axes.plot(
            position(value), place - 0.3, "o", color=_FOLD_COLOUR, markersize=2.8 + 1.2 * count, linestyle="none",
            markeredgecolor="white", markeredgewidth=0.4, zorder=6, label="with a part kept aside (larger: several)",
        )  # fmt: skip


def _finish(axes: Axes, names: Sequence[str], parameters: Mapping[str, Mapping[str, Any]], unit: str | None) -> None:
    axes.set_yticks(range(len(names)), names)
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_fontweight("bold" if parameters[name]["is_changed"] else "normal")
    axes.set_ylim(len(names) - 0.5, -0.65)
    axes.grid(visible=False, axis="y")
    right = axes.secondary_yaxis("right")
    right.set_yticks(range(len(names)), [from_to_words(name, parameters[name]) for name in names])
    right.tick_params(length=0)
    right.spines["right"].set_visible(False)
    if unit is None:
        reach = max(math.ceil(max(map(abs, axes.get_xlim())) - 0.2), 1)
        axes.xaxis.set_major_locator(FixedLocator(list(range(-reach, reach + 1))))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(
            lambda power, _: "now" if not power else f"×{2**power:.0f}" if power > 0 else f"÷{2**-power:.0f}"
        )
    else:
        axes.set_xlabel(f"change [{unit}]" if unit else "change")
        axes.xaxis.set_major_formatter(lambda value, _: minus(f"{value:+.3g}") if value else "now")
