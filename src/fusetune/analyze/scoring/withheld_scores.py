"""What the sets of one flight predicted in the present set's gaps without a sensor: errors, drift and likelihood."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import repeat

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.innovation_metrics import rms_innovation
from fusetune.analyze.metrics.likelihood import gaussian_nll, winsor_limit
from fusetune.analyze.metrics.metric import SOURCE_UNIT, Metric
from fusetune.analyze.replaying.replayed_set import Columns, ReplayedSet
from fusetune.analyze.replaying.samples import SourceAxis
from fusetune.analyze.scoring.charges import EvidenceCost, OwnEvidence, charged
from fusetune.analyze.scoring.columns import (
    FLIGHT_AND_SET,
    SOURCE_AND_AXIS,
    columns_of,
    parted,
    repeated,
    texts_repeated,
)
from fusetune.analyze.scoring.metrics_table import MetricsTable
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


@dataclass(frozen=True, eq=False)
class GapMask:
    """Predictions in gaps that are scored, of one source, axis and horizon: those of the present set; arrays (G,).

    `key` names gap, source, axis and horizon.
    """

    sensor: str
    source: str
    axis: int
    horizon_s: float
    key: npt.NDArray[np.int64]
    gap: npt.NDArray[np.int64]
    start: npt.NDArray[np.int64]
    n: npt.NDArray[np.int64]
    error: Array
    variance: Array

    @cached_property
    def winsor_limit(self) -> float:
        """See `fusetune.analyze.metrics.likelihood.winsor_limit`; of the present set alone, as no other has a say."""
        return winsor_limit(self.error.copy())


@dataclass(frozen=True, eq=False)
class CountedGaps:
    """A set's predictions in the gaps of a mask, as they count, (G,), and what the set cost itself.

    Of a set that lacks too many to be compared `error` and `variance` are empty.
    """

    mask: GapMask
    error: Array
    variance: Array
    cost: EvidenceCost

    @property
    def is_compared(self) -> bool:
        return bool(self.error.size)


WITHHELD_METRICS: tuple[Metric[CountedGaps], ...] = (
    Metric(
        "withheld_rms_{horizon}s", SOURCE_UNIT, "root mean square error after so many seconds without the sensor",
        lambda gaps: rms_innovation(gaps.error), "lower", ("report",),
    ),
    Metric(
        "withheld_nll_{horizon}s", "nat", "negative log-likelihood of the same per gap",
        lambda gaps: np.mean(gaussian_nll(gaps.error, gaps.variance)), "lower",
    ),
)  # fmt: skip
"""By axis and horizon."""

DRIFT: Metric[Sequence[CountedGaps]] = Metric(
    "withheld_drift", SOURCE_UNIT, "root mean square of the error's norm at the last of these, of groups of axes",
    lambda members: np.sqrt(np.mean(sum(np.square(one.error) for one in members))), "lower",
)  # fmt: skip


def gap_masks(present: ReplayedSet, window: ScoringWindow) -> tuple[GapMask, ...]:
    """Predictions in the gaps of the present set that lie wholly in the scored part of the flight.

    A gap counts if this set used the sensor when the gap began. A replay from elsewhere has none.
    """
    if present.withheld is None:
        return ()
    base = _by_key(present.withheld())
    usable = _inside(base["start"], base["stop"], window) & _is_usable(base)
    found: list[GapMask] = []
    for sensor, sources in WITHHOLDABLE.items():
        for source in sources:
            used = usable & (base["sensor"] == sensor) & (base["source"] == source)
            used &= _in_use(present, source, base["start"])
            for axis in range(AID_SOURCES[source].axes):
                for horizon in np.unique(base["horizon_s"][used]):
                    take = np.flatnonzero(used & (base["axis"] == axis) & (base["horizon_s"] == horizon))
                    if take.size:
                        columns = {name: base[name][take] for name in ("key", "gap", "start", "n")}
                        error, variance = base["innovation"][take], base["innovation_variance"][take]
                        found.append(
                            GapMask(sensor, source, axis, float(horizon), **columns, error=error, variance=variance)
                        )
    return tuple(found)


def counted_gaps(
    masks: Sequence[GapMask], record: ReplayedSet, window: ScoringWindow, max_lacking_percent: float
) -> list[CountedGaps]:
    """Predictions of a set in the present set's gaps; what it lacks, and what follows its own resets, counts as
    `fusetune.analyze.scoring.charges` says.

    Parameters
    ----------
    window : as the set sees it (`ScoringWindow.of_set`)
    max_lacking_percent : a set that lacks more is left out
    """
    if record.withheld is None or not masks:
        return []
    matched = _matched(masks, record, _by_key(record.withheld()), window)
    return [_counted(mask, one, max_lacking_percent) for mask, one in zip(masks, matched, strict=True)]


def own_gaps(masks: Sequence[GapMask]) -> list[CountedGaps]:
    """Predictions of the present set."""
    return [CountedGaps(one, one.error, one.variance, EvidenceCost(one.error.size, 0, 0)) for one in masks]


def _counted(mask: GapMask, one: _Matched, max_lacking_percent: float) -> CountedGaps:
    cost = one.cost
    if cost.lacking_percent > max_lacking_percent:
        return CountedGaps(mask, np.zeros(0), np.zeros(0), cost)
    if one.is_complete:
        return CountedGaps(mask, one.error, one.variance, cost)
    found = charged(one.error, one.variance, mask.error, one.lacking, one.after_reset, mask.winsor_limit, one.alone)
    return CountedGaps(mask, found.error, found.variance, cost)


@dataclass(frozen=True, eq=False)
class _Matched(OwnEvidence):
    """A set's predictions in gaps of the present one; where it is lacking its error and variance mean nothing. `alone`
    is true where the set predicted in the gap, but no measurement fell into the second before this horizon."""

    error: Array
    variance: Array
    alone: npt.NDArray[np.bool_]


def _matched(
    masks: Sequence[GapMask], record: ReplayedSet, table: Mapping[str, npt.NDArray], window: ScoringWindow
) -> list[_Matched]:
    """Of each mask; looked up for all of them at once."""
    counts = [mask.key.size for mask in masks]
    key, start = (np.concatenate([getattr(mask, name) for mask in masks]) for name in ("key", "start"))
    resets = record.name in window.own_resets
    if not table["key"].size:
        nothing, nowhere = np.zeros(start.shape), np.zeros(start.shape, bool)
        return _parted(counts, ~nowhere, nowhere, resets, nothing, nothing + 1.0, nowhere)
    row = np.minimum(np.searchsorted(table["key"], key), table["key"].size - 1)
    # Before it was fused once a source is predicted from nothing.
    never = np.iinfo(np.int64).max
    since = np.repeat([record.first_fused.get((mask.source, 0), never) for mask in masks], counts)
    absent = table["key"][row] != key
    lacking = absent | ~_is_usable(table)[row] | (start < since)
    alone = absent & (start >= since)
    if alone.any():
        alone &= np.isin(key // _HORIZONS, table["key"] // _HORIZONS)
    after_reset = window.after_own_reset(record.name, start) & ~lacking
    error, variance = table["innovation"][row], table["innovation_variance"][row]
    return _parted(counts, lacking, after_reset, resets, error, variance, alone)


def _parted(
    counts: Sequence[int],
    lacking: npt.NDArray[np.bool_],
    after_reset: npt.NDArray[np.bool_],
    resets: bool,
    error: Array,
    variance: Array,
    alone: npt.NDArray[np.bool_],
) -> list[_Matched]:
    ends = np.cumsum(counts).tolist()
    parts = [slice(stop - count, stop) for stop, count in zip(ends, counts, strict=True)]
    return [_Matched(lacking[one], after_reset[one], resets, error[one], variance[one], alone[one]) for one in parts]


def _is_usable(table: Mapping[str, npt.NDArray]) -> npt.NDArray[np.bool_]:
    return np.isfinite(table["innovation"]) & (table["innovation_variance"] > 0.0)


def _by_key(table: Columns) -> dict[str, npt.NDArray]:
    """Columns of one set's predictions, in ascending order of a key that names gap, source, axis and horizon."""
    numbers = {name: number for number, name in enumerate(AID_SOURCES)}
    source = np.array([numbers.get(name, -1) for name in table["source"]], np.int64)
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


