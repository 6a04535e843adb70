"""A sensor's samples in time, their spread as boxes, their histogram, and how far they are from normal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.stats import norm

from fusetune.analyze.sensor_noise.distribution import (
    HISTOGRAM_EDGES,
    OUTLIER,
    QUANTILES,
    Distribution,
)
from fusetune.analyze.sensor_noise.pooled import PooledSensor
from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise
from fusetune.analyze.sensor_noise.sensor_series import SensorName
from fusetune.report.figures.drawing import new_figure
from fusetune.report.sensor_shapes import (
    beyond_words,
    envelope_rows,
    interval_seconds,
    normal_quantiles,
    outliers,
    standardised_deviations,
)

Array = npt.NDArray[np.float64]

AXIS_COLOURS = ("#0072B2", "#D55E00", "#009E73")
REST_COLOUR, FLIGHT_COLOUR = "#009E73", "#56B4E9"
OUTLIER_COLOUR = "#CC0000"
_MOST_POINTS = 3000


def draw_sensor(noise: SensorNoise, name: SensorName) -> Figure:
    """One sensor of one flight: sequence of each axis with outliers marked, boxes, histogram, normal quantiles.

    Parameters
    ----------
    noise : of the flight
    name : a sensor that it has
    """
    character = noise.sensors[name]
    axes = character.sensor.axes
    height = 1.6 + 1.35 * len(axes) + (1.2 if len(axes) == 1 else 0.0)
    figure = new_figure(10.0, height, layout=None)
    margins = {"left": 0.065, "right": 0.99, "top": 1.0 - 0.25 / height, "bottom": 0.48 / height, "wspace": 0.13}
    outer = figure.add_gridspec(1, 2, width_ratios=(1.45, 1.0), **margins)
    left = outer[0].subgridspec(len(axes), 1, hspace=0.1)
    right = outer[1].subgridspec(2, 2, hspace=0.5, wspace=0.38)
    panels: list[Axes] = []
    for row in range(len(axes)):
        panel = figure.add_subplot(left[row], sharex=panels[0] if panels else None)
        _sequence(panel, noise, character, row)
        panel.tick_params(labelbottom=row == len(axes) - 1)
        panels.append(panel)
    panels[0].set_title(f"{character.sensor.label}: {character.series.topic}, {character.series.rate_hz:.0f} Hz")
    panels[-1].set_xlabel("time since the log began [s]")
    _boxes(figure.add_subplot(right[0, :]), character)
    parts = {"at rest": character.at_rest, "in flight": character.in_flight}
    _histogram(figure.add_subplot(right[1, 0]), {label: _counts(one) for label, one in parts.items() if one})
    _normality(figure.add_subplot(right[1, 1]), noise, character)
    return figure


def draw_pooled_sensor(pooled: PooledSensor) -> Figure:
    """One device over several flights: a box for each flight, and the histogram of all together."""
    shares = [share for share in pooled.flights if share.at_rest or share.in_flight]
    height = max(2.6, 1.2 + 0.32 * len(shares))
    figure = new_figure(10.0, height, layout=None)
    names = 0.03 + 0.0068 * max((len(share.flight) for share in shares), default=0)
    margins = {"left": names, "right": 0.99, "top": 1.0 - 0.25 / height, "bottom": 0.48 / height, "wspace": 0.17}
    grid = figure.add_gridspec(1, 2, width_ratios=(1.6, 1.0), **margins)
    axes = figure.add_subplot(grid[0])
    rows: list[tuple[Array, float, str]] = []
    for place, share in enumerate(shares):
        for part, colour, shift in ((share.at_rest, REST_COLOUR, -0.18), (share.in_flight, FLIGHT_COLOUR, 0.18)):
            if part:
                rows.append((np.mean([one.quantiles for one in part], axis=0), place + shift, colour))
    _draw_boxes(axes, rows, 0.28)
    axes.set_yticks(range(len(shares)), [share.flight for share in shares])
    axes.set_ylim(len(shares) - 0.5, -0.5)
    axes.set_xlabel(f"from sample to sample [{pooled.sensor.unit}]")
    axes.set_title(f"{pooled.sensor.label}, device {pooled.device_id or 'unknown'}: mean of the axes")
    _label_parts(axes, any(share.at_rest for share in shares), any(share.in_flight for share in shares))
    counts = {"at rest": pooled.histogram(at_rest=True), "in flight": pooled.histogram(at_rest=False)}
    _histogram(figure.add_subplot(grid[1]), {label: one for label, one in counts.items() if one.sum()})
    return figure


def _sequence(axes: Axes, noise: SensorNoise, character: SensorCharacter, row: int) -> None:
    """Values over time; outliers, which may be single samples, are drawn whatever is thinned."""
    series = character.series
    time = (series.time - noise.start_timestamp) * 1e-6
    values = series.values[:, row]
    for start, stop in noise.still:
        axes.axvspan(*interval_seconds(noise, (start, stop)), color=REST_COLOUR, alpha=0.15, linewidth=0.0)
    for start, stop in noise.airborne:
        axes.axvspan(*interval_seconds(noise, (start, stop)), color=FLIGHT_COLOUR, alpha=0.12, linewidth=0.0)
    shown = envelope_rows(values, _MOST_POINTS)
    axes.plot(time[shown], values[shown], color=AXIS_COLOURS[row], linewidth=0.6)
    wild = outliers(noise, character)[:, row]
    axes.plot(time[wild], values[wild], "x", color=OUTLIER_COLOUR, markersize=4.0, markeredgewidth=0.9)
    if wild.any():
        words = f"{wild.sum()} outlier{'s' if wild.sum() > 1 else ''} (×)"
        axes.text(0.995, 0.93, words, ha="right", va="top", transform=axes.transAxes, fontsize=7)
    axes.set_ylabel(f"{character.sensor.axes[row]} [{character.sensor.unit}]")
    axes.margins(x=0.01)


def _boxes(axes: Axes, character: SensorCharacter) -> None:
    rows: list[tuple[Array, float, str]] = []
    for part, colour, shift in ((character.at_rest, REST_COLOUR, -0.18), (character.in_flight, FLIGHT_COLOUR, 0.18)):
        rows += [(np.array(one.quantiles), place + shift, colour) for place, one in enumerate(part)]
    _draw_boxes(axes, rows, 0.28)
    names = character.sensor.axes
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel(f"from sample to sample [{character.sensor.unit}]")
    axes.set_title("Spread: half, 96 %, all")
    _label_parts(axes, bool(character.at_rest), bool(character.in_flight))


def _label_parts(axes: Axes, at_rest: bool, in_flight: bool) -> None:
    for label, colour, shown in (("at rest", REST_COLOUR, at_rest), ("in flight", FLIGHT_COLOUR, in_flight)):
        if shown:
            axes.plot([], [], "s", color=colour, label=label)
    if at_rest or in_flight:
        axes.legend(loc="upper right", fontsize=7)
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _draw_boxes(axes: Axes, rows: Sequence[tuple[Array, float, str]], width: float) -> None:
    """Boxes of half of the samples, whiskers of 96 %, and dots at the smallest and the largest, lying."""
    if not rows:
        axes.text(0.5, 0.5, "too few samples", ha="center", va="center", color="#666666", transform=axes.transAxes)
        return
    at = {share: QUANTILES.index(share) for share in QUANTILES}
    boxes = [
        {"med": q[at[0.5]], "q1": q[at[0.25]], "q3": q[at[0.75]], "whislo": q[at[0.02]], "whishi": q[at[0.98]]}
        for q, _, _ in rows
    ]
    drawn = axes.bxp(
        boxes,
        positions=[place for _, place, _ in rows],
        widths=width,
        orientation="horizontal",
        showfliers=False,
        patch_artist=True,
        manage_ticks=False,
        medianprops={"color": "#222222"},
    )
    for patch, (quantiles, place, colour) in zip(drawn["boxes"], rows, strict=True):
        patch.set_facecolor(colour)
        axes.plot(quantiles[[0, -1]], [place, place], ".", color=colour, markersize=4.0)


def _counts(parts: Sequence[Distribution]) -> Array:
    return np.sum([one.histogram for one in parts], axis=0)


def _histogram(axes: Axes, counts: dict[str, Array]) -> None:
    """Share of the samples by standard deviations, all axes together, beside the normal distribution's."""
    centre = 0.5 * (HISTOGRAM_EDGES[1:] + HISTOGRAM_EDGES[:-1])
    width = HISTOGRAM_EDGES[1] - HISTOGRAM_EDGES[0]
    for label, count in counts.items():
        colour = REST_COLOUR if label == "at rest" else FLIGHT_COLOUR
        axes.stairs(count / count.sum() / width, HISTOGRAM_EDGES, color=colour, fill=True, alpha=0.45, label=label)
    axes.plot(centre, norm.pdf(centre), color="#222222", linewidth=0.9, linestyle="--", label="normal")
    axes.set_yscale("log")
    axes.set_ylim(2e-5, 1.0)
    axes.set_xlabel("robust standard deviations")
    axes.set_ylabel("density")
    axes.set_title("Histogram")


def _normality(axes: Axes, noise: SensorNoise, character: SensorCharacter) -> None:
    """Quantiles against those of a normal distribution, and how many times more samples lie beyond three sigma."""
    said: list[str] = []
    for label, intervals, parts, colour in (
        ("at rest", noise.still, character.at_rest, REST_COLOUR),
        ("in flight", noise.airborne, character.in_flight, FLIGHT_COLOUR),
    ):
        if not parts:
            continue
        axes.plot(*normal_quantiles(standardised_deviations(character, intervals)), color=colour, linewidth=1.3)
        said += beyond_words(label, parts)
    axes.plot([-4.0, 4.0], [-4.0, 4.0], color="#222222", linewidth=0.8, linestyle="--")
    axes.text(0.04, 0.96, "\n".join(said), ha="left", va="top", fontsize=7, transform=axes.transAxes)
    axes.set_xlim(-4.2, 4.2)
    axes.set_ylim(-2.0 * OUTLIER + 2.0, 2.0 * OUTLIER - 2.0)
    axes.set_xlabel("normal quantile")
    axes.set_ylabel("sample quantile")
    axes.set_title("Normality")
