"""The long table of figures: one row per flight, set, source, axis and metric."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics import likelihood
from fusetune.analyze.metrics.break_rate import beyond_standard_deviations, break_rate
from fusetune.analyze.metrics.consistency import Bounds, c_nis, effective_bounds, j_nis, mean_nis, paper_bounds
from fusetune.analyze.metrics.error_figures import ErrorFigure
from fusetune.analyze.metrics.innovation_metrics import mean_innovation, rms_innovation, rms_norm
from fusetune.analyze.metrics.whiteness import autocorrelation, effective_samples, lag_limit, ljung_box
from fusetune.analyze.scoring.filter_events import FilterEvents
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, SamplesOfSet, each_of
from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.analyze.scoring.scoring_settings import ScoringSettings
from fusetune.analyze.sensors.source_whiteness import Whiteness
from fusetune.analyze.sources import AID_SOURCES, AXES

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

    def add_each(self, sets: tuple[str, ...], source: str, axis: str, metric: str, values: Array, n: float) -> None:
        """Append one figure per set, `values` (S,)."""
        for name, value in zip(sets, values, strict=True):
            self.add(name, source, axis, metric, value, n)

    def add_bounds(
        self, sets: tuple[str, ...], source: str, axis: str, metric: str, bounds: Bounds, n: float | Array
    ) -> None:
        """Append one figure with bounds per set."""
        counts = np.broadcast_to(n, bounds.value.shape)
        for i, name in enumerate(sets):
            self.add(name, source, axis, metric, bounds.value[i], counts[i], bounds.lower[i], bounds.upper[i])

    def add_metric_by_metric(self, tables: Sequence[MetricsTable]) -> None:
        """Append the rows of several tables, the first of each, then the second of each, and so on."""
        for name, column in self._columns.items():
            column += itertools.chain.from_iterable(zip(*(one._columns[name] for one in tables), strict=True))

    def finished(self) -> pa.Table:
        return pa.table({name: pa.array(v) for name, v in self._columns.items()}, schema=METRICS_SCHEMA)


def add_axis_metrics(table: MetricsTable, pairs: PairedSamples, settings: ScoringSettings) -> None:
    """Append all figures of one source and axis for all its sets."""
    if pairs.time.size < FEWEST_SAMPLES:
        return
    limit = pairs.winsor_limit
    table.add_metric_by_metric([_axis_metrics(table.flight, one, limit, settings) for one in pairs.each()])


def _axis_metrics(flight: str, pairs: SamplesOfSet, limit: float, settings: ScoringSettings) -> MetricsTable:
    """The figures of one set; `limit` is that of `likelihood.winsor_limit` over all."""
    table = MetricsTable(flight)
    source, axis, sets, n = pairs.source, AXES[pairs.axis], pairs.sets, pairs.time.size
    innovation, variance = pairs.innovation, pairs.innovation_variance
    correlation = autocorrelation(innovation / np.sqrt(variance), lag_limit(n))
    independent = effective_samples(correlation, n)
    nis = mean_nis(innovation[None], variance[None])
    table.add_each(sets, source, axis, "mean_innovation", mean_innovation(innovation), n)
    table.add_each(sets, source, axis, "rms_innovation", rms_innovation(innovation), n)
    table.add_bounds(sets, source, axis, "mean_nis", paper_bounds(nis, n, 1, settings.confidence), n)
    effective = effective_bounds(nis, independent, 1, settings.confidence)
    table.add_bounds(sets, source, axis, "mean_nis_effective", effective, independent)
    table.add_each(sets, source, axis, "j_nis", j_nis(nis, 1), n)
    table.add_each(sets, source, axis, "c_nis", c_nis(innovation[None], variance[None]), n)
    if correlation.shape[-1]:
        statistic, p_value = ljung_box(correlation, n)
        table.add_each(sets, source, axis, "lag1_correlation", correlation[:, 0], n)
        table.add_each(sets, source, axis, "ljung_box", statistic, n)
        table.add_each(sets, source, axis, "ljung_box_p", p_value, n)
    for metric, value in _likelihoods(pairs, limit).items():
        table.add_each(sets, source, axis, metric, value, n)
    for deviations in (3, 5):
        broken = beyond_standard_deviations(innovation, variance, deviations)
        table.add_bounds(sets, source, axis, f"break_rate_{deviations}sd", break_rate(broken, settings.confidence), n)
    table.add_bounds(sets, source, axis, "break_rate_gate", break_rate(pairs.beyond_gate, settings.confidence), n)
    return table


def _likelihoods(pairs: SamplesOfSet, limit: float) -> dict[str, Array]:
    innovation, variance = pairs.innovation, pairs.innovation_variance
    clipped = likelihood.winsorised(innovation, limit)
    log_variance = np.mean(np.log(variance), axis=-1)
    nis = np.mean(np.square(innovation) / variance, axis=-1)
    clipped_nis = np.mean(np.square(clipped) / variance, axis=-1)
    return {
        "nll": np.mean(likelihood.gaussian_nll(innovation, variance), axis=-1),
        "nll_student_t": np.mean(likelihood.student_t_nll(innovation, variance), axis=-1),
        "nll_winsorised": np.mean(likelihood.gaussian_nll(clipped, variance), axis=-1),
        "nll_profile": likelihood.profile_nll(nis, log_variance),
        "nll_profile_winsorised": likelihood.profile_nll(clipped_nis, log_variance),
    }


def add_group_metrics(table: MetricsTable, pairs: dict[int, PairedSamples], settings: ScoringSettings) -> None:
    """Append the aggregates (horizontal, vertical, all axes) of one source, whose axes share their samples.

    Parameters
    ----------
    pairs : by axis
    """
    for group, members in groups_of(pairs):
        limits = [one.winsor_limit for one in members]
        table.add_metric_by_metric(
            [_group_metrics(table.flight, group, one, limits, settings) for one in each_of(members)]
        )


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


def _group_metrics(
    flight: str, group: str, members: list[SamplesOfSet], limits: list[float], settings: ScoringSettings
) -> MetricsTable:
    table = MetricsTable(flight)
    source, sets, n, dimension = members[0].source, members[0].sets, members[0].time.size, len(members)
    innovation = np.stack([one.innovation for one in members])
    variance = np.stack([one.innovation_variance for one in members])
    nis = mean_nis(innovation, variance)
    shares = effective_samples(autocorrelation(innovation / np.sqrt(variance), lag_limit(n)), n) / n
    independent = n * np.mean(shares, axis=0)
    table.add_each(sets, source, group, "rms_innovation", rms_norm(innovation), n)
    table.add_bounds(sets, source, group, "mean_nis", paper_bounds(nis, n, dimension, settings.confidence), n)
    effective = effective_bounds(nis, independent, dimension, settings.confidence)
    table.add_bounds(sets, source, group, "mean_nis_effective", effective, independent)
    table.add_each(sets, source, group, "j_nis", j_nis(nis, dimension), n)
    table.add_each(sets, source, group, "c_nis", c_nis(innovation, variance), n)
    _add_group_likelihoods(table, group, members, limits)
    for metric, broken in (
        ("break_rate_3sd", [beyond_standard_deviations(one.innovation, one.innovation_variance, 3) for one in members]),
        ("break_rate_5sd", [beyond_standard_deviations(one.innovation, one.innovation_variance, 5) for one in members]),
        ("break_rate_gate", [one.beyond_gate for one in members]),
    ):
        rate = break_rate(np.logical_or.reduce(broken), settings.confidence)
        table.add_bounds(sets, source, group, metric, rate, n)
    return table


def _add_group_likelihoods(table: MetricsTable, group: str, members: list[SamplesOfSet], limits: list[float]) -> None:
    """Likelihoods of several axes: the sums of theirs, each axis winsorised and scaled by itself."""
    sums: dict[str, Array] = {}
    for one, limit in zip(members, limits, strict=True):
        for metric, value in _likelihoods(one, limit).items():
            sums[metric] = sums[metric] + value if metric in sums else value
    first = members[0]
    for metric, value in sums.items():
        table.add_each(first.sets, first.source, group, metric, value, first.time.size)


def add_events(table: MetricsTable, set_name: str, events: FilterEvents, flight_s: float) -> None:
    """Append resets, timeouts, faults and time without aid; `flight_s` is the time over which they were counted."""
    for kind, count in events.resets.items():
        table.add(set_name, "filter", kind, "resets", count, flight_s)
    table.add(set_name, "filter", "all", "resets", events.total_resets, flight_s)
    for source, count in events.timeouts.items():
        if count:
            table.add(set_name, "filter", source, "timeouts", count, flight_s)
    table.add(set_name, "filter", "all", "timeouts", events.total_timeouts, flight_s)
    table.add(set_name, "filter", "all", "fault_flags", events.fault_flags, flight_s)
    table.add(set_name, "filter", "horizontal", "dead_reckoning_s", events.dead_reckoning_s, flight_s)
    for source, aid in events.aid.items():
        table.add(set_name, source, "all", "fused_share", aid.fused_share, aid.samples)
        table.add(set_name, source, "all", "longest_without_fusion_s", aid.longest_without_s, aid.samples)


def add_whiteness(table: MetricsTable, set_name: str, found: dict[tuple[str, int], Whiteness]) -> None:
    """Append what is white of each source's error, by axis and by group (the share of the summed variances)."""
    for (source, axis), one in found.items():
        add_one = partial(table.add, set_name, source, AXES[axis], n=one.samples)
        add_one("white_share", one.white_share)
        add_one("white_noise", one.white_noise)
        add_one("correlated_noise", one.correlated_noise)
        add_one("error_correlation_s", one.correlation_time_s)
    for source in dict.fromkeys(source for source, _ in found):
        for group, axes in AID_SOURCES[source].groups:
            members = [found[source, axis] for axis in axes if (source, axis) in found]
            if len(members) == len(axes):
                white = sum(one.white_noise**2 for one in members)
                total = white + sum(one.correlated_noise**2 for one in members)
                share = white / total if total > 0.0 else np.nan
                table.add(set_name, source, group, "white_share", share, members[0].samples)


def add_true_errors(table: MetricsTable, set_name: str, figures: list[ErrorFigure], kind: str = "truth") -> None:
    """Append errors against a reference of some kind, source `<kind>_<quantity>`."""
    for one in figures:
        source = f"{kind}_{one.quantity}"
        table.add(set_name, source, one.axis, one.metric, one.value, one.n, one.lower, one.upper)
