"""Figures of each source in windows of about 30 s, and of the worst window: what the mean over a flight hides."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.metrics.metric import Innovations
from fusetune.analyze.scoring.columns import BY_AXIS, columns_of
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, innovations_of
from fusetune.analyze.scoring.metrics_table import MetricsTable
from fusetune.analyze.scoring.window import ScoringWindow

Array = npt.NDArray[np.float64]

WINDOW_SCHEMA = pa.schema(
    [
        *BY_AXIS,
        pa.field("window", pa.int32()),
        *columns_of(pa.int64(), "start_us", "stop_us"),
        pa.field("metric", pa.string()),
        pa.field("value", pa.float64()),
        pa.field("n", pa.int64()),
    ]
)
"""One row per set, source, axis (or group of axes), window and metric; `n` is the number of samples behind it."""

_METRICS = {metric.name: metric.window for metric in INNOVATION_METRICS if metric.window is not None}

_FULL_ENOUGH = 0.5
"""A window with less than this share of the samples of the fullest one cannot be the worst."""


@dataclass(frozen=True)
class WindowFigures:
    """Figures of one source and axis: `values[metric]` is (S, W) for sets and windows that hold samples."""

    source: str
    axis: str
    sets: tuple[str, ...]
    window: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]
    values: dict[str, Array]


def window_edges(window: ScoringWindow, length_s: float) -> npt.NDArray[np.int64]:
    """Edges (W + 1,), µs, of windows of `length_s` from the start of the scored part of a flight.

    What remains at the end is a window of its own where it is half of one at least, and else belongs to the last one.
    """
    start, stop = window.intervals[0][0], window.intervals[-1][1]
    length = round(length_s * 1e6)
    edges = np.arange(start, stop, length, dtype=np.int64)
    if edges.size > 1 and 2 * (stop - int(edges[-1])) < length:
        edges = edges[:-1]
    return np.append(edges, stop)


def window_figures(members: list[PairedSamples], axis: str, edges: npt.NDArray[np.int64]) -> WindowFigures:
    """Figures of some axes of one source together; one axis alone is the usual case.

    Parameters
    ----------
    members : axes that share their samples and sets
    axis : name of the axis or group
    edges : of `window_edges`

    Returns
    -------
    The metrics of innovations that are declared to have windows
    """
    first = members[0]
    index = np.clip(np.searchsorted(edges, first.time, side="right") - 1, 0, edges.size - 2)
    starts = np.flatnonzero(np.r_[True, np.diff(index) != 0])
    counts = np.diff(np.r_[starts, index.size])
    of_sets = [_figures(given, starts, counts) for _, given in innovations_of(members)]
    values = {name: np.concatenate([one[name] for one in of_sets]) for name in of_sets[0]}
    return WindowFigures(first.source, axis, first.sets, index[starts], counts, values)


def _figures(given: Innovations, starts: npt.NDArray[np.int64], counts: npt.NDArray[np.int64]) -> dict[str, Array]:
    """Figures (1, W) of one set in the windows that begin at the rows `starts` and hold `counts` samples."""

    def mean(values: npt.NDArray) -> Array:
        return np.add.reduceat(values.astype(np.float64), starts, axis=-1) / counts

    return {name: window.of_mean(mean(window.score(given))) for name, window in _METRICS.items()}


def add_worst_windows(table: MetricsTable, figures: WindowFigures) -> None:
    """Append the largest figure of any window; windows with few samples do not count."""
    full = figures.counts >= _FULL_ENOUGH * figures.counts.max()
    for name, window in _METRICS.items():
        worst = figures.values[name][:, full].max(axis=1)
        table.add_each(figures.sets, figures.source, figures.axis, window.worst, worst, figures.counts.sum())


def window_rows(flight: str, figures: WindowFigures, edges: npt.NDArray[np.int64]) -> pa.Table:
    """Rows of `windows.parquet`."""
    sets, windows, metrics = len(figures.sets), figures.window.size, len(figures.values)
    rows = sets * windows * metrics
    # In the order set, window, metric.
    values = np.stack(list(figures.values.values()), axis=-1)
    window = np.tile(np.repeat(figures.window, metrics), sets)
    return pa.table(
        {
            "flight": _repeated([flight], np.zeros(rows, dtype=np.int32)),
            "set": _repeated(figures.sets, np.repeat(np.arange(sets, dtype=np.int32), windows * metrics)),
            "source": _repeated([figures.source], np.zeros(rows, dtype=np.int32)),
            "axis": _repeated([figures.axis], np.zeros(rows, dtype=np.int32)),
            "window": pa.array(window.astype(np.int32)),
            "start_us": pa.array(edges[window]),
            "stop_us": pa.array(edges[window + 1]),
            "metric": _repeated(list(figures.values), np.tile(np.arange(metrics, dtype=np.int32), sets * windows)),
            "value": pa.array(values.ravel()),
            "n": pa.array(np.tile(np.repeat(figures.counts, metrics), sets).astype(np.int64)),
        },
        schema=WINDOW_SCHEMA,
    )


def _repeated(names: list[str] | tuple[str, ...], index: npt.NDArray[np.int32]) -> pa.Array:
    return pa.array(names, pa.string()).take(pa.array(index))
