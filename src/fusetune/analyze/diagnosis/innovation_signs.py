"""Test ratios by source: how bad innovations are, whoever computed them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.px4.flight import Flight

FEWEST = 15
HALF, GATE = 0.5, 1.0
LARGEST = 10.0
"""A ratio beyond counts as this much: how far a source is off when it is off says little."""


@dataclass(frozen=True)
class SourceRatios:
    """Test ratios of one source in the air, the worst axis of each sample.

    Attributes
    ----------
    above_half, above_gate : shares of the samples
    mean : of the ratios, each at most `LARGEST`
    worst : largest
    excess : mean of what is beyond a half, each ratio at most `LARGEST`
    off : from the first to the last sample beyond the gate, µs
    """

    origin: Literal["vehicle", "replay"]
    samples: int
    above_half: float
    above_gate: float
    mean: float
    worst: float
    excess: float
    off: Interval | None


def replayed_ratios(record: ReplayedSet, intervals: tuple[Interval, ...]) -> dict[str, SourceRatios]:
    """Of the sources that a replay fused or tried to."""
    found = {}
    for name, source in MEASURED_SOURCES.items():
        if source.every_update:
            continue
        axes = [record.samples[name, axis] for axis in range(source.axes) if (name, axis) in record.samples]
        if len(axes) != source.axes or len({one.timestamp_sample.size for one in axes}) != 1:
            continue
        first = record.first_fused.get((name, 0))
        if first is None:
            continue
        time = axes[0].timestamp_sample
        ratio = np.max([one.test_ratio for one in axes], axis=0)
        one = ratios_of(time, ratio, intervals, first, "replay")
        if one is not None:
            found[name] = one
    return found


def flown_ratios(flight: Flight, intervals: tuple[Interval, ...]) -> dict[str, SourceRatios]:
    """Of the sources whose innovations the vehicle logged; the flight is canonical."""
    found = {}
    for name, source in MEASURED_SOURCES.items():
        table = flight.topic(source.topic)
        if table is None or source.every_update:
            continue
        columns = [
            c
            for c in ([f"test_ratio[{axis}]" for axis in range(source.axes)] if source.axes > 1 else ["test_ratio"])
            if c in table
        ]
        if not columns:
            continue
        ratio = np.max([table[column].astype(np.float64) for column in columns], axis=0)
        time = table.get("timestamp_sample", table["timestamp"]).astype(np.int64)
        one = ratios_of(time, ratio, intervals, 0, "vehicle")
        if one is not None:
            found[name] = one
    return found


def ratios_of(
    time: np.ndarray,
    ratio: np.ndarray,
    intervals: tuple[Interval, ...],
    first: int,
    origin: Literal["vehicle", "replay"],
) -> SourceRatios | None:
    """Figures of some samples; None with too few of them."""
    rows = inside(time, intervals) & np.isfinite(ratio) & (time >= first)
    if np.count_nonzero(rows) < FEWEST:
        return None
    time, ratio = time[rows], np.abs(ratio[rows])
    cut = np.minimum(ratio, LARGEST)
    beyond = np.flatnonzero(ratio > GATE)
    return SourceRatios(
        origin=origin,
        samples=time.size,
        above_half=float(np.mean(ratio > HALF)),
        above_gate=float(np.mean(ratio > GATE)),
        mean=float(cut.mean()),
        worst=float(ratio.max()),
        excess=float(np.maximum(cut - HALF, 0.0).mean()),
        off=(int(time[beyond[0]]), int(time[beyond[-1]]) + 1) if beyond.size else None,
    )


def excess(ratios: Mapping[str, SourceRatios], *starts: str) -> float:
    """Excess of the sources whose names begin so, summed."""
    return sum(one.excess for name, one in ratios.items() if name.startswith(starts))
