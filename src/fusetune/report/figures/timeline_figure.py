"""A flight in time: its phases, when which finding holds, height, speed, and test ratios of the vehicle's filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS, OnboardSamples, onboard_samples
from fusetune.px4.aid_sources import AID_SOURCES, MEASURED_SOURCES
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.report.figures.drawing import decades, drawn_rows, label_margins, new_figure, set_title
from fusetune.report.finding_bars import Bar
from fusetune.report.severity_words import SEVERITY_COLOURS

AID_TOPICS = tuple(source.topic for source in MEASURED_SOURCES.values())

Array = npt.NDArray[np.float64]

TIMELINE_TOPICS = (
    *INNOVATION_TOPICS,
    "vehicle_local_position",
    "vehicle_land_detected",
    "estimator_selector_status",
    "estimator_status",
    "estimator_status_flags",
    "vehicle_gps_position",
    "sensor_gps",
)
"""What is read of a saved flight."""

_SMALLEST_RATIO = 1e-3
_LARGEST_RATIO = 1e4
_MOST_POINTS = 1500
_LANE_INCH = 0.2
_FEW = 2
"""An estimator of which the log holds so many times more samples than of the primary one is drawn instead."""
_SHADED = ("fail", "warning")


def draw_timeline(logged: Flight, bars: Sequence[Bar]) -> Figure:
    """Draw phases and findings as bars over height, speed and test ratios.

    Parameters
    ----------
    logged : of any release, with `TIMELINE_TOPICS`
    bars : the first on top
    """
    flight = canonical(logged)
    lanes = len(bars) + 1
    heights = (lanes * _LANE_INCH + 0.2, 1.25, 1.25, 1.9)
    total = sum(heights) + 1.5
    figure = new_figure(10.0, total, layout=None)
    room = {"left": 0.25, "right": 0.985, "top": 1.0 - 0.35 / total, "bottom": 0.5 / total, "hspace": 0.28}
    grid = figure.add_gridspec(4, 1, height_ratios=heights, **room)
    top = figure.add_subplot(grid[0])
    panels = [top, *(figure.add_subplot(grid[row], sharex=top) for row in (1, 2, 3))]
    airborne = airborne_intervals(flight, {})
    _lanes(panels[0], flight, airborne, bars)
    _height(panels[1], flight)
    _speed(panels[2], flight)
    _ratios(panels[3], flight)
    for axes in panels[1:]:
        _shade(axes, flight, airborne, bars)
        label_margins(axes)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel("time since the log began [s]")
    top.set_xlim(0.0, max(_seconds(flight, flight.last_timestamp), 1.0))
    return figure


def _seconds(flight: Flight, time: int) -> float:
    return (time - flight.start_timestamp) * 1e-6


def _lanes(axes: Axes, flight: Flight, airborne: Sequence[Interval], bars: Sequence[Bar]) -> None:
    set_title(axes, "What was found, and when")
    for row, bar in enumerate(bars):
        height = 0.62 if bar.is_cause else 0.34
        # an instant is to be seen as well
        width = max(bar.until_s - bar.since_s, 0.004 * _seconds(flight, flight.last_timestamp))
        axes.barh(row, width, height, left=bar.since_s, color=SEVERITY_COLOURS[bar.severity], linewidth=0)
    row = len(bars)
    for start, stop in airborne:
        axes.barh(row, (stop - start) * 1e-6, 0.4, left=_seconds(flight, start), color="#9FB3C8", linewidth=0)
    axes.set_yticks(range(row + 1), [*(bar.words for bar in bars), "in the air" if airborne else "not known to fly"])
    for label, bar in zip(axes.get_yticklabels(), bars, strict=False):
        label.set(fontweight="bold" if bar.is_cause else "normal", fontsize=8 if bar.is_cause else 7)
    axes.set_ylim(row + 0.6, -0.6)
    axes.grid(visible=False, axis="y")


def _shade(axes: Axes, flight: Flight, airborne: Sequence[Interval], bars: Sequence[Bar]) -> None:
    """Grey on the ground, in the colour of a cause while it holds."""
    edges = [
        0.0,
        *(_seconds(flight, edge) for one in airborne for edge in one),
        _seconds(flight, flight.last_timestamp),
    ]
    for start, stop in zip(edges[::2], edges[1::2], strict=True) if airborne else ():
        axes.axvspan(start, stop, color="#000000", alpha=0.06, linewidth=0)
    for bar in bars:
        if bar.is_cause and bar.severity in _SHADED:
            axes.axvspan(bar.since_s, bar.until_s, color=SEVERITY_COLOURS[bar.severity], alpha=0.09, linewidth=0)


def _height(axes: Axes, flight: Flight) -> None:
    axes.set_ylabel("height above\nthe origin [m]")
    position = flight.topic("vehicle_local_position")
    if position is None or not position["timestamp"].size:
        _say(axes, "the log holds no local position")
        return
    _line(axes, flight, position["timestamp"], -position["z"].astype(np.float64), color="#0072B2")


def _speed(axes: Axes, flight: Flight) -> None:
    axes.set_ylabel("speed [m/s]")
    position = flight.topic("vehicle_local_position")
    if position is None or not position["timestamp"].size or "vx" not in position:
        _say(axes, "the log holds no velocity")
        return
    north, east, down = (position[name].astype(np.float64) for name in ("vx", "vy", "vz"))
    _line(axes, flight, position["timestamp"], np.hypot(north, east), color="#0072B2", label="horizontal")
    _line(axes, flight, position["timestamp"], -down, color="#E69F00", linewidth=0.9, label="up")
    axes.legend(loc="upper left", ncols=2, borderaxespad=0.2)


def _line(axes: Axes, flight: Flight, time: npt.NDArray[Any], values: Array, **look: Any) -> None:
    rows = drawn_rows(values)
    axes.plot((time[rows].astype(np.int64) - flight.start_timestamp) * 1e-6, values[rows], **look)


def _ratios(axes: Axes, flight: Flight) -> None:
    samples, instance = _fullest_samples(flight)
    if instance is not None:
        axes.set_title(f"of estimator {instance}: the log holds few samples of the primary one", fontsize=8)
    largest = 1.0
    for name, source in MEASURED_SOURCES.items():
        found = _largest(samples, name)
        if found is not None:
            time, ratio = found
            largest = max(largest, float(ratio.max()))
            axes.plot((time - flight.start_timestamp) * 1e-6, ratio, linewidth=0.9, label=source.label)
    axes.set_ylabel("test ratio [–]")
    if not axes.lines:
        _say(axes, "the log holds no innovations of the vehicle's own filter")
        return
    decades(axes)
    # room above for the legend
    axes.set_ylim(_SMALLEST_RATIO, 300.0 * largest)
    axes.axhline(1.0, color="#CC0000", linewidth=0.8, linestyle="--")
    axes.legend(loc="upper left", ncols=5, fontsize=7, borderaxespad=0.2, labelspacing=0.2)


def _fullest_samples(flight: Flight) -> tuple[OnboardSamples, int | None]:
    """Of the estimator that was primary at each time; of the one the log holds most of, where it is silent on that."""
    primary = onboard_samples(flight)
    instances = {one for topic in AID_TOPICS for one in flight.instances(topic)}
    counted = {one: _count(onboard_samples(flight, one)) for one in sorted(instances)} if len(instances) > 1 else {}
    most = max(counted, key=lambda one: counted[one], default=None)
    if most is None or counted[most] <= _FEW * _count(primary):
        return primary, None
    return onboard_samples(flight, most), most


def _count(samples: OnboardSamples) -> int:
    return sum(samples[key].timestamp_sample.size for key in samples)


def _largest(samples: OnboardSamples, source: str) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Largest ratio of the axes of each sample, of many samples the largest of neighbours."""
    axes = [samples[source, axis] for axis in range(AID_SOURCES[source].axes) if (source, axis) in samples]
    size = min((one.test_ratio.size for one in axes), default=0)
    if not size:
        return None
    ratio = np.max([one.test_ratio[:size] for one in axes], axis=0)
    time = axes[0].timestamp_sample[:size]
    known = np.isfinite(ratio)
    ratio, time = ratio[known], time[known]
    if not ratio.size:
        return None
    together = -(-ratio.size // _MOST_POINTS)
    starts = np.arange(0, ratio.size, together)
    return time[starts], np.clip(np.maximum.reduceat(ratio, starts), _SMALLEST_RATIO, _LARGEST_RATIO)


def _say(axes: Axes, words: str) -> None:
    axes.set_yticks([])
    axes.text(0.5, 0.5, words, ha="center", va="center", color="#666666", transform=axes.transAxes)
