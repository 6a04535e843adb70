"""One flight replayed by the estimators of several releases, and what they did differently.

All are given the same samples, those that the release that flew took, and the parameters that an update of the vehicle
to each would leave (`fusetune.px4.parameters.updated_parameters`). They are compared in the air, from ten seconds after
the first of them fused an aid, with the release that flew, or the nearest to it that is modelled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Cut, Interval, duration, inside, subtract
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.filter_events import FilterEvents, filter_events
from fusetune.analyze.trust.onboard_fidelity import warm_from
from fusetune.ekf2.releases.behaviours import MODELLED
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.px4.parameters.updated_parameters import after_update, changed_by_update
from fusetune.px4.releases import AUTO, number_of_name

SAME_SAMPLE_US = 6_000
"""By how much the times differ at which releases take one sample; they average their intervals differently at first."""

_GRID_US = 100_000
"""How finely flags are compared."""


@dataclass(frozen=True)
class ReleaseAxis:
    """One axis of an aid source in one release.

    Attributes
    ----------
    samples : in the part that is compared
    rms : of the innovations, in the unit of the source
    rejected, fused : shares of the samples
    rms_change : of the RMS against the release compared with, 0.1 is 10 % larger; None of that release itself
    difference : RMS of the difference of the innovations over their RMS, of samples that both have; likewise
    """

    source: str
    axis: int
    samples: int
    rms: float
    rejected: float
    fused: float
    rms_change: float | None
    difference: float | None


@dataclass(frozen=True)
class ReleaseFlag:
    """A flag of the filter: share of the time that it is set, and that it is as in the release compared with."""

    flag: str
    set: float
    equal: float


@dataclass(frozen=True)
class ReleaseReplay:
    """What the estimator of one release did.

    Attributes
    ----------
    status, reason : of the replay, "ok" where it ran to its end
    parameters : that the update changes or brings → the value that flew (None: there was none) and the new one
    axes : by source and axis
    rejected : samples rejected in all, of the sources that are not formed at every update
    flags : that are ever set in this release or the one compared with
    events : resets, lost sources, faults
    """

    release: str
    status: str
    reason: str
    parameters: Mapping[str, tuple[float | None, float]]
    axes: tuple[ReleaseAxis, ...]
    rejected: int
    flags: tuple[ReleaseFlag, ...]
    events: FilterEvents

    def axis(self, source: str, axis: int) -> ReleaseAxis | None:
        """One axis; None where the release had no samples of it."""
        return next((one for one in self.axes if (one.source, one.axis) == (source, axis)), None)


@dataclass(frozen=True)
class ReleaseComparison:
    """A flight as several releases' estimators see it.

    Attributes
    ----------
    flown, evidence : the release that flew, and by what that is known
    base : the release that the others are compared with
    compared_s : length of the part of the flight that is compared
    replays : one per release, in the order asked for
    """

    flight: str
    flown: str
    evidence: str
    base: str
    compared_s: float
    replays: tuple[ReleaseReplay, ...]

    @property
    def keys(self) -> tuple[SourceAxis, ...]:
        """Sources and axes of which any release had samples."""
        return tuple(dict.fromkeys((one.source, one.axis) for replay in self.replays for one in replay.axes))


def compare_releases(
    prepared: PreparedFlight,
    releases: Sequence[str] = MODELLED,
    *,
    keep_parameters: bool = False,
    tell: Callable[[str], None] = lambda release: None,
) -> ReleaseComparison:
    """Replay a flight by the estimators of several releases.

    Parameters
    ----------
    releases : names of modelled releases; the one compared with is added where it is not among them
    keep_parameters : all parameters stay as they flew; without it those at their default follow the new one
    tell : is called with the name of each release before it is replayed

    Raises
    ------
    UserError
        A release is not modelled.
    """
    base = prepared.as_replayed_by(AUTO)
    names = list(dict.fromkeys((base.release, *releases)))
    history, flown = prepared.flight.parameters, base.replayed.flown.release
    records, changed = {}, {}
    for name in names:
        own = prepared.as_replayed_by(name)
        tell(name)
        release = number_of_name(name)
        overrides = {} if keep_parameters or name == base.release else after_update(history, flown, release)
        records[name] = replay_set(own, name, overrides)
        changed[name] = changed_by_update(history, flown, release, overrides)
    first = records[base.release]
    intervals = _compared(base, first)
    replays = tuple(
        release_replay(name, records[name], None if name == base.release else first, changed[name], intervals)
        for name in (releases if base.release in releases else names)
    )
    return ReleaseComparison(
        prepared.flight.name,
        base.replayed.flown.name,
        base.replayed.flown.evidence,
        base.release,
        duration(intervals) * 1e-6,
        replays,
    )


def _compared(prepared: PreparedFlight, record: ReplayedSet) -> tuple[Interval, ...]:
    airborne = airborne_intervals(prepared.flight, record.flags)
    return subtract(airborne, [Cut(-(2**62), warm_from(record.samples), "warm-up")])


def release_replay(
    name: str,
    record: ReplayedSet,
    first: ReplayedSet | None,
    parameters: Mapping[str, tuple[float | None, float]],
    intervals: tuple[Interval, ...],
) -> ReleaseReplay:
    """What one release did on a flight, against another.

    Parameters
    ----------
    name : of the release
    record, first : its replay, and that of the release that it is compared with; None for that one itself
    parameters : as in `ReleaseReplay`
    intervals : parts of the flight that are compared, µs
    """
    axes, rejected = [], 0
    for key in record.samples:
        if key[0] not in MEASURED_SOURCES:
            continue
        samples = _in(record.samples[key], intervals)
        if samples.innovation.size:
            other = None if first is None or key not in first.samples else _in(first.samples[key], intervals)
            axes.append(_axis(key, samples, other))
            rejected += 0 if MEASURED_SOURCES[key[0]].every_update else int(samples.rejected.sum())
    return ReleaseReplay(
        release=name,
        status=record.status,
        reason=str(record.summary.get("reason", "")),
        parameters=parameters,
        axes=tuple(axes),
        rejected=rejected,
        flags=_flags(record, record if first is None else first, intervals),
        events=filter_events(record, intervals),
    )


def _in(samples: AxisSamples, intervals: tuple[Interval, ...]) -> AxisSamples:
    # of a source that is formed but has no variance, as a field strength beside a fused heading, nothing is predicted
    counted = inside(samples.timestamp_sample, intervals) & (samples.innovation_variance > 0.0)
    return samples.rows(counted & np.isfinite(samples.innovation))


def _axis(key: SourceAxis, samples: AxisSamples, other: AxisSamples | None) -> ReleaseAxis:
    rms = _rms(samples.innovation)
    change = difference = None
    if other is not None and other.innovation.size:
        before = _rms(other.innovation)
        change = rms / before - 1.0 if before > 0.0 else None
        ours, theirs = _same_samples(samples.timestamp_sample, other.timestamp_sample)
        if before > 0.0 and ours.size:
            difference = _rms(samples.innovation[ours] - other.innovation[theirs]) / _rms(other.innovation[theirs])
    rejected, fused = float(np.mean(samples.rejected)), float(np.mean(samples.fused))
    return ReleaseAxis(*key, samples.innovation.size, rms, rejected, fused, change, difference)


def _rms(values: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _same_samples(
    ours: npt.NDArray[np.int64], theirs: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows of two releases that are of one sample: of each of ours the nearest of theirs, where that is near enough."""
    after = np.clip(np.searchsorted(theirs, ours), 1, max(theirs.size - 1, 1))
    before = after - 1
    after = np.minimum(after, theirs.size - 1)
    nearest = np.where(np.abs(theirs[after] - ours) < np.abs(theirs[before] - ours), after, before)
    near = np.flatnonzero(np.abs(theirs[nearest] - ours) <= SAME_SAMPLE_US)
    return near, nearest[near]


def _flags(record: ReplayedSet, first: ReplayedSet, intervals: tuple[Interval, ...]) -> tuple[ReleaseFlag, ...]:
    grid = np.concatenate([np.zeros(0, np.int64), *(np.arange(*one, _GRID_US) for one in intervals)])
    found = []
    for name in record.flags:
        if not name.startswith("cs_") or name not in first.flags or not grid.size:
            continue
        ours, theirs = _held(record, name, grid), _held(first, name, grid)
        if ours.any() or theirs.any():
            found.append(ReleaseFlag(name, float(ours.mean()), float(np.mean(ours == theirs))))
    return tuple(found)


def _held(record: ReplayedSet, name: str, grid: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """A flag at some times; rows stand at its changes, and before the first one it is not set."""
    rows = np.searchsorted(record.flags["timestamp"].astype(np.int64), grid, side="right") - 1
    values = record.flags[name].astype(np.bool_)
    return np.where(rows >= 0, values[np.maximum(rows, 0)], False) if values.size else np.zeros(grid.size, np.bool_)
