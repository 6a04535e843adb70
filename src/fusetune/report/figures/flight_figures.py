"""One picture per flight: track, height, test ratios over time, and where fusion broke."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusetune.analyze.flight.ground_truth import Truth, read_truth
from fusetune.analyze.flight_files import SAMPLES_FILE, SCORING_FILE
from fusetune.analyze.metrics.attitude import interpolate
from fusetune.analyze.replaying.samples import AxisSamples, SampleSpool, SourceAxis
from fusetune.analyze.replaying.store.parts import table_file
from fusetune.analyze.replaying.store.reader import read_columns, read_innovations
from fusetune.finding import from_documents
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight
from fusetune.report.figures.drawing import (
    PRESENT_COLOUR,
    decades,
    drawn_rows,
    empty_figure,
    label_margins,
    new_figure,
    set_colours,
    set_title,
)
from fusetune.report.figures.flight_ratios import (
    SMALLEST_RATIO,
    SOURCES,
    Ratios,
    first_fused,
    replayed_ratios,
    scored_ratios,
)
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

Array = npt.NDArray[np.float64]

_MOST_SETS = 8
_DRAWN = ("scored", "excluded", "not_scored")
"""States of a set whose replay ran to the end; others may hold no rows at all."""
_POSITION = ("timestamp", "x", "y", "z", "xy_valid")


class _FlightData:
    """What the panels draw: the replay of the present set, scored samples of the others, start and truth."""

    def __init__(self, flight_folder: Path, analyze_folder: Path, sets: Sequence[str], present: str) -> None:
        self.summary: dict[str, Any] = read_document(analyze_folder / SCORING_FILE)
        names = [present, *(name for name in sets if name != present)][:_MOST_SETS]
        self.present = present
        self.sets = [name for name in names if self.summary["sets"].get(name, {}).get("status") in _DRAWN]
        if present not in self.sets:
            return
        topics = ("vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth")
        flight: Flight = load_flight(flight_folder, topics=topics)
        self.start = flight.start_timestamp
        self.truth: Truth | None = read_truth(flight)
        self.local = read_columns(table_file(analyze_folder, present, "local_position"), list(_POSITION))
        self.samples = _reported_samples(analyze_folder, present, self.summary["sets"][present]["parameters"])
        self.ratios = {present: dict(replayed_ratios(self.samples))}
        intervals = self.summary["intervals_us"]
        self.ratios |= scored_ratios(analyze_folder / SAMPLES_FILE, self.sets[1:], intervals)

    def seconds(self, time: npt.NDArray[np.int64]) -> Array:
        """Seconds since the start of the log."""
        return np.asarray((time.astype(np.int64) - self.start) * 1e-6, dtype=np.float64)


def _reported_samples(folder: Path, name: str, parameters: Mapping[str, float]) -> dict[SourceAxis, AxisSamples]:
    # on an hour of flight the table is large, and what is shown of it small
    whole = read_innovations(table_file(folder, name, "innovations"), parameters, SampleSpool(folder))
    return {key: whole[key] for key in whole if key[0] in SOURCES}


def overview_figure(
    flight_folder: AnyPath, analyze_folder: AnyPath, sets: Sequence[str], *, present: str = PRESENT
) -> Figure:
    """Draw one flight.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder : `results/analyze/<flight>` with the replay of the present set, `scoring.json` and `samples.parquet`
    sets : names of the sets; the present one and the first seven others are drawn, these where they are scored
    """
    data = _FlightData(Path(flight_folder), Path(analyze_folder), sets, present)
    if present not in data.sets:
        reason = data.summary["sets"][present]["reason"]
        return empty_figure(f"The replay of the present set did not come to its end: {reason}")
    figure = new_figure(10.0, 6.8, layout=None)
    margins = {"left": 0.06, "right": 0.985, "bottom": 0.07, "top": 0.965, "hspace": 0.42, "wspace": 0.24}
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.25), **margins)
    colours = set_colours(data.sets, present)
    _track(figure.add_subplot(grid[0:2, 0]), data)
    _height(figure.add_subplot(grid[2, 0]), data)
    first = figure.add_subplot(grid[0, 1])
    _ratios_by_source(first, data)
    _ratios_by_set(figure.add_subplot(grid[1, 1], sharex=first), data, colours)
    _breaks(figure.add_subplot(grid[2, 1], sharex=first), data, colours)
    return figure


def _track(axes: Axes, data: _FlightData) -> None:
    set_title(axes, "Track")
    gnss = _measured_track(data)
    if gnss is not None:
        axes.plot(gnss[:, 1], gnss[:, 0], ".", color="#D55E00", markersize=3, label="GNSS", zorder=2)
    valid = data.local["xy_valid"].astype(bool)
    east, north = data.local["y"][valid], data.local["x"][valid]
    axes.plot(east, north, color=PRESENT_COLOUR, linewidth=1.6, label=data.present, zorder=3)
    truth = _aligned_truth(data)
    if truth is not None:
        axes.plot(truth[:, 1], truth[:, 0], "--", color="#009E73", linewidth=1.0, label="truth", zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    label_margins(axes)
    axes.legend(loc="best")


def _measured_track(data: _FlightData) -> Array | None:
    """GNSS positions in the local frame: estimate less innovation, (N, 2), m, north and east."""
    samples, local = data.samples, data.local
    if ("gnss_pos", 0) not in samples or ("gnss_pos", 1) not in samples:
        return None
    fused = samples["gnss_pos", 0].fused
    if not fused.any() or local["timestamp"].size < 2:
        return None
    from_first = samples["gnss_pos", 0].timestamp_sample >= first_fused(samples["gnss_pos", 0])
    time = samples["gnss_pos", 0].timestamp_sample[from_first]
    estimate = interpolate(local["timestamp"], np.column_stack([local["x"], local["y"]]), time)
    innovation = [samples["gnss_pos", axis].innovation[from_first] for axis in (0, 1)]
    return estimate - np.column_stack(innovation)


def _aligned_truth(data: _FlightData) -> Array | None:
    """True positions shifted to the mean of the present estimate, (N, 2), m: the origins need not agree."""
    local = data.local
    valid = local["xy_valid"].astype(bool)
    if data.truth is None or np.count_nonzero(valid) < 2:
        return None
    time = local["timestamp"][valid]
    truth = interpolate(data.truth.time, data.truth.position[:, :2], time)
    estimate = np.column_stack([local["x"][valid], local["y"][valid]])
    return truth + np.mean(estimate - truth, axis=0)


def _height(axes: Axes, data: _FlightData) -> None:
    set_title(axes, "Height above the origin")
    local = data.local
    for source, colour, label in (("baro_hgt", "#56B4E9", "barometer"), ("gnss_hgt", "#D55E00", "GNSS")):
        samples = data.samples.get((source, 0))
        if samples is None or local["timestamp"].size < 2 or not samples.fused.any():
            continue
        since_fused = samples.rows(samples.timestamp_sample >= first_fused(samples))
        time = since_fused.timestamp_sample
        height = since_fused.innovation - np.interp(time, local["timestamp"], local["z"])
        axes.plot(data.seconds(time), height, ".", color=colour, markersize=2.5, label=label)
    rows = drawn_rows(local["z"])
    axes.plot(data.seconds(local["timestamp"][rows]), -local["z"][rows], color=PRESENT_COLOUR, label=data.present)
    _limit_to_bulk(axes, -local["z"])
    _shade_unscored(axes, data)
    axes.set_xlabel("time since the log began [s]")
    axes.set_ylabel("height [m]")
    label_margins(axes)
    axes.legend(loc="best", ncols=3)


def _limit_to_bulk(axes: Axes, values: Array) -> None:
    """Measurements of the start-up, before the origin is set, must not squeeze the flight into a line."""
    low, high = float(np.min(values)), float(np.max(values))
    margin = max(0.35 * (high - low), 1.5)
    axes.set_ylim(low - margin, high + margin)


def _ratios_by_source(axes: Axes, data: _FlightData) -> None:
    set_title(axes, f"Test ratios of the set “{data.present}”, largest of all axes")
    ratios = data.ratios[data.present]
    for source in ratios:
        _draw_ratios(axes, data, ratios[source], linewidth=0.9, label=AID_SOURCES[source].label)
    _finish_ratios(axes, data)
    if ratios:
        axes.legend(loc="upper left", ncols=4, fontsize=7, borderaxespad=0.2, labelspacing=0.2, reverse=True)


def _ratios_by_set(axes: Axes, data: _FlightData, colours: dict[str, str]) -> None:
    ratios = data.ratios[data.present]
    source = "gnss_vel" if "gnss_vel" in ratios else next(iter(ratios), None)
    if source is None:
        set_title(axes, "No aid source was fused")
        return
    set_title(axes, f"Test ratio of {AID_SOURCES[source].label}, all sets, in their colours below")
    for name in reversed(data.sets):
        if source in data.ratios[name]:
            width = 1.4 if name == data.present else 0.8
            _draw_ratios(axes, data, data.ratios[name][source], color=colours[name], linewidth=width)
    _finish_ratios(axes, data)


def _draw_ratios(axes: Axes, data: _FlightData, ratios: Ratios, **look: Any) -> None:
    time, values = ratios
    rows = drawn_rows(values)
    axes.plot(data.seconds(time[rows]), values[rows], **look)


def _finish_ratios(axes: Axes, data: _FlightData) -> None:
    decades(axes)
    # Room above the gate for the legend.
    axes.set_ylim(SMALLEST_RATIO, 300.0)
    axes.axhline(1.0, color="#CC0000", linewidth=0.8, linestyle="--")
    _shade_unscored(axes, data)
    axes.tick_params(labelbottom=False)
    axes.set_ylabel("test ratio [–]")
    label_margins(axes)


def _breaks(axes: Axes, data: _FlightData, colours: dict[str, str]) -> None:
    set_title(axes, "Fusion breaks: GNSS, height, magnetometer beyond the gate")
    for row, name in enumerate(data.sets):
        times = [time[ratio > 1.0] for time, ratio in data.ratios[name].values()]
        time = data.seconds(np.concatenate(times)) if times else np.zeros(0)
        axes.plot(time, np.full(time.size, row), "|", color=colours[name], markersize=7, markeredgewidth=0.8)
    starts = _cut_starts(data)
    axes.plot(starts, np.zeros(starts.size), "v", color="#D55E00", markersize=4)
    axes.plot([], [], "|", color="#555555", markersize=7, label="beyond the gate")
    axes.plot([], [], "v", color="#D55E00", markersize=4, label="start of a cut (reset or gap)")
    axes.set_yticks(range(len(data.sets)), data.sets)
    for label, name in zip(axes.get_yticklabels(), data.sets, strict=True):
        label.set_color(colours[name])
    # A free row on top for the legend.
    axes.set_ylim(len(data.sets) - 0.4, -1.7)
    axes.grid(visible=False, axis="y")
    _shade_unscored(axes, data)
    axes.set_xlabel("time since the log began [s]")
    label_margins(axes)
    axes.legend(loc="upper left", ncols=2, fontsize=7, borderaxespad=0.2)


def _cut_starts(data: _FlightData) -> Array:
    starts = [cut.start_us for cut in from_documents(data.summary["cuts"]) if cut.start_us is not None]
    return np.array([(start - data.start) * 1e-6 for start in starts])


def _shade_unscored(axes: Axes, data: _FlightData) -> None:
    """Grey where nothing is scored: on the ground, in the warm-up, around resets and gaps."""
    local = data.local["timestamp"]
    if local.size == 0:
        return
    first, last = data.seconds(local[[0, -1]])
    edges = [first]
    for start, stop in data.summary["intervals_us"]:
        edges += [(start - data.start) * 1e-6, (stop - data.start) * 1e-6]
    edges.append(max(last, edges[-1]))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(start, stop, color="#000000", alpha=0.06, linewidth=0)
    axes.set_xlim(first, edges[-1])
