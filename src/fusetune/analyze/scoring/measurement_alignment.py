"""Brings the samples of a parameter set to the measurements of another one: on a flight, those of the present set.

What is looked for, the mask, follows from that one set alone; so does the limit beyond which errors are clipped. A set
is therefore compared with no other beside it, and has the same figures whichever others there are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.likelihood import winsor_limit
from fusetune.analyze.metrics.metric import FEW_SAMPLES, Innovations
from fusetune.analyze.replaying.measurement_times import match, measurement_time
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis, gate_of
from fusetune.analyze.scoring.charges import EvidenceCost, OwnEvidence, charged, passed_over
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.px4.aid_sources import AID_SOURCES, MEASURED_SOURCES, AidSource

_TOLERANCE = 0.4
"""Two samples are one measurement when they are nearer than this share of the median spacing."""


@dataclass(frozen=True, eq=False)
class SampleMask:
    """The measurements of one source and axis that are scored: those of the set that others are compared with.

    Attributes
    ----------
    time : (N,) µs, of the measurement
    tolerance : how near to one its like must be, µs
    row : (N,) of that set's samples, ascending
    innovation : (N,) that set's
    """

    source: str
    axis: int
    time: npt.NDArray[np.int64]
    tolerance: float
    row: npt.NDArray[np.int32]
    innovation: npt.NDArray[np.float64]

    @cached_property
    def winsor_limit(self) -> float:
        """See `fusetune.analyze.metrics.likelihood.winsor_limit`; of that set alone, as no other has a say."""
        return winsor_limit(self.innovation.copy())


@dataclass(frozen=True, eq=False)
class CountedSamples:
    """Samples of one set at the measurements of a mask, as they count, arrays (N,).

    Rejected samples are among them: a set that rejects its worst samples must not profit from it.
    """

    mask: SampleMask
    innovation: npt.NDArray[np.float64]
    innovation_variance: npt.NDArray[np.float64]
    test_ratio: npt.NDArray[np.float64]
    rejected: npt.NDArray[np.bool_]


FIGURES = ("innovation", "innovation_variance", "test_ratio", "rejected")

Masks = Mapping[SourceAxis, SampleMask]


def sample_masks(record: ReplayedSet, window: ScoringWindow) -> dict[SourceAxis, SampleMask]:
    """The mask of each source and axis that a set fuses at least once and of which it has a measurement in the window.

    Axes that share their times have them in one array.
    """
    found: dict[SourceAxis, SampleMask] = {}
    for source in MEASURED_SOURCES.values():
        found |= source_masks(record, source, window)
    return found


def source_masks(record: ReplayedSet, source: AidSource, window: ScoringWindow) -> dict[SourceAxis, SampleMask]:
    """Those of the axes of one source."""
    found: dict[SourceAxis, SampleMask] = {}
    for axis in range(source.axes):
        mask = sample_mask(record, (source.name, axis), window)
        if mask is not None:
            alike = (one.time for one in found.values() if np.array_equal(one.time, mask.time))
            found[source.name, axis] = replace(mask, time=next(alike, mask.time))
    return found


def sample_mask(record: ReplayedSet, key: SourceAxis, window: ScoringWindow) -> SampleMask | None:
    """The mask of one source and axis; None where the set never fuses it, or nothing of it lies in the window.

    It counts from the time at which the set has fused the source once: before the local origin exists innovations mean
    nothing.
    """
    if key not in record.first_fused:
        return None
    samples = record.samples[key]
    time = measurement_time(samples, key[0], record.parameters)
    if time.size < 2:
        return None
    scored = window.contains(time) & _is_usable(samples) & (time >= time[np.argmax(samples.fused)])
    row = np.flatnonzero(scored).astype(np.int32)
    if not row.size:
        return None
    tolerance = _TOLERANCE * float(np.median(np.diff(time)))
    return SampleMask(*key, time[row], tolerance, row, samples.innovation[row])


class Counted(NamedTuple):
    """What a set cost itself, and its samples as they count; None where it lacks too much to be compared."""

    cost: EvidenceCost
    samples: CountedSamples | None


def counted_samples(
    mask: SampleMask, record: ReplayedSet, window: ScoringWindow, max_lacking_percent: float
) -> Counted:
    """Samples of a set at the measurements of a mask; what it lacks, and what follows its own resets, counts as
    `fusetune.analyze.scoring.charges` says.

    Parameters
    ----------
    window : as the set sees it (`ScoringWindow.of_set`)
    max_lacking_percent : a set that lacks more is left out
    """
    key = mask.source, mask.axis
    if key not in record.first_fused:
        nothing = EvidenceCost(mask.time.size, mask.time.size, 0)
        return Counted(nothing, None)
    samples = record.samples[key]
    evidence = _matched(mask, samples, record, window)
    cost = evidence.cost
    if cost.lacking_percent > max_lacking_percent:
        return Counted(cost, None)
    figures = {name: getattr(samples, name)[np.maximum(evidence.row, 0)] for name in FIGURES}
    if not evidence.is_complete:
        figures = _charged_figures(evidence, figures, mask, gate_of(record.parameters, mask.source))
    return Counted(cost, CountedSamples(mask, **figures))


def own_samples(mask: SampleMask, samples: AxisSamples) -> CountedSamples:
    """The samples of the set that the mask is of."""
    return CountedSamples(mask, **{name: getattr(samples, name)[mask.row] for name in FIGURES})


@dataclass(frozen=True, eq=False)
class _Matched(OwnEvidence):
    """Which of a set's samples are those of the mask: row of each."""

    row: npt.NDArray[np.int64]