def withheld_rows(
    flight: str, of_sets: Mapping[str, Sequence[CountedGaps]], edges: npt.NDArray[np.int64]
) -> Iterator[pa.Table]:
    """The predictions of each set as rows of `WITHHELD_SCHEMA`, with the block that each gap begins in."""
    compared = {name: [one for one in found if one.is_compared] for name, found in of_sets.items()}
    gaps = [one for found in compared.values() for one in found]
    if not gaps:
        return repeat(WITHHELD_SCHEMA.empty_table(), len(of_sets))
    counts = np.array([one.error.size for one in gaps])
    sets = [name for name, found in compared.items() for _ in found]

    def joined(name: str) -> npt.NDArray:
        return np.concatenate([getattr(one.mask, name) for one in gaps])

    start, error = joined("start"), np.concatenate([one.error for one in gaps])
    block = np.clip(np.searchsorted(edges, start, side="right") - 1, 0, edges.size - 2)
    limit = np.repeat([one.mask.winsor_limit for one in gaps], counts)
    columns = {
        "flight": repeated(flight, int(counts.sum())),
        "set": texts_repeated(sets, counts),
        "sensor": texts_repeated([one.mask.sensor for one in gaps], counts),
        "gap": pa.array(joined("gap").astype(np.int32)),
        "start_us": pa.array(start),
        "block": pa.array(block.astype(np.int32)),
        "source": texts_repeated([one.mask.source for one in gaps], counts),
        "axis": pa.array(np.repeat(np.array([one.mask.axis for one in gaps], np.int32), counts)),
        "horizon_s": pa.array(np.repeat(np.array([one.mask.horizon_s for one in gaps]), counts)),
        "n": pa.array(joined("n").astype(np.int32)),
        "error": pa.array(error),
        "error_winsorised": pa.array(np.clip(error, -limit, limit)),
        "variance": pa.array(np.concatenate([one.variance for one in gaps])),
    }
    table = pa.table(columns, schema=WITHHELD_SCHEMA)
    return parted(table, [sum(one.error.size for one in found) for found in compared.values()])


