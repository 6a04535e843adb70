"""Brings the samples of all parameter sets to the same measurements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.likelihood import winsor_limit
from fusetune.analyze.metrics.metric import Innovations
from fusetune.analyze.replaying.measurement_times import match, measurement_time
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import SampleSpool, SourceAxis, SpooledRows
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
    """Samples of one source and axis that all named sets have in common; calculate with what `each` gives.

    `rows` holds the samples of each set, (N,) with the `FIGURES`, in single precision where that is exact, and may read
    them from the disk.
    """

    source: str
    axis: int
    sets: tuple[str, ...]
    time: npt.NDArray[np.int64]
    rows: Sequence[np.ndarray]

    def each(self) -> Iterator[SamplesOfSet]:
        """The samples of one set after the other, in double precision."""
        for name, rows in zip(self.sets, self.rows, strict=True):
            innovation, variance, ratio = (rows[figure].astype(np.float64)[None] for figure in FIGURES[:3])
            rejected = rows["rejected"][None]
            yield SamplesOfSet(self.source, self.axis, (name,), self.time, innovation, variance, ratio, rejected)

    @cached_property
    def winsor_limit(self) -> float:
        """See `fusetune.analyze.metrics.likelihood.winsor_limit`."""
        together = np.empty((len(self.sets), self.time.size))
        for number, rows in enumerate(self.rows):
            together[number] = rows["innovation"]
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
) -> PairedSamples | None:
    """Common samples of one source and axis inside the window.

    Parameters
    ----------
    spool : takes the samples; by default they stay in memory

    Returns
    -------
    PairedSamples of the sets that fuse this source at least once (the present set's, where it does, is the
    reference), or None where there are none. Rows count from the time at which every set has fused the source
    once: before the local origin exists innovations mean nothing.
    """
    source, axis = key
    using = sorted((one for one in records if key in one.first_fused), key=lambda record: record.name != present)
    if not using:
        return None
    reference = measurement_time(using[0].samples[key], source, using[0].parameters)
    if reference.size < 2:
        return None
    tolerance = _TOLERANCE * float(np.median(np.diff(reference)))
    common = window.contains(reference)
    index = []
    for record in using:
        one = record.samples[key]
        time = measurement_time(one, source, record.parameters)
        row = match(reference, time, tolerance)
        usable = np.isfinite(one.innovation) & np.isfinite(one.innovation_variance) & (one.innovation_variance > 0.0)
        common &= (row >= 0) & usable[row] & (reference >= time[np.argmax(one.fused)])
        index.append(row.astype(np.int32))
    if not common.any():
        return None
    kept: list[np.ndarray] | SpooledRows = [] if spool is None else SpooledRows(spool)
    for record, rows in zip(using, index, strict=True):
        one = record.samples[key].rows(rows[common])
        kept.append(paired_rows({name: getattr(one, name) for name in FIGURES}))
    return PairedSamples(source, axis, tuple(record.name for record in using), reference[common], kept)
