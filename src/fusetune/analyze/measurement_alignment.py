"""Brings the samples of all parameter sets to the same measurements.

The estimator stamps a sample with the time of the measurement less the source's delay parameter, so a set with
another delay stamps the same measurement otherwise. Adding the delay back gives a time that names the measurement.
"""

from collections.abc import Sequence
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
    samples must not profit from it.
    """

    source: str
    axis: int
    sets: tuple[str, ...]
    time: npt.NDArray[np.int64]
    observation_variance: npt.NDArray[np.float64]
    innovation: npt.NDArray[np.float64]
    innovation_variance: npt.NDArray[np.float64]
    test_ratio: npt.NDArray[np.float64]
    rejected: npt.NDArray[np.bool_]


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
    using = [record for record in records if key in record.samples and record.samples[key].fused.any()]
    if not using:
        return None
    using.sort(key=lambda record: record.name != present)
    samples = [record.samples[key] for record in using]
    times = [measurement_time(s, source, r.parameters) for s, r in zip(samples, using, strict=True)]
    reference = times[0]
    if reference.size < 2:
        return None
    tolerance = _TOLERANCE * float(np.median(np.diff(reference)))
    index = np.stack([match(reference, time, tolerance) for time in times])
    started = max(int(time[np.argmax(s.fused)]) for time, s in zip(times, samples, strict=True))
    common = window.contains(reference) & (reference >= started) & (index >= 0).all(axis=0)
    for row, one in zip(index, samples, strict=True):
        usable = np.isfinite(one.innovation) & np.isfinite(one.innovation_variance) & (one.innovation_variance > 0.0)
        common &= usable[row]
    if not common.any():
        return None
    index = index[:, common]

    def stacked(field: str) -> npt.NDArray:
        return np.stack([getattr(one, field)[row] for one, row in zip(samples, index, strict=True)])

    return PairedSamples(
        source=source,
        axis=axis,
        sets=tuple(record.name for record in using),
        time=reference[common],
        observation_variance=stacked("observation_variance"),
        innovation=stacked("innovation"),
        innovation_variance=stacked("innovation_variance"),
        test_ratio=stacked("test_ratio"),
        rejected=stacked("rejected"),
    )
