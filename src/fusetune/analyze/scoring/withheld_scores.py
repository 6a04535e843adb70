"""What the sets of one flight predicted in the present set's gaps without a sensor: errors, drift and likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.innovation_metrics import rms_innovation
from fusetune.analyze.metrics.likelihood import gaussian_nll, winsor_limit, winsorised
from fusetune.analyze.metrics.metric import SOURCE_UNIT, Metric
from fusetune.analyze.replaying.replayed_set import Columns, ReplayedSet
from fusetune.analyze.scoring.charges import EvidenceCost, OwnEvidence, charged
from fusetune.analyze.scoring.columns import FLIGHT_AND_SET, SOURCE_AND_AXIS, columns_of
from fusetune.analyze.scoring.metrics_table import MetricsTable
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.true_errors import Truth, interpolate
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.px4.aid_sources import AID_SOURCES, AXES, WITHHOLDABLE

Array = npt.NDArray[np.float64]

WITHHELD_SCHEMA = pa.schema(
    [
        *FLIGHT_AND_SET,
        pa.field("sensor", pa.string()),
        pa.field("gap", pa.int32()),
        pa.field("start_us", pa.int64()),
        pa.field("block", pa.int32()),
        *SOURCE_AND_AXIS,
        pa.field("horizon_s", pa.float64()),
        pa.field("n", pa.int32()),
        *columns_of(pa.float64(), "error", "error_winsorised", "variance"),
    ]
)
"""One row per set, gap, source, axis and horizon. `error` (prediction less measurement, in the unit of the source) and
`variance` are means over the second before the horizon; the rows of all sets are the same gaps and measurements."""

FEWEST_GAPS = 3
"""Fewer gaps than this make no figure."""

_HORIZONS = 1000
"""Keys of predictions leave room for horizons below 100 s, in tenths."""

_STALE_US = 1_000_000
"""A sensor that the present set has not fused for so long was not there to be withheld."""


@dataclass(frozen=True)
class PairedGaps:
    """Predictions of one source, axis and horizon in the gaps of the present set, as they count; arrays (S, G), the
    sets first. `complete` and `costs` are as of `fusetune.analyze.scoring.measurement_alignment.PairedSamples`."""

    sensor: str
    source: str
    axis: int
    horizon_s: float
    sets: tuple[str, ...]
    gap: npt.NDArray[np.int64]
    start: npt.NDArray[np.int64]
    n: npt.NDArray[np.int64]
    error: Array
    variance: Array
    complete: tuple[bool, ...] = ()
    costs: Mapping[str, EvidenceCost] = field(default_factory=dict)

    @property
    def winsor_limit(self) -> float:
        """See `fusetune.analyze.metrics.likelihood.winsor_limit`; of the complete sets, as others have no say."""
        return winsor_limit(self.error[list(self.complete)] if self.complete else self.error)


WITHHELD_METRICS: tuple[Metric[PairedGaps], ...] = (
    Metric(
        "withheld_rms_{horizon}s", SOURCE_UNIT, "root mean square error after so many seconds without the sensor",
        lambda gaps: rms_innovation(gaps.error), "lower", ("report",),
    ),
    Metric(
        "withheld_nll_{horizon}s", "nat", "negative log-likelihood of the same per gap",
        lambda gaps: np.mean(gaussian_nll(gaps.error, gaps.variance), axis=1), "lower",
    ),
)  # fmt: skip
"""By axis and horizon."""

DRIFT: Metric[Sequence[PairedGaps]] = Metric(
    "withheld_drift", SOURCE_UNIT, "root mean square of the error's norm at the last of these, of groups of axes",
    lambda members: np.sqrt(np.mean(sum(np.square(one.error) for one in members), axis=1)), "lower",
)  # fmt: skip


def paired_gaps(
    records: Sequence[ReplayedSet], present: str, window: ScoringWindow, settings: ScoringSettings | None = None
) -> list[PairedGaps]:
    """Predictions in the gaps of the present set that lie wholly in the scored part of the flight.

    Parameters
    ----------
    records : sets that are scored on this flight, the present one among them; each with predictions
    present : a gap counts if this set used the sensor when the gap began. What the others lack, and what follows their
        own resets, counts as `fusetune.analyze.scoring.charges` says.
    settings : by how much a set that lacks gaps is left out
    """
    most = (settings or ScoringSettings()).max_lacking_percent
    records = sorted(records, key=lambda record: record.name != present)
    tables = [_by_key(record.withheld()) for record in records if record.withheld is not None]
    base = tables[0]
    usable = _inside(base["start"], base["stop"], window) & _is_usable(base)
    groups: list[PairedGaps] = []
    for sensor, sources in WITHHOLDABLE.items():
        for source in sources:
            used = usable & (base["sensor"] == sensor) & (base["source"] == source)
            used &= _in_use(records[0], source, base["start"])
            for axis in range(AID_SOURCES[source].axes):
                for horizon in np.unique(base["horizon_s"][used]):
                    take = np.flatnonzero(used & (base["axis"] == axis) & (base["horizon_s"] == horizon))
                    if take.size:
                        mask = {name: values[take] for name, values in base.items()}
                        groups.append(_paired(records, tables, mask, window, most))
    return groups


def _paired(
    records: Sequence[ReplayedSet],
    tables: Sequence[Mapping[str, npt.NDArray]],
    mask: Mapping[str, npt.NDArray],
    window: ScoringWindow,
    most_lacking_percent: float,
) -> PairedGaps:
    """One source, axis and horizon: those rows of the present set, the first of the records, and the others' like."""
    source, axis = str(mask["source"][0]), int(mask["axis"][0])
    matched = [_matched(record, table, mask, window) for record, table in zip(records, tables, strict=True)]
    costs = {record.name: one.cost for record, one in zip(records, matched, strict=True)}
    kept = [number for number, one in enumerate(matched) if one.cost.lacking_percent <= most_lacking_percent]
    present = matched[0].error
    limit = winsor_limit(np.stack([matched[number].error for number in kept if matched[number].is_complete]))
    counted = [
        charged(one.error, one.variance, present, one.lacking, one.after_reset, limit, one.alone)
        for one in (matched[number] for number in kept)
    ]
    return PairedGaps(
        str(mask["sensor"][0]), source, axis, float(mask["horizon_s"][0]),
        tuple(records[number].name for number in kept), mask["gap"], mask["start"], mask["n"],
        np.stack([one.error for one in counted]), np.stack([one.variance for one in counted]),
        tuple(matched[number].is_complete for number in kept), costs,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Matched(OwnEvidence):
    """A set's predictions in gaps of the present one; where it is lacking its error and variance mean nothing. `alone`
    is true where the set predicted in the gap, but no measurement fell into the second before this horizon."""

    error: Array
    variance: Array
    alone: npt.NDArray[np.bool_]


def _matched(
    record: ReplayedSet,
    table: Mapping[str, npt.NDArray],
    mask: Mapping[str, npt.NDArray],
    window: ScoringWindow,
) -> _Matched:
    start, resets = mask["start"], record.name in window.own_resets
    if not table["key"].size:
        nothing, nowhere = np.zeros(start.shape), np.zeros(start.shape, bool)
        return _Matched(~nowhere, nowhere, resets, nothing, nothing + 1.0, nowhere)
    row = np.minimum(np.searchsorted(table["key"], mask["key"]), table["key"].size - 1)
    # Before it was fused once a source is predicted from nothing.
    since = record.first_fused.get((str(mask["source"][0]), 0), np.iinfo(np.int64).max)
    absent = table["key"][row] != mask["key"]
    lacking = absent | ~_is_usable(table)[row] | (start < since)
    alone = absent & (start >= since) & np.isin(mask["key"] // _HORIZONS, table["key"] // _HORIZONS)
    after_reset = window.after_own_reset(record.name, start) & ~lacking
    return _Matched(lacking, after_reset, resets, table["innovation"][row], table["innovation_variance"][row], alone)


def _is_usable(table: Mapping[str, npt.NDArray]) -> npt.NDArray[np.bool_]:
    return np.isfinite(table["innovation"]) & (table["innovation_variance"] > 0.0)


def _by_key(table: Columns) -> dict[str, npt.NDArray]:
    """Columns of one set's predictions, in ascending order of a key that names gap, source, axis and horizon."""
    sources = list(AID_SOURCES)
    source = np.array([sources.index(name) if name in AID_SOURCES else -1 for name in table["source"]], np.int64)
    horizon_ds = np.rint(table["horizon_s"] * 10.0).astype(np.int64)
    key = ((table["start"] * 64 + source) * 4 + table["axis"]) * _HORIZONS + horizon_ds
    order = np.argsort(key, kind="stable")
    return {"key": key[order]} | {name: values[order] for name, values in table.items()}


def _inside(start: npt.NDArray[np.int64], stop: npt.NDArray[np.int64], window: ScoringWindow) -> npt.NDArray[np.bool_]:
    """True where a gap lies within one scored interval."""
    inside = np.zeros(start.shape, bool)
    for first, last in window.intervals:
        inside |= (start >= first) & (stop <= last)
    return inside


def _in_use(record: ReplayedSet, source: str, start: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """True where the record fused a source shortly before a time."""
    samples = record.samples.get((source, 0))
    if samples is None or not samples.fused.any():
        return np.zeros(start.shape, bool)
    fused = samples.timestamp_sample[samples.fused]
    last = fused[np.maximum(np.searchsorted(fused, start) - 1, 0)]
    return (last <= start) & (start - last <= _STALE_US)


def withheld_rows(flight: str, groups: Sequence[PairedGaps], edges: npt.NDArray[np.int64]) -> pa.Table:
    """The predictions as rows of `WITHHELD_SCHEMA`, with the block that each gap begins in."""
    tables = [_rows_of(flight, group, edges) for group in groups]
    return pa.concat_tables(tables) if tables else WITHHELD_SCHEMA.empty_table()


def _rows_of(flight: str, group: PairedGaps, edges: npt.NDArray[np.int64]) -> pa.Table:
    sets, gaps = group.error.shape
    block = np.clip(np.searchsorted(edges, group.start, side="right") - 1, 0, edges.size - 2)
    clipped = winsorised(group.error, group.winsor_limit)
    count = sets * gaps
    columns = {
        "flight": pa.array([flight] * count, pa.string()),
        "set": pa.array(np.repeat(np.array(group.sets, dtype=object), gaps), pa.string()),
        "sensor": pa.array([group.sensor] * count, pa.string()),
        "gap": pa.array(np.tile(group.gap.astype(np.int32), sets)),
        "start_us": pa.array(np.tile(group.start, sets)),
        "block": pa.array(np.tile(block.astype(np.int32), sets)),
        "source": pa.array([group.source] * count, pa.string()),
        "axis": pa.array(np.full(count, group.axis, np.int32)),
        "horizon_s": pa.array(np.full(count, group.horizon_s)),
        "n": pa.array(np.tile(group.n.astype(np.int32), sets)),
        "error": pa.array(group.error.ravel()),
        "error_winsorised": pa.array(clipped.ravel()),
        "variance": pa.array(group.variance.ravel()),
    }
    return pa.table(columns, schema=WITHHELD_SCHEMA)


def add_withheld_metrics(table: MetricsTable, groups: Sequence[PairedGaps]) -> None:
    """Append RMS error and NLL per axis and horizon, and the drift at the end of the gaps (by group of axes)."""
    last = {}
    for group in groups:
        gaps = group.error.shape[1]
        if gaps < FEWEST_GAPS:
            continue
        for metric in WITHHELD_METRICS:
            name = metric.name.format(horizon=f"{group.horizon_s:g}")
            table.add_each(group.sets, group.source, AXES[group.axis], name, metric.function(group), gaps)
        if group.horizon_s >= max(other.horizon_s for other in groups if other.sensor == group.sensor):
            last[group.source, group.axis] = group
    for source in dict.fromkeys(source for source, _ in last):
        for name, axes in AID_SOURCES[source].groups:
            members = [last[source, axis] for axis in axes if (source, axis) in last]
            if len(members) == len(axes) and all(_are_alike(one, members[0]) for one in members):
                drift = DRIFT.function(members)
                table.add_each(members[0].sets, source, name, DRIFT.name, drift, members[0].gap.size)


def _are_alike(one: PairedGaps, other: PairedGaps) -> bool:
    return one.sets == other.sets and np.array_equal(one.gap, other.gap)


def add_true_drift(table: MetricsTable, records: Sequence[ReplayedSet], truth: Truth, window: ScoringWindow) -> None:
    """Append by how much the true horizontal error of position and velocity grew over the gaps without GNSS (RMS)."""
    for record in records:
        if record.gaps is None:
            continue
        gaps = record.gaps()
        rows = (gaps["sensor"] == "gnss") & _inside(gaps["start"], gaps["stop"], window)
        if np.count_nonzero(rows) < FEWEST_GAPS:
            continue
        for quantity, fields, course in (("position", "x y", truth.position), ("velocity", "vx vy", truth.velocity)):
            begin, end = (
                np.column_stack([gaps[f"{name}_{moment}"][rows] for name in fields.split()])
                - interpolate(truth.time, course, gaps[f"timestamp_{moment}"][rows])[:, :2]
                for moment in ("begin", "end")
            )
            drift = float(np.sqrt(np.mean(np.sum(np.square(end - begin), axis=1))))
            table.add(
                record.name, f"truth_withheld_{quantity}", "horizontal", "rmse", drift, int(np.count_nonzero(rows))
            )
