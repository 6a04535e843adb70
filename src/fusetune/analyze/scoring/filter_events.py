"""What the filter did beside fusing: resets and how far they moved it, faults, lost sources, time spent without aid."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, duration, inside
from fusetune.analyze.metrics.metric import Metric
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.reset_jumps import FAR, JumpFigures, Jumps, jump_figures, reset_jumps, significant
from fusetune.px4.aid_sources import AID_SOURCES

_FLAGS_OF_SOURCES = tuple(
    source.flags for source in AID_SOURCES.values() if source.sensor and source.flags and source.code is not None
)
"""Flags of `estimator_status_flags` of which one says that a source with a sensor is being fused."""


@dataclass(frozen=True)
class SourceAid:
    """How an aid source served: samples, share of them fused, and the longest time without one fused, s."""

    samples: int
    fused_share: float
    longest_without_s: float


@dataclass(frozen=True)
class FilterEvents:
    """Counts and times inside the flight after the warm-up.

    Attributes
    ----------
    flight_s : time over which they are counted, s
    resets : number of resets of each kind
    jumps : how far those of each kind moved the state, of the kinds that there were
    significant_resets : updates at which the state was moved far, see `reset_jumps`
    timeouts : how often a source that was fused stopped being fused
    faults : names of the fault flags (`fs_*`) that were ever set, on the ground and during the warm-up as well
    fault_s : time that each of them was set, s, of those that were
    fault_flags : largest value of `filter_fault_flags`
    dead_reckoning_s : time without any horizontal aiding
    aid : by source that was ever fused
    """

    flight_s: float
    resets: dict[str, int]
    jumps: dict[str, JumpFigures]
    significant_resets: int
    timeouts: dict[str, int]
    faults: tuple[str, ...]
    fault_s: dict[str, float]
    fault_flags: int
    dead_reckoning_s: float
    aid: dict[str, SourceAid]

    @property
    def total_resets(self) -> int:
        return sum(self.resets.values())

    @property
    def total_timeouts(self) -> int:
        return sum(self.timeouts.values())


EVENT_METRICS: tuple[Metric[FilterEvents], ...] = (
    Metric(
        "resets", "1", "how often the state was reset, by kind",
        lambda events: {**events.resets, "all": events.total_resets}, "lower", ("apply", "report"),
    ),
    Metric(
        "significant_resets", "1", f"how often a reset moved the state by more than {FAR}",
        lambda events: {"all": events.significant_resets}, "lower", ("apply",),
    ),
    Metric(
        "timeouts", "1", "how often a source that was fused stopped being fused, by source",
        lambda events: {**{name: n for name, n in events.timeouts.items() if n}, "all": events.total_timeouts},
        "lower", ("apply", "report"),
    ),
    Metric(
        "fault_flags", "1", "largest value of `filter_fault_flags`",
        lambda events: {"all": events.fault_flags}, "lower", ("apply",),
    ),
    Metric(
        "dead_reckoning_s", "s", "time without any horizontal aiding",
        lambda events: {"horizontal": events.dead_reckoning_s}, "lower",
    ),
)  # fmt: skip
"""What the filter did beside fusing, by kind."""

ON_GROUND = tuple(metric for metric in EVENT_METRICS if metric.name in ("resets", "timeouts"))
"""Given for the time on the ground as well, all kinds together."""

SERVICE_METRICS: tuple[Metric[SourceAid], ...] = (
    Metric("fused_share", "1", "share of the samples that was fused", lambda aid: aid.fused_share, "higher"),
    Metric(
        "longest_without_fusion_s", "s", "longest time without a fused one", lambda aid: aid.longest_without_s, "lower"
    ),
)
"""How a source served in flight after the warm-up."""


def filter_events(
    record: ReplayedSet, flight: tuple[Interval, ...], all_jumps: Mapping[str, Jumps] | None = None
) -> FilterEvents:
    """Count the events of one replay.

    Parameters
    ----------
    flight : flight time after the warm-up, µs: before it every filter resets and switches sources
    all_jumps : from `reset_jumps`, where they are known
    """
    all_jumps = reset_jumps(record) if all_jumps is None else all_jumps
    resets = {kind: int(np.count_nonzero(inside(times, flight))) for kind, times in record.reset_times.items()}
    time = record.flags.get("timestamp", np.zeros(0)).astype(np.int64)
    columns = {}
    # The magnetometer changes between heading and three axes by itself; only its end is a loss.
    for flags in sorted(_FLAGS_OF_SOURCES, key=len):
        ways = [record.flags[flag] for flag in flags if flag in record.flags]
        if ways:
            columns[flags[-1]] = np.logical_or.reduce(ways)
    timeouts = {}
    for flag, values in columns.items():
        stopped = time[1:][values[:-1].astype(bool) & ~values[1:].astype(bool)]
        timeouts[flag.removeprefix("cs_")] = int(np.count_nonzero(inside(stopped, flight)))
    faults = tuple(sorted(name for name, values in record.flags.items() if name.startswith("fs_") and values.any()))
    jumps = {kind: found for kind, one in all_jumps.items() if (found := one.inside(flight)).time.size}
    fault_s = {name: _time_true(time, record.flags[name], flight) for name in faults}
    return FilterEvents(
        flight_s=duration(flight) * 1e-6,
        resets=resets,
        jumps={kind: jump_figures(kind, one) for kind, one in jumps.items()},
        significant_resets=significant(jumps),
        timeouts=timeouts,
        faults=faults,
        fault_s={name: seconds for name, seconds in fault_s.items() if seconds > 0.0},
        fault_flags=int(record.summary.get("filter_fault_flags_max", 0)),
        dead_reckoning_s=_time_true(time, record.flags.get("cs_inertial_dead_reckoning"), flight),
        aid=_source_aid(record, flight),
    )


def _source_aid(record: ReplayedSet, intervals: tuple[Interval, ...]) -> dict[str, SourceAid]:
    """Axis 0 speaks for its source: PX4 fuses or rejects all axes of a sample but for rare faults."""
    found = {}
    for source, axis in record.first_fused:
        if axis:
            continue
        samples = record.samples[source, axis]
        time = samples.timestamp_sample
        counted = inside(time, intervals)
        if not counted.any():
            continue
        longest = 0
        for start, stop in intervals:
            fused = time[samples.fused & (time >= start) & (time < stop)]
            longest = max(longest, int(np.max(np.diff(np.r_[start, fused, stop]))))
        found[source] = SourceAid(int(counted.sum()), float(np.mean(samples.fused[counted])), longest * 1e-6)
    return found


def _time_true(
    time: npt.NDArray[np.int64], values: npt.NDArray[np.bool_] | None, intervals: tuple[Interval, ...]
) -> float:
    if values is None or time.size == 0:
        return 0.0
    # The flags are written at each change, so a value holds until the next row.
    stops = np.r_[time[1:], np.iinfo(np.int64).max]
    total = 0
    for start, stop in intervals:
        overlap = np.minimum(stops, stop) - np.maximum(time, start)
        total += int(np.sum(np.where(values, np.maximum(overlap, 0), 0)))
    return total * 1e-6
