"""Brings the samples of all parameter sets to the same measurements: those of the present set."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.likelihood import winsor_limit
from fusetune.analyze.metrics.metric import Innovations
from fusetune.analyze.replaying.measurement_times import match, measurement_time
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SampleSpool, SourceAxis, SpooledRows, gate_of
from fusetune.analyze.scoring.charges import EvidenceCost, OwnEvidence, charged, passed_over
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow

_TOLERANCE = 0.4
"""Two samples are one measurement when they are nearer than this share of the median spacing."""


@dataclass(frozen=True)
class SamplesOfSet:
    """Samples of one source, axis and set, arrays (1, N): the sets first, here the only one.

    `time` (N,) is the time of the measurement, µs. Rejected samples are among them: a set that rejects its worst
    samples must not profit from it.
    """

    source: str
    axis: int
    sets: tuple[str]
    time: npt.NDArray[np.int64]
    innovation: npt.NDArray[np.float64]
    innovation_variance: npt.NDArray[np.float64]
    test_ratio: npt.NDArray[np.float64]
    rejected: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class PairedSamples:
    """Samples of one source and axis at the same measurements, as they count; calculate with what `each` gives.

    `rows` holds the samples of each set, (N,) with the `FIGURES`, in single precision where that is exact, and may read
    them from the disk. `complete` says of each set whether it lacks none and has no reset of its own on the flight.
    `costs` says what each of the sets that were asked for cost itself, also of those that are left out.
    """

    source: str
    axis: int
    sets: tuple[str, ...]
    time: npt.NDArray[np.int64]
    rows: Sequence[np.ndarray]
    complete: tuple[bool, ...] = ()
    costs: Mapping[str, EvidenceCost] = field(default_factory=dict)

    def each(self) -> Iterator[SamplesOfSet]:
        """The samples of one set after the other, in double precision."""
        for name, rows in zip(self.sets, self.rows, strict=True):
            innovation, variance, ratio = (rows[figure].astype(np.float64)[None] for figure in FIGURES[:3])
            rejected = rows["rejected"][None]
            yield SamplesOfSet(self.source, self.axis, (name,), self.time, innovation, variance, ratio, rejected)

    @cached_property
    def winsor_limit(self) -> float:
        """See `fusetune.analyze.metrics.likelihood.winsor_limit`; of the complete sets, as others have no say."""
        chosen = [number for number, complete in enumerate(self.complete or (True,) * len(self.sets)) if complete]
        together = np.empty((len(chosen), self.time.size))
        for row, number in enumerate(chosen):
            together[row] = self.rows[number]["innovation"]
        return winsor_limit(together)


FIGURES = ("innovation", "innovation_variance", "test_ratio", "rejected")


def innovations_of(
    members: Sequence[PairedSamples], confidence: float = np.nan, *, of_group: bool = False
) -> Iterator[tuple[SamplesOfSet, Innovations]]:
    """Several axes that share their samples and sets: the samples of the first of them and what metrics are made of,
    of one set at a time."""

    def limits() -> list[float]:
        return [one.winsor_limit for one in members]

    for axes in zip(*(member.each() for member in members), strict=True):
        innovation, variance, ratio, rejected = (_stacked([getattr(one, name) for one in axes]) for name in FIGURES)
        yield axes[0], Innovations(innovation, variance, ratio, rejected, limits, confidence, of_group)


def _stacked(axes: list[np.ndarray]) -> np.ndarray:
    return axes[0][None] if len(axes) == 1 else np.stack(axes)


def paired_rows(columns: Mapping[str, npt.NDArray]) -> np.ndarray:
    """Rows of one set for `PairedSamples`, of columns by the names of `FIGURES`."""
    narrow = {name: narrowed(columns[name]) if name != "rejected" else columns[name] for name in FIGURES}
    rows = np.empty(len(narrow["rejected"]), np.dtype([(name, values.dtype) for name, values in narrow.items()]))
    for name, values in narrow.items():
        rows[name] = values
    return rows


def narrowed(values: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Values in single precision where that is what they are, as of all figures of a replay."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    return single if np.array_equal(single, values, equal_nan=True) else values


def paired_samples(
    records: Sequence[ReplayedSet],
    key: SourceAxis,
    present: str,
    window: ScoringWindow,
    spool: SampleSpool | None = None,
    settings: ScoringSettings | None = None,
) -> PairedSamples | None:
    """Samples of one source and axis at the present set's measurements inside the window.

    Where the present set does not fuse the source, the first one that does stands for it, so that there are figures.

    Parameters
    ----------
    spool : takes the samples; by default they stay in memory
    settings : by how much a set that lacks measurements is left out

    Returns
    -------
    PairedSamples of the sets that fuse this source at least once, the present one first where it does, or None where
    there are none. Rows count from the time at which the present set has fused the source once: before the local
    origin exists innovations mean nothing. What the others lack, and what follows their own resets, counts as
    `fusetune.analyze.scoring.charges` says.
    """
    source, axis = key
    most = (settings or ScoringSettings()).max_lacking_percent
    using = sorted((one for one in records if key in one.first_fused), key=lambda record: record.name != present)
    if not using:
        return None
    time, mask, tolerance = _mask(using[0], key, window)
    if not mask.any():
        return None
    time = time[mask]
    costs = {record.name: EvidenceCost(time.size, time.size, 0) for record in records}
    kept: list[_Matched] = []
    for record in using:
        one = _matched(record, key, time, tolerance, window, is_reference=record is using[0])
        costs[record.name] = one.cost
        if one.cost.lacking_percent <= most:
            kept.append(one)
    rows: list[np.ndarray] | SpooledRows = [] if spool is None else SpooledRows(spool)
    whole = [one for one in kept if one.is_complete]
    for one in whole:
        rows.append(paired_rows(_figures(one, key)))
    found = PairedSamples(source, axis, _names(whole), time, rows, costs=costs)
    others = [one for one in kept if not one.is_complete]
    if not others:
        return found
    # What counts for the others follows from the complete sets, of which the first is the reference.
    reference, limit = rows[0]["innovation"].astype(np.float64), found.winsor_limit
    for one in others:
        rows.append(paired_rows(_charged_figures(one, key, reference, limit)))
    places = [[*whole, *others].index(one) for one in kept]
    ordered = rows.in_order(places) if isinstance(rows, SpooledRows) else [rows[place] for place in places]
    complete = tuple(one.is_complete for one in kept)
    return PairedSamples(source, axis, _names(kept), time, ordered, complete, costs)


@dataclass(frozen=True, eq=False)
class _Matched(OwnEvidence):
    """Which of a set's samples are those of the mask: row of each."""

    record: ReplayedSet
    row: npt.NDArray[np.int32]


