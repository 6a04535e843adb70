"""Brings the samples of all parameter sets to the same measurements.

The estimator stamps a sample with the time of the measurement less the source's delay parameter, so a set with
another delay stamps the same measurement otherwise. Adding the delay back gives a time that names the measurement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.scoring_window import ScoringWindow
from fusetune.analyze.set_files import AxisSamples, SetRecord, SourceAxis
from fusetune.analyze.sources import AID_SOURCES

_TOLERANCE = 0.4
"""Two samples are one measurement when they are nearer than this share of the median spacing."""


@dataclass(frozen=True)
class PairedSamples:
    """Samples of one source and axis that all named sets have in common; arrays (S, N), the sets first.

    `time` (N,) is the time of the measurement, µs. Rejected samples are among them: a set that rejects its worst
    samples must not profit from it. Figures that are exact in single precision, as all of a replay are, are held so:
    calculate with what `each` gives, which is one set at a time and in double precision.
    """

    source: str
    axis: int
    sets: tuple[str, ...]
    time: npt.NDArray[np.int64]
    observation_variance: npt.NDArray[np.floating]
    innovation: npt.NDArray[np.floating]
    innovation_variance: npt.NDArray[np.floating]
    test_ratio: npt.NDArray[np.floating]
    rejected: npt.NDArray[np.bool_]

    def each(self) -> Iterator[SamplesOfSet]:
        """The same of each set alone."""
        for number, name in enumerate(self.sets):
            rows = slice(number, number + 1)
            figures = {figure: getattr(self, figure)[rows].astype(np.float64) for figure in _FIGURES}
            yield SamplesOfSet(self.source, self.axis, (name,), self.time, rejected=self.rejected[rows], **figures)


@dataclass(frozen=True)
class SamplesOfSet(PairedSamples):
    """Paired samples of one set, arrays (1, N), in double precision."""

    observation_variance: npt.NDArray[np.float64]
    innovation: npt.NDArray[np.float64]
    innovation_variance: npt.NDArray[np.float64]
    test_ratio: npt.NDArray[np.float64]


_FIGURES = ("observation_variance", "innovation", "innovation_variance", "test_ratio")


def each_of(members: Sequence[PairedSamples]) -> Iterator[list[SamplesOfSet]]:
    """Several axes that share their sets, of one set at a time."""
    return (list(one) for one in zip(*(member.each() for member in members), strict=True))


def narrowed(values: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Values in single precision where that is what they are."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    return single if np.array_equal(single, values, equal_nan=True) else values


def measurement_time(samples: AxisSamples, source: str, parameters: dict[str, float]) -> npt.NDArray[np.int64]:
    """Time of each measurement, µs: the estimator's sample time plus the source's delay."""
    name = AID_SOURCES[source].delay_parameter
    delay_ms = parameters.get(name, 0.0) if name is not None else 0.0
    return samples.timestamp_sample + round(delay_ms * 1e3)


def match(reference: npt.NDArray[np.int64], time: npt.NDArray[np.int64], tolerance_us: float) -> npt.NDArray[np.int64]:
    """Index into `time` of the sample nearest to each of `reference`, or −1 where none is within the tolerance.

    Both ascending; (N,) and (M,), µs.
    """
    if time.size == 0:
        return np.full(reference.shape, -1, dtype=np.int64)
    right = np.clip(np.searchsorted(time, reference), 0, time.size - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(time[left] - reference) <= np.abs(time[right] - reference), left, right)
    return np.where(np.abs(time[nearest] - reference) <= tolerance_us, nearest, -1)


def paired_samples(
    records: Sequence[SetRecord], key: SourceAxis, present: str, window: ScoringWindow
) -> PairedSamples | None:
    """Common samples of one source and axis inside the window.

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
    reference = _times_of(using[0], key)
    if reference.size < 2:
        return None
    tolerance = _TOLERANCE * float(np.median(np.diff(reference)))
    common = window.contains(reference)
    index = []
    for record in using:
        time, one = _times_of(record, key), record.samples[key]
        row = match(reference, time, tolerance)
        usable = np.isfinite(one.innovation) & np.isfinite(one.innovation_variance) & (one.innovation_variance > 0.0)
        common &= (row >= 0) & usable[row] & (reference >= time[np.argmax(one.fused)])
        index.append(row.astype(np.int32))
    if not common.any():
        return None
    kept: dict[str, list[npt.NDArray]] = {name: [] for name in (*_FIGURES, "rejected")}
    for record, rows in zip(using, index, strict=True):
        one = record.samples[key]
        for name, parts in kept.items():
            values = getattr(one, name)[rows[common]]
            parts.append(values if name == "rejected" else narrowed(values))
    stacked = {name: np.stack(parts) for name, parts in kept.items()}
    sets = tuple(record.name for record in using)
    return PairedSamples(source=source, axis=axis, sets=sets, time=reference[common], **stacked)


def _times_of(record: SetRecord, key: SourceAxis) -> npt.NDArray[np.int64]:
    return measurement_time(record.samples[key], key[0], record.parameters)
