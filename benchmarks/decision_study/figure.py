"""Power curves: how often what can be gained is gained, by the number of flights and by how much it is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from fusetune.report.figures.drawing import figure_style, new_figure, save_svg

from .drawn import JUDGED_SIZES, SIZES, DrawnStudy, power
from .rules import OLD, OURS

MEASURE = "velocity"
COLOURS = {OURS: "#0072B2", OLD: "#999999"}
STYLES = {0.2: "-", 0.1: "--"}
MARKERS = dict(zip(JUDGED_SIZES, ("o", "s"), strict=True))


def draw_power(drawn: Sequence[DrawnStudy], path: Path) -> None:
    """Two panels as SVG: share found over the number of flights, and share of the possible gain realised over it."""
    with figure_style():
        figure = new_figure(9.0, 3.6)
        left, right = figure.subplots(1, 2)
        _by_flights(left, drawn)
        _by_gain(right, drawn)
        save_svg(figure, path)


def _by_flights(axes: Axes, drawn: Sequence[DrawnStudy]) -> None:
    for rule, colour in COLOURS.items():
        own = [one for one in drawn if one.rule == rule]
        for gain, style in STYLES.items():
            shares = [100.0 * power(own, flights, gain, MEASURE)[0] for flights in SIZES]
            axes.plot(SIZES, shares, style, color=colour, marker=".", label=f"{rule}, gain ≥ {100 * gain:.0f} %")
    axes.set(xlabel="flights", ylabel="share of studies in which it is found, %", ylim=(-3, 103))
    axes.legend(loc="lower right")


def _by_gain(axes: Axes, drawn: Sequence[DrawnStudy]) -> None:
    for rule, colour in COLOURS.items():
        for flights, marker in MARKERS.items():
            own = [one for one in drawn if one.rule == rule and one.flights == flights]
            points = {}
            for key in dict.fromkeys((one.world, one.study) for one in own):
                here = [one for one in own if (one.world, one.study) == key]
                possible = here[0].possible[MEASURE]
                if possible > 0.0:
                    points[possible] = float(np.mean([one.gained[MEASURE] for one in here])) / possible
            x = sorted(points)
            label = f"{rule}, {flights} flights"
            axes.plot(
                100.0 * np.array(x), [100.0 * points[one] for one in x], marker, color=colour, label=label, markersize=4
            )
    axes.set(xlabel="true gain of the best set in velocity, %", ylabel="share of it that is gained, %", ylim=(-30, 103))
    axes.legend(loc="lower right")