def _names(matched: Sequence[_Matched]) -> tuple[str, ...]:
    return tuple(one.record.name for one in matched)


def _mask(
    record: ReplayedSet, key: SourceAxis, window: ScoringWindow
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_], float]:
    """Times of all measurements of a set, which of them are scored, and how near to one its like must be, µs."""
    samples = record.samples[key]
    time = measurement_time(samples, key[0], record.parameters)
    if time.size < 2:
        return time, np.zeros(time.shape, bool), 0.0
    scored = window.contains(time) & _is_usable(samples) & (time >= time[np.argmax(samples.fused)])
    return time, scored, _TOLERANCE * float(np.median(np.diff(time)))


def _is_usable(samples: AxisSamples) -> npt.NDArray[np.bool_]:
    variance = samples.innovation_variance
    return np.isfinite(samples.innovation) & np.isfinite(variance) & (variance > 0.0)


def _matched(
    record: ReplayedSet,
    key: SourceAxis,
    scored: npt.NDArray[np.int64],
    tolerance: float,
    window: ScoringWindow,
    *,
    is_reference: bool,
) -> _Matched:
    samples = record.samples[key]
    time = measurement_time(samples, key[0], record.parameters)
    row = match(scored, time, tolerance)
    lacking = (row < 0) | ~_is_usable(samples)[row] | (scored < time[np.argmax(samples.fused)])
    resets = record.name in window.own_resets and not is_reference
    after_reset = window.after_own_reset(record.name, scored) & ~lacking & resets
    return _Matched(lacking, after_reset, resets, record, row.astype(np.int32))


def _figures(matched: _Matched, key: SourceAxis) -> dict[str, npt.NDArray]:
    samples = matched.record.samples[key].rows(np.maximum(matched.row, 0))
    return {name: getattr(samples, name) for name in FIGURES}


def _charged_figures(
    matched: _Matched, key: SourceAxis, reference: npt.NDArray[np.float64], limit: float
) -> dict[str, npt.NDArray]:
    """The figures as they count; a measurement that is lacking, other than one passed over, counts as rejected."""
    figures = _figures(matched, key)
    lacking, after_reset = matched.lacking, matched.after_reset
    own = figures["innovation"]
    alone = passed_over(lacking)
    counted = charged(own, figures["innovation_variance"], reference, lacking, after_reset, limit, alone)
    gate = gate_of(matched.record.parameters, key[0])
    ratio = np.square(counted.error) / (gate * gate * counted.variance)
    ratio = np.where(after_reset, np.fmax(ratio, figures["test_ratio"]), ratio)
    absent = lacking & ~alone
    unchanged = ~lacking & ~after_reset
    return {
        # In single precision, so that the column can be kept so.
        "innovation": np.where(unchanged, own, counted.error.astype(np.float32)),
        "innovation_variance": counted.variance,
        "test_ratio": np.where(absent, np.nan, np.where(unchanged, figures["test_ratio"], ratio.astype(np.float32))),
        "rejected": np.where(lacking, absent, figures["rejected"]),
    }
