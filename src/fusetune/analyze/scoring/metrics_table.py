"""The long table of figures: one row per flight, set, source, axis and metric."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.metrics.error_figures import ErrorFigure
from fusetune.analyze.metrics.metric import Bounds, InnovationMetric
from fusetune.analyze.scoring.filter_events import EVENT_METRICS, SERVICE_METRICS, FilterEvents
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, innovations_of
from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.sensors.source_whiteness import WHITE_SHARE, WHITENESS_METRICS, Whiteness, joint_white_share
from fusetune.analyze.sensors.told_noise import TOLD_METRICS, ToldNoise
from fusetune.px4.aid_sources import AID_SOURCES, AXES

Array = npt.NDArray[np.float64]

FEWEST_SAMPLES = 4
"""Fewer samples than this tell nothing about variances and correlations."""


@dataclass
class MetricsTable:
    """Rows under construction."""

    flight: str
    _columns: dict[str, list] = field(default_factory=lambda: {name: [] for name in METRICS_SCHEMA.names})

    def add(
        self,
        set_name: str,
        source: str,
        axis: str,
        metric: str,
        value: float,
        n: float,
        lower: float = np.nan,
        upper: float = np.nan,
    ) -> None:
        """Append one figure."""
        row = (self.flight, set_name, source, axis, metric, float(value), float(lower), float(upper), float(n))
        for column, item in zip(self._columns.values(), row, strict=True):
            column.append(item)

    def add_each(
        self, sets: tuple[str, ...], source: str, axis: str, metric: str, values: Array | Bounds, n: float | Array
    ) -> None:
        """Append one figure per set, `values` and, where they are not the same for all, `n` (S,)."""
        bounds = values if isinstance(values, Bounds) else Bounds(values, *[np.full(values.shape, np.nan)] * 2)
        counts = np.broadcast_to(n, bounds.value.shape)
        for name, *row in zip(sets, bounds.value, counts, bounds.lower, bounds.upper, strict=True):
            self.add(name, source, axis, metric, *row)

    def add_metric_by_metric(self, tables: Sequence[MetricsTable]) -> None:
        """Append the rows of several tables, the first of each, then the second of each, and so on."""
        for name, column in self._columns.items():
            column += itertools.chain.from_iterable(zip(*(one._columns[name] for one in tables), strict=True))

    def finished(self) -> pa.Table:
        return pa.table({name: pa.array(v) for name, v in self._columns.items()}, schema=METRICS_SCHEMA)


def add_axis_metrics(table: MetricsTable, pairs: PairedSamples, settings: ScoringSettings) -> None:
    """Append all figures of one source and axis for all its sets."""
    if pairs.time.size >= FEWEST_SAMPLES:
        add_innovation_metrics(table, [pairs], AXES[pairs.axis], INNOVATION_METRICS, settings.confidence)


def add_group_metrics(table: MetricsTable, pairs: dict[int, PairedSamples], settings: ScoringSettings) -> None:
    """Append the aggregates (horizontal, vertical, all axes) of one source, whose axes share their samples.

    Parameters
    ----------
    pairs : by axis
    """
    of_groups = [metric for metric in INNOVATION_METRICS if metric.of_groups]
    for group, members in groups_of(pairs):
        add_innovation_metrics(table, members, group, of_groups, settings.confidence)


def add_innovation_metrics(
    table: MetricsTable,
    members: Sequence[PairedSamples],
    axis: str,
    metrics: Sequence[InnovationMetric],
    confidence: float,
    prefix: str = "",
) -> None:
    """Append figures of some axes of one source together, of one set after the other.

    Parameters
    ----------
    axis : name of the axis or group
    prefix : to the names of the metrics
    """
    tables = []
    for first, given in innovations_of(members, confidence, of_group=axis not in AXES):
        one = MetricsTable(table.flight)
        for metric in metrics:
            samples = given.samples if metric.samples is None else metric.samples(given)
            one.add_each(first.sets, first.source, axis, prefix + metric.name, metric.function(given), samples)
        tables.append(one)
    table.add_metric_by_metric(tables)


def groups_of(pairs: dict[int, PairedSamples]) -> Iterator[tuple[str, list[PairedSamples]]]:
    """Groups of axes of one source (horizontal, vertical, all) that share their samples and sets, with their axes."""
    if not pairs:
        return
    for group, axes in AID_SOURCES[next(iter(pairs.values())).source].groups:
        members = [pairs[axis] for axis in axes if axis in pairs]
        if len(members) != len(axes) or members[0].time.size < FEWEST_SAMPLES:
            continue
        if all(np.array_equal(one.time, members[0].time) and one.sets == members[0].sets for one in members):
            yield group, members


def add_events(table: MetricsTable, set_name: str, events: FilterEvents) -> None:
    """Append resets, timeouts, faults and time without aid; `n` is the time over which they were counted, s."""
    for metric in EVENT_METRICS:
        for kind, value in metric.function(events).items():
            table.add(set_name, "filter", kind, metric.name, value, events.flight_s)
    for source, aid in events.aid.items():
        for service in SERVICE_METRICS:
            table.add(set_name, source, "all", service.name, service.function(aid), aid.samples)


def add_whiteness(table: MetricsTable, set_name: str, found: dict[tuple[str, int], Whiteness]) -> None:
    """Append what is white of each source's error, by axis and by group (the share of the summed variances)."""
    for (source, axis), one in found.items():
        for metric in WHITENESS_METRICS:
            table.add(set_name, source, AXES[axis], metric.name, metric.function(one), one.samples)
    for source in dict.fromkeys(source for source, _ in found):
        for group, axes in AID_SOURCES[source].groups:
            members = [found[source, axis] for axis in axes if (source, axis) in found]
            if len(members) == len(axes):
                share = joint_white_share(members)
                table.add(set_name, source, group, WHITE_SHARE.name, share, members[0].samples)


def add_told_noise(table: MetricsTable, set_name: str, found: dict[tuple[str, int], ToldNoise]) -> None:
    """Append what the estimator was told of each source's noise, by axis."""
    for (source, axis), one in found.items():
        for metric in TOLD_METRICS:
            table.add(set_name, source, AXES[axis], metric.name, metric.function(one), one.samples)


def add_true_errors(table: MetricsTable, set_name: str, figures: list[ErrorFigure], kind: str = "truth") -> None:
    """Append errors against a reference of some kind, source `<kind>_<quantity>`."""
    for one in figures:
        source = f"{kind}_{one.quantity}"
        table.add(set_name, source, one.axis, one.metric, one.value, one.n, one.lower, one.upper)