def _is_usable(samples: AxisSamples) -> npt.NDArray[np.bool_]:
    variance = samples.innovation_variance
    return np.isfinite(samples.innovation) & np.isfinite(variance) & (variance > 0.0)


def _matched(mask: SampleMask, samples: AxisSamples, record: ReplayedSet, window: ScoringWindow) -> _Matched:
    time = measurement_time(samples, mask.source, record.parameters)
    row = _rows_of(mask, time)
    lacking = (row < 0) | ~_is_usable(samples)[row] | (mask.time < time[np.argmax(samples.fused)])
    after_reset = window.after_own_reset(record.name, mask.time) & ~lacking
    return _Matched(lacking, after_reset, record.name in window.own_resets, row)


def _rows_of(mask: SampleMask, time: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Index into `time`, ascending, of the sample that is each of the mask's measurements; −1 where there is none."""
    # a set with the delays of the one that the mask is of has the same measurements, in the same places
    if mask.row[-1] < time.size and np.array_equal(time[mask.row], mask.time):
        return mask.row.astype(np.int64)
    return match(mask.time, time, mask.tolerance)


def _charged_figures(
    evidence: _Matched, figures: Mapping[str, npt.NDArray], mask: SampleMask, gate: float
) -> dict[str, npt.NDArray]:
    """The figures as they count; a measurement that is lacking, other than one passed over, counts as rejected."""
    lacking, after_reset = evidence.lacking, evidence.after_reset
    own = figures["innovation"]
    alone = passed_over(lacking)
    counted = charged(
        own, figures["innovation_variance"], mask.innovation, lacking, after_reset, mask.winsor_limit, alone
    )
    ratio = np.square(counted.error) / (gate * gate * counted.variance)
    ratio = np.where(after_reset, np.fmax(ratio, figures["test_ratio"]), ratio)
    absent = lacking & ~alone
    unchanged = ~lacking & ~after_reset
    return {
        # In single precision, as all figures of a replay are.
        "innovation": np.where(unchanged, own, _single(counted.error)),
        "innovation_variance": counted.variance,
        "test_ratio": np.where(absent, np.nan, np.where(unchanged, figures["test_ratio"], _single(ratio))),
        "rejected": np.where(lacking, absent, figures["rejected"]),
    }


def _single(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return values.astype(np.float32).astype(np.float64)


@dataclass(frozen=True, eq=False)
class AxesTogether:
    """Axes of one source that share their times, of one set or of several at the same measurements.

    Attributes
    ----------
    samples : of one set after the other, each with the same axes
    confidence : of intervals
    sets : number of sets
    """

    source: str
    samples: tuple[CountedSamples, ...]
    confidence: float = np.nan
    sets: int = 1

    @property
    def masks(self) -> tuple[SampleMask, ...]:
        """Of the axes."""
        return tuple(one.mask for one in self.samples[: len(self.samples) // self.sets])

    @property
    def axes(self) -> list[int]:
        return [mask.axis for mask in self.masks]

    @property
    def time(self) -> npt.NDArray[np.int64]:
        """(N,) µs"""
        return self.samples[0].mask.time

    def samples_of_sets(self) -> list[tuple[CountedSamples, ...]]:
        """Of one set after the other."""
        axes = len(self.masks)
        return [self.samples[first : first + axes] for first in range(0, len(self.samples), axes)]

    @cached_property
    def innovations(self) -> Innovations:
        """Each axis of each set by itself, what metrics are made of, (1, S A, N)."""
        limits = np.array([one.mask.winsor_limit for one in self.samples])[:, None]
        innovation, variance, ratio, rejected = (
            np.stack([getattr(one, name) for one in self.samples])[None] for name in FIGURES
        )
        return Innovations(innovation, variance, ratio, rejected, lambda: [limits], self.confidence)

    def groups(self) -> Iterable[tuple[str, Innovations]]:
        """Groups of axes (horizontal, vertical, all) that are all here, (D, S, N), by name."""
        return self._groups.items() if self.time.size <= FEW_SAMPLES else self._each_group()

    @cached_property
    def _groups(self) -> Mapping[str, Innovations]:
        return dict(self._each_group())

    def _each_group(self) -> Iterator[tuple[str, Innovations]]:
        for name, axes in AID_SOURCES[self.source].groups:
            if {*axes} <= {*self.axes}:
                yield name, self._group(axes)

    def _group(self, axes: Sequence[int]) -> Innovations:
        places = [self.axes.index(axis) for axis in axes]
        limits = [self.samples[place].mask.winsor_limit for place in places]
        return Innovations.of_places(self.innovations, self.sets, places, limits)

    def of_masks(self, masks: Masks) -> AxesTogether | None:
        """Those of the axes whose measurements are those of some masks; None where none are."""
        kept = tuple(one for one in self.samples if masks.get((one.mask.source, one.mask.axis)) is one.mask)
        if not kept:
            return None
        return self if len(kept) == len(self.samples) else replace(self, samples=kept)


def axes_together(samples: Iterable[Counted], confidence: float = np.nan) -> Iterator[AxesTogether]:
    """What there is of one source and the same times together, in the order in which it comes."""
    found: dict[tuple[str, int], list[CountedSamples]] = {}
    for one in samples:
        if one.samples is not None:
            mask = one.samples.mask
            found.setdefault((mask.source, id(mask.time)), []).append(one.samples)
    for (source, _), members in found.items():
        yield AxesTogether(source, tuple(members), confidence)


def sets_together(
    each: Sequence[Iterable[Counted]], confidence: float = np.nan
) -> Iterator[tuple[tuple[int, ...], AxesTogether]]:
    """What several sets have of one source, those at the same measurements together; with the places of the sets.

    What there is of one set comes in the order of `axes_together`.
    """
    alike: dict[tuple[tuple[int, ...], ...], list[tuple[int, list[AxesTogether]]]] = {}
    for place, samples in enumerate(each):
        found = [*axes_together(samples, confidence)]
        alike.setdefault(tuple(tuple(map(id, one.masks)) for one in found), []).append((place, found))
    for members in alike.values():
        places = tuple(place for place, _ in members)
        for together in zip(*(own for _, own in members), strict=True):
            joined = tuple(chain.from_iterable(one.samples for one in together))
            # another one than is kept here: what it makes of its samples goes with it
            yield places, replace(together[0], samples=joined, sets=len(together))
