"""Test ratios of the sets on a flight, over time: the largest of the axes of each aid source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.px4.aid_sources import AID_SOURCES, REPORTED_SOURCES
from fusetune.report.scored_samples import scored_samples
from fusetune.storage.files import AnyPath

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]
Ratios = tuple[Times, Array]
"""Times, µs, and ratios, (N,); NaN where a line is to have a gap."""

SMALLEST_RATIO = 1e-4
"""Smaller ones are drawn as that."""
SOURCES = tuple(source.name for source in REPORTED_SOURCES)


def replayed_ratios(samples: Mapping[SourceAxis, AxisSamples]) -> Iterator[tuple[str, Ratios]]:
    """Source and ratios of all samples of a replay, of each source that was fused, from then on."""
    for source in SOURCES:
        axes = [samples[source, axis] for axis in range(AID_SOURCES[source].axes) if (source, axis) in samples]
        if axes and axes[0].fused.any():
            yield source, _largest([(one.timestamp_sample, one.test_ratio) for one in axes], since=first_fused(axes[0]))


def first_fused(samples: AxisSamples) -> int:
    """Time, µs, of the first sample that was fused, of samples of which one was."""
    return int(samples.timestamp_sample[np.argmax(samples.fused)])


def scored_ratios(
    path: AnyPath, sets: Sequence[str], intervals: Sequence[tuple[int, int]]
) -> dict[str, dict[str, Ratios]]:
    """Set → source → ratios of the samples that are scored.

    Parameters
    ----------
    path : `samples.parquet`
    intervals : first and last time of each part that is scored, µs; the lines have a gap between them
    """
    found: dict[str, dict[str, list[Ratios]]] = {name: {} for name in sets}
    for one in scored_samples(path, ("time_us", "test_ratio")):
        if one.set_name in found:
            time, ratio = one.columns
            found[one.set_name].setdefault(one.source, []).append((time, ratio))
    starts = np.array([start for start, _ in intervals], np.int64)
    return {
        name: {source: _with_gaps(*_largest(parts), starts) for source, parts in by_source.items()}
        for name, by_source in found.items()
    }


def _largest(axes: Sequence[Ratios], since: int = 0) -> Ratios:
    """Of those at one time."""
    times, places = np.unique(np.concatenate([time for time, _ in axes]), return_inverse=True)
    ratios = np.full(times.size, SMALLEST_RATIO)
    with np.errstate(invalid="ignore"):
        np.maximum.at(ratios, places, np.concatenate([ratio for _, ratio in axes]).astype(np.float64))
    return times[times >= since], ratios[times >= since]


def _with_gaps(times: Times, ratios: Array, starts: Times) -> Ratios:
    gaps = np.flatnonzero(np.diff(np.searchsorted(starts, times, side="right"))) + 1
    return np.insert(times, gaps, times[gaps]), np.insert(ratios, gaps, np.nan)
