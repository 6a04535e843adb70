"""Figures of each source in windows of about 30 s, and of the worst window: what the mean over a flight hides."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.metrics.metric import Innovations
from fusetune.analyze.scoring.columns import BY_AXIS, columns_of, parted, repeated, texts_repeated
from fusetune.analyze.scoring.measurement_alignment import AxesTogether
from fusetune.analyze.scoring.metrics_table import FEWEST_SAMPLES, MetricsTable
from fusetune.analyze.scoring.parts import Parts, parts_of
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.px4.aid_sources import AXES

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


@dataclass(frozen=True, eq=False)
class WindowFigures:
    """Figures of axes of one source, or of a group of them, in the windows that hold samples.

    Attributes
    ----------
    axes : names of the axes (A,), or of the group
    values : by metric, (A, W); of several sets of one after the other, (S A, W)
    """

    source: str
    axes: tuple[str, ...]
    parts: Parts
    values: dict[str, Array]

    @property
    def rows(self) -> int:
        """Of the table, where they are of one set."""
        return len(self.axes) * self.parts.number.size * len(self.values)

    def of_sets(self) -> Iterator[WindowFigures]:
        """Of one set after the other."""
        rows = len(self.axes)
        for first in range(0, len(next(iter(self.values.values()))), rows):
            yield replace(self, values={name: values[first : first + rows] for name, values in self.values.items()})


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


def window_figures(samples: AxesTogether, edges: npt.NDArray[np.int64]) -> Iterator[WindowFigures]:
    """Figures of the axes of one source, each by itself, and of each group of them; none of too few samples.

    Parameters
    ----------
    edges : of `window_edges`

    Returns
    -------
    The metrics of innovations that are declared to have windows
    """
    if samples.time.size < FEWEST_SAMPLES:
        return
    parts = parts_of(samples.time, edges)
    axes = tuple(AXES[axis] for axis in samples.axes)
    yield WindowFigures(samples.source, axes, parts, _figures(samples.innovations, parts))
    for name, given in samples.groups():
        yield WindowFigures(samples.source, (name,), parts, _figures(given, parts))


def _figures(given: Innovations, parts: Parts) -> dict[str, Array]:
    def mean(values: npt.NDArray) -> Array:
        return np.add.reduceat(values.astype(np.float64, copy=False), parts.starts, axis=-1) / parts.counts

    return {name: window.of_mean(mean(window.score(given))) for name, window in _METRICS.items()}


def add_worst_windows(tables: Mapping[str, MetricsTable], figures: WindowFigures) -> None:
    """Append the largest figure of any window to the table of each set; windows with few samples do not count."""
    counts = figures.parts.counts
    full = counts >= _FULL_ENOUGH * counts.max()
    rows = np.full((len(tables), len(figures.axes), len(_METRICS), 4), np.nan)
    for place, name in enumerate(_METRICS):
        rows[:, :, place, 0] = figures.values[name][:, full].max(axis=1).reshape(rows.shape[:2])
    rows[..., 3] = float(counts.sum())
    names = [window.worst for window in _METRICS.values()]
    for (name, table), own in zip(tables.items(), rows, strict=True):
        table.add_all(name, figures.source, figures.axes, names, own)


def window_rows(
    flight: str, of_sets: Mapping[str, Sequence[WindowFigures]], edges: npt.NDArray[np.int64]
) -> Iterator[pa.Table]:
    """Rows of `windows.parquet` of each set, in the order axis, window, metric."""
    figures = [one for found in of_sets.values() for one in found]
    if not figures:
        return repeat(WINDOW_SCHEMA.empty_table(), len(of_sets))
    sets = [name for name, found in of_sets.items() for one in found for _ in one.axes]
    windows = [one.parts.number.size for one in figures for _ in one.axes]
    values = np.concatenate([np.stack(list(one.values.values()), axis=-1).ravel() for one in figures])
    number = np.concatenate([one.parts.number for one in figures for _ in one.axes])
    counts = np.concatenate([one.parts.counts for one in figures for _ in one.axes])
    metrics = len(_METRICS)
    # of each axis, so many rows
    rows = np.array(windows) * metrics
    of_metrics = np.tile(np.arange(metrics, dtype=np.int32), number.size)
    window = np.repeat(number, metrics)
    table = pa.table(
        {
            "flight": repeated(flight, values.size),
            "set": texts_repeated(sets, rows),
            "source": texts_repeated([one.source for one in figures for _ in one.axes], rows),
            "axis": texts_repeated([axis for one in figures for axis in one.axes], rows),
            "window": pa.array(window.astype(np.int32)),
            "start_us": pa.array(edges[window]),
            "stop_us": pa.array(edges[window + 1]),
            "metric": pa.array([*_METRICS], pa.string()).take(pa.array(of_metrics)),
            "value": pa.array(values),
            "n": pa.array(np.repeat(counts, metrics).astype(np.int64)),
        },
        schema=WINDOW_SCHEMA,
    )
    return parted(table, [sum(one.rows for one in found) for found in of_sets.values()])