def add_withheld_metrics(table: MetricsTable, set_name: str, gaps: Sequence[CountedGaps]) -> None:
    """Append RMS error and NLL per axis and horizon, and the drift at the end of the gaps (by group of axes)."""
    longest: dict[str, float] = {}
    for one in gaps:
        longest[one.mask.sensor] = max(longest.get(one.mask.sensor, 0.0), one.mask.horizon_s)
    last: dict[SourceAxis, CountedGaps] = {}
    for one in gaps:
        mask, count = one.mask, one.error.size
        if count < FEWEST_GAPS:
            continue
        for metric in WITHHELD_METRICS:
            name = metric.name.format(horizon=f"{mask.horizon_s:g}")
            table.add(set_name, mask.source, AXES[mask.axis], name, float(metric.function(one)), count)
        if mask.horizon_s >= longest[mask.sensor]:
            last[mask.source, mask.axis] = one
    for source in dict.fromkeys(source for source, _ in last):
        for name, axes in AID_SOURCES[source].groups:
            members = [last[source, axis] for axis in axes if (source, axis) in last]
            if len(members) == len(axes) and all(_are_alike(one, members[0]) for one in members):
                drift = float(DRIFT.function(members))
                table.add(set_name, source, name, DRIFT.name, drift, members[0].mask.gap.size)


def _are_alike(one: CountedGaps, other: CountedGaps) -> bool:
    return np.array_equal(one.mask.gap, other.mask.gap)


def add_true_drift(table: MetricsTable, record: ReplayedSet, truth: Truth, window: ScoringWindow) -> None:
    """Append by how much the true horizontal error of position and velocity grew over the gaps without GNSS (RMS)."""
    if record.gaps is None:
        return
    gaps = record.gaps()
    rows = (gaps["sensor"] == "gnss") & _inside(gaps["start"], gaps["stop"], window)
    if np.count_nonzero(rows) < FEWEST_GAPS:
        return
    for quantity, fields, course in (("position", "x y", truth.position), ("velocity", "vx vy", truth.velocity)):
        begin, end = (
            np.column_stack([gaps[f"{name}_{moment}"][rows] for name in fields.split()])
            - interpolate(truth.time, course, gaps[f"timestamp_{moment}"][rows])[:, :2]
            for moment in ("begin", "end")
        )
        drift = float(np.sqrt(np.mean(np.sum(np.square(end - begin), axis=1))))
        table.add(record.name, f"truth_withheld_{quantity}", "horizontal", "rmse", drift, int(np.count_nonzero(rows)))
