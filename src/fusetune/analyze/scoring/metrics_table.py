"""The long table of figures: one row per flight, set, source, axis and metric."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.metrics.error_figures import ErrorFigure
from fusetune.analyze.metrics.metric import Bounds, InnovationMetric, Innovations
from fusetune.analyze.scoring.columns import repeated
from fusetune.analyze.scoring.filter_events import EVENT_METRICS, SERVICE_METRICS, FilterEvents
from fusetune.analyze.scoring.measurement_alignment import AxesTogether
from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
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
    _names: list[tuple[str, str, str, str]] = field(default_factory=list)
    _figures: list[Sequence[float]] = field(default_factory=list)

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
        self._names.append((set_name, source, axis, metric))
        self._figures.append((value, lower, upper, n))

    def add_all(
        self, set_name: str, source: str, axes: Sequence[str], metrics: Sequence[str], figures: npt.NDArray
    ) -> None:
        """Append of one axis after the other all metrics; `figures` are (A, M, 4): value, lower, upper, n."""
        self._names += [(set_name, source, axis, metric) for axis in axes for metric in metrics]
        self._figures += figures.reshape(-1, figures.shape[-1]).tolist()

    def __len__(self) -> int:
        return len(self._names)

    def finished(self) -> pa.Table:
        return finished_tables([self])


def finished_tables(tables: Sequence[MetricsTable]) -> pa.Table:
    """The rows of several tables, one after the other."""
    names = [row for one in tables for row in one._names]
    figures = np.array([row for one in tables for row in one._figures], np.float64).reshape(-1, 4)
    texts = zip(*names, strict=True) if names else [()] * 4
    columns = [
        pa.concat_arrays([repeated(one.flight, len(one)) for one in tables]),
        *(pa.array(values, pa.string()) for values in texts),
        *(pa.array(np.ascontiguousarray(column)) for column in figures.T),
    ]
    return pa.table(columns, schema=METRICS_SCHEMA)


def add_innovation_metrics(
    tables: Mapping[str, MetricsTable],
    samples: AxesTogether,
    metrics: Sequence[InnovationMetric] = INNOVATION_METRICS,
    prefix: str = "",
) -> None:
    """Append figures of axes of one source, and of their groups (horizontal, vertical, all axes).

    Parameters
    ----------
    tables : of each of the sets, by name
    samples : nothing is told of too few
    metrics : by default all
    prefix : to the names of the metrics
    """
    if samples.time.size < FEWEST_SAMPLES:
        return
    axes = [AXES[axis] for axis in samples.axes]
    _add_figures(tables, samples.source, axes, samples.innovations, metrics, prefix)
    of_groups = [metric for metric in metrics if metric.of_groups]
    for group, given in samples.groups():
        _add_figures(tables, samples.source, [group], given, of_groups, prefix)


def _add_figures(
    tables: Mapping[str, MetricsTable],
    source: str,
    axes: Sequence[str],
    given: Innovations,
    metrics: Sequence[InnovationMetric],
    prefix: str,
) -> None:
    """Of one axis or group after the other, all metrics."""
    figures = np.full((len(tables), len(axes), len(metrics), 4), np.nan)
    for place, metric in enumerate(metrics):
        value = metric.function(given)
        n = given.samples if metric.samples is None else metric.samples(given).reshape(figures.shape[:2])
        told = (value.value, value.lower, value.upper) if isinstance(value, Bounds) else (value,)
        for column, values in enumerate(told):
            figures[:, :, place, column] = values.reshape(figures.shape[:2])
        figures[:, :, place, 3] = n
    names = [prefix + metric.name for metric in metrics]
    for (name, table), own in zip(tables.items(), figures, strict=True):
        table.add_all(name, source, axes, names, own)


def add_events(table: MetricsTable, set_name: str, events: FilterEvents) -> None:
    """Append resets, timeouts, faults and time without aid; `n` is the time over which they were counted, s."""
    for metric in EVENT_METRICS:
        for kind, value in metric.function(events).items():
            table.add(set_name, "filter", kind, metric.name, value, events.flight_s)
    for source, aid in events.aid.items():
        for service in SERVICE_METRICS:
            table.add(set_name, source, "all", service.name, service.function(aid), aid.samples)


def add_whiteness(table: MetricsTable, set_name: str, found: Mapping[tuple[str, int], Whiteness]) -> None:
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
