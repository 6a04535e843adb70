"""One picture per flight: track, height, test ratios over time, and where fusion broke."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from fusetune.analyze.flight.ground_truth import Truth, read_truth
from fusetune.analyze.metrics.attitude import interpolate
from fusetune.analyze.replaying.samples import AxisSamples, SampleSpool, SourceAxis
from fusetune.analyze.replaying.store.reader import ColumnsOnDisk, read_innovations
from fusetune.finding import from_documents
from fusetune.px4.aid_sources import AID_SOURCES, REPORTED_SOURCES
from fusetune.px4.flight import Flight
from fusetune.report.figures.drawing import empty_figure, figure_style, new_figure, save_png, set_colours
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

Array = npt.NDArray[np.float64]

_SOURCES = tuple(source.name for source in REPORTED_SOURCES)
_MOST_SETS = 8
_DRAWN = ("scored", "excluded", "not_scored")
"""States of a set whose replay ran to the end; others may hold no rows at all."""
_SMALLEST_RATIO = 1e-4


class _FlightData:
    """What the panels draw: replays of the sets and, of the flight itself, start and truth."""

    def __init__(
        self, flight_folder: Path, analyze_folder: Path, sets: Sequence[str], present: str, spool: SampleSpool
    ) -> None:
        self.summary: dict[str, Any] = read_document(analyze_folder / "scoring.json")
        topics = ("vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth")
        flight: Flight = load_flight(flight_folder, topics=topics)
        self.start = flight.start_timestamp
        self.truth: Truth | None = read_truth(flight)
        self.present = present
        names = [present, *(name for name in sets if name != present)][:_MOST_SETS]
        self.sets = [name for name in names if self.summary["sets"].get(name, {}).get("status") in _DRAWN]
        self.samples: dict[str, Mapping[SourceAxis, AxisSamples]] = {}
        self.local: dict[str, ColumnsOnDisk] = {}
        for name in self.sets:
            parameters = self.summary["sets"][name]["parameters"]
            self.samples[name] = read_innovations(analyze_folder / f"{name}.innovations.parquet", parameters, spool)
            self.local[name] = ColumnsOnDisk(analyze_folder / f"{name}.local_position.parquet")

    def seconds(self, time: npt.NDArray[np.int64]) -> Array:
        """Seconds since the start of the log."""
        return np.asarray((time.astype(np.int64) - self.start) * 1e-6, dtype=np.float64)


def plot_flight(
    flight_folder: AnyPath, analyze_folder: AnyPath, sets: Sequence[str], output: AnyPath, *, present: str = PRESENT
) -> None:
    """Draw one flight as a PNG.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder : `results/analyze/<flight>` with the replays and `scoring.json`
    sets : names of the sets; the present one and the first seven others are drawn
    output : the picture
    """
    output = Path(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    data = _FlightData(Path(flight_folder), Path(analyze_folder), sets, present, SampleSpool(output.parent))
    with figure_style():
        if present not in data.sets:
            reason = data.summary["sets"][present]["reason"]
            save_png(empty_figure(f"The replay of the present set did not come to its end: {reason}"), output)
            return
        figure = new_figure(10.0, 6.8, layout=None)
        margins = {"left": 0.06, "right": 0.985, "bottom": 0.07, "top": 0.965, "hspace": 0.42, "wspace": 0.24}
        grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.25), **margins)
        colours = set_colours(data.sets, present)
        _track(figure.add_subplot(grid[0:2, 0]), data, colours)
        _height(figure.add_subplot(grid[2, 0]), data, colours)
        first = figure.add_subplot(grid[0, 1])
        _ratios_by_source(first, data)
        _ratios_by_set(figure.add_subplot(grid[1, 1], sharex=first), data, colours)
        _breaks(figure.add_subplot(grid[2, 1], sharex=first), data, colours)
        save_png(figure, output)


def _track(axes: Axes, data: _FlightData, colours: dict[str, str]) -> None:
    axes.set_title("Track")
    gnss = _measured_track(data)
    if gnss is not None:
        axes.plot(gnss[:, 1], gnss[:, 0], ".", color="#D55E00", markersize=3, label="GNSS", zorder=2)
    for name in reversed(data.sets):
        local = data.local[name]
        valid = local["xy_valid"].astype(bool)
        width = 1.6 if name == data.present else 0.8
        label = name if name == data.present else None
        axes.plot(local["y"][valid], local["x"][valid], color=colours[name], linewidth=width, label=label, zorder=3)
    truth = _aligned_truth(data)
    if truth is not None:
        axes.plot(truth[:, 1], truth[:, 0], "--", color="#009E73", linewidth=1.0, label="truth", zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")


def _measured_track(data: _FlightData) -> Array | None:
    """GNSS positions in the local frame: estimate less innovation, (N, 2), m, north and east."""
    samples = data.samples[data.present]
    if ("gnss_pos", 0) not in samples or ("gnss_pos", 1) not in samples:
        return None
    local = data.local[data.present]
    fused = samples["gnss_pos", 0].fused
    if not fused.any() or local["timestamp"].size < 2:
        return None
    from_first = np.arange(fused.size) >= np.argmax(fused)
    time = samples["gnss_pos", 0].timestamp_sample[from_first]
    estimate = interpolate(local["timestamp"], np.column_stack([local["x"], local["y"]]), time)
    innovation = [samples["gnss_pos", axis].innovation[from_first] for axis in (0, 1)]
    return estimate - np.column_stack(innovation)


def _aligned_truth(data: _FlightData) -> Array | None:
    """True positions shifted to the mean of the present estimate, (N, 2), m: the origins need not agree."""
    local = data.local[data.present]
    valid = local["xy_valid"].astype(bool)
    if data.truth is None or np.count_nonzero(valid) < 2:
        return None
    time = local["timestamp"][valid]
    truth = interpolate(data.truth.time, data.truth.position[:, :2], time)
    estimate = np.column_stack([local["x"][valid], local["y"][valid]])
    return truth + np.mean(estimate - truth, axis=0)


def _height(axes: Axes, data: _FlightData, colours: dict[str, str]) -> None:
    axes.set_title("Height above the origin")
    local = data.local[data.present]
    time = data.seconds(local["timestamp"])
    for source, colour, label in (("baro_hgt", "#56B4E9", "barometer"), ("gnss_hgt", "#D55E00", "GNSS")):
        samples = data.samples[data.present].get((source, 0))
        if samples is None or local["timestamp"].size < 2 or not samples.fused.any():
            continue
        rows = np.arange(samples.fused.size) >= np.argmax(samples.fused)
        down = np.interp(samples.timestamp_sample[rows], local["timestamp"], local["z"])
        height = -(down - samples.innovation[rows])
        axes.plot(data.seconds(samples.timestamp_sample[rows]), height, ".", color=colour, markersize=2.5, label=label)
    axes.plot(time, -local["z"], color=colours[data.present], label=data.present)
    _limit_to_bulk(axes, -local["z"])
    _shade_unscored(axes, data)
    axes.set_xlabel("time since the log began [s]")
    axes.set_ylabel("height [m]")
    axes.legend(loc="best", ncols=3)


def _limit_to_bulk(axes: Axes, values: Array) -> None:
    """Measurements of the start-up, before the origin is set, must not squeeze the flight into a line."""
    low, high = float(np.min(values)), float(np.max(values))
    margin = max(0.35 * (high - low), 1.5)
    axes.set_ylim(low - margin, high + margin)


def _ratios_by_source(axes: Axes, data: _FlightData) -> None:
    axes.set_title(f"Test ratios of the set “{data.present}”, largest of all axes")
    samples = data.samples[data.present]
    for source in _SOURCES:
        ratio = _largest_ratio(samples, source)
        if ratio is not None:
            time, values = ratio
            axes.plot(data.seconds(time), values, linewidth=0.9, label=AID_SOURCES[source].label)
    _finish_ratios(axes, data)


def _ratios_by_set(axes: Axes, data: _FlightData, colours: dict[str, str]) -> None:
    source = "gnss_vel" if ("gnss_vel", 0) in data.samples[data.present] else _first_source(data)
    if source is None:
        axes.set_title("No aid source was fused")
        return
    axes.set_title(f"Test ratio of {AID_SOURCES[source].label}, all sets")
    for name in reversed(data.sets):
        ratio = _largest_ratio(data.samples[name], source)
        if ratio is not None:
            width = 1.4 if name == data.present else 0.8
            axes.plot(data.seconds(ratio[0]), ratio[1], color=colours[name], linewidth=width, label=name)
    _finish_ratios(axes, data)


def _first_source(data: _FlightData) -> str | None:
    return next((source for source in _SOURCES if (source, 0) in data.samples[data.present]), None)


def _finish_ratios(axes: Axes, data: _FlightData) -> None:
    axes.set_yscale("log")
    axes.minorticks_off()
    # Room above the gate for the legend.
    axes.set_ylim(_SMALLEST_RATIO, 300.0)
    axes.axhline(1.0, color="#CC0000", linewidth=0.8, linestyle="--")
    _shade_unscored(axes, data)
    axes.tick_params(labelbottom=False)
    axes.set_ylabel("test ratio [–]")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", ncols=4, fontsize=7, borderaxespad=0.2, labelspacing=0.2, reverse=True)


def _largest_ratio(
    samples: Mapping[SourceAxis, AxisSamples], source: str
) -> tuple[npt.NDArray[np.int64], Array] | None:
    axes = [samples[source, axis] for axis in range(AID_SOURCES[source].axes) if (source, axis) in samples]
    if not axes or not axes[0].fused.any():
        return None
    size = min(one.test_ratio.size for one in axes)
    ratio = np.max([one.test_ratio[:size] for one in axes], axis=0)
    rows = np.arange(size) >= np.argmax(axes[0].fused[:size])
    return axes[0].timestamp_sample[:size][rows], np.maximum(ratio[rows], _SMALLEST_RATIO)


def _breaks(axes: Axes, data: _FlightData, colours: dict[str, str]) -> None:
    axes.set_title("Fusion breaks: rejected GNSS, height and magnetometer samples")
    for row, name in enumerate(data.sets):
        times = [
            one.timestamp_sample[one.rejected & (np.arange(one.fused.size) >= np.argmax(one.fused))]
            for source, axis in data.samples[name]
            if axis == 0 and source in _SOURCES and (one := data.samples[name][source, axis]).fused.any()
        ]
        time = data.seconds(np.concatenate(times)) if times else np.zeros(0)
        axes.plot(time, np.full(time.size, row), "|", color=colours[name], markersize=7, markeredgewidth=0.8)
        resets = _reset_times(data, name)
        axes.plot(resets, np.full(resets.size, row), "v", color="#D55E00", markersize=4, label="_reset")
    axes.plot([], [], "|", color="#555555", markersize=7, label="rejected")
    axes.plot([], [], "v", color="#D55E00", markersize=4, label="start of a cut (reset or gap)")
    axes.set_yticks(range(len(data.sets)), data.sets)
    for label, name in zip(axes.get_yticklabels(), data.sets, strict=True):
        label.set_color(colours[name])
    # A free row on top for the legend.
    axes.set_ylim(len(data.sets) - 0.4, -1.7)
    axes.grid(visible=False, axis="y")
    _shade_unscored(axes, data)
    axes.set_xlabel("time since the log began [s]")
    axes.legend(loc="upper left", ncols=2, fontsize=7, borderaxespad=0.2)


def _reset_times(data: _FlightData, name: str) -> Array:
    if name != data.present:
        return np.zeros(0)
    starts = [cut.start_us for cut in from_documents(data.summary["cuts"]) if cut.start_us is not None]
    return np.array([(start - data.start) * 1e-6 for start in starts])


def _shade_unscored(axes: Axes, data: _FlightData) -> None:
    """Grey where nothing is scored: on the ground, in the warm-up, around resets and gaps."""
    local = data.local[data.present]["timestamp"]
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
