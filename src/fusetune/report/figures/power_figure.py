"""The chance of finding a gain, by the number of flights."""

from __future__ import annotations

from matplotlib.figure import Figure

from fusetune.report.figures.drawing import PRESENT_COLOUR, empty_figure, new_figure
from fusetune.report.results import Results

_COLOURS = ("#D55E00", "#0072B2", "#009E73")


def power_figure(results: Results) -> Figure:
    """A curve for each gain; dashed for longer flights."""
    power = results.decision["power"]
    if not power:
        return empty_figure(
            "Two flights that decide, and two sets that differ, are needed to show what more would bring."
        )
    figure = new_figure(7.2, 3.4)
    axes = figure.add_subplot()
    gains = sorted({one["gain_percent"] for one in power["curves"]})
    colours = dict(zip(gains, _COLOURS, strict=False))
    for one in power["curves"]:
        is_longer = one["times_longer"] != 1.0
        chance = [100.0 * value for value in one["chance"]]
        minutes = power["next_minutes"] if is_longer else power["minutes"]
        axes.plot(
            one["flights"], chance, "--" if is_longer else "-", color=colours[one["gain_percent"]],
            marker="" if is_longer else ".", label=f"gain {one['gain_percent']:g} %, flights of {minutes:.2g} min",
        )  # fmt: skip
    asked = 100.0 * power["chance_asked_for"]
    axes.axhline(asked, color="#888888", linewidth=0.7)
    axes.axvline(power["flights"], color=PRESENT_COLOUR, linewidth=1.0, linestyle=":")
    axes.text(power["flights"] + 0.3, 2.0, f"now: {power['flights']}", fontsize=8, color=PRESENT_COLOUR)
    axes.set(xlabel="flights", ylabel="chance of being found [%]", ylim=(0.0, 102.0))
    axes.set_title("What more flights would find")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.3)
    return figure
