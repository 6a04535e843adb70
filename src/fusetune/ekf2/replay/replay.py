"""Replay one flight through the estimator with one parameter set.

The compiled loop does at every update of the filter what PX4's EKF2 module does in the runs that lead to it: take the
IMU samples, the messages that have arrived, the system flags; update the filter; publish. It works through the flight
in stretches, so that what is recorded of one can be written before the next.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields

import numpy as np

from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.feed.inputs import EstimatorInputs
from fusetune.ekf2.filter.common.parameters import PARAMETER_NAMES, parameter_record, parameters_beside
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.ekf2.releases.modelled import demand_modelled
from fusetune.ekf2.replay.course import Course
from fusetune.ekf2.replay.gaps_ahead import GapsAhead
from fusetune.ekf2.replay.handover import handover_runs, without_resets_at
from fusetune.ekf2.replay.kept_rows import KeptRows
from fusetune.ekf2.replay.recording import (
    FLAG_COLUMNS,
    FULL,
    LOCAL_POSITION_ROW,
    RecordArrays,
    Recording,
)
from fusetune.ekf2.replay.results import Gap, GapResult, ReplayResult, ReplaySummary
from fusetune.ekf2.replay.warm_start import without_first_resets
from fusetune.px4.layouts.logged_state import Handover, LoggedState


def replay(
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    *,
    overridden: frozenset[str] | None = None,
    gaps: Sequence[Gap] = (),
    start: LoggedState | None = None,
    handovers: Sequence[Handover] = (),
    recording: Recording = FULL,
    release: str = BASELINE,
    keep: Callable[[RecordArrays], RecordArrays] | None = None,
) -> ReplayResult:
    """Run the estimator over one flight and keep what it published.

    Parameters
    ----------
    keep : callable, optional
        What is kept of the rows of each stretch of the flight, fewer rows or fewer fields of them; by default all.

    All others are those of `replay_into`.

    Returns
    -------
    ReplayResult
        The same inputs and parameters give the same bytes.
    """
    kept = KeptRows(keep)
    summary = replay_into(
        kept.take,
        inputs,
        parameters,
        overridden=overridden,
        gaps=gaps,
        start=start,
        handovers=handovers,
        recording=recording,
        release=release,
    )
    return result_of(summary, kept.rows())


def result_of(summary: ReplaySummary, rows: RecordArrays) -> ReplayResult:
    """A replay and the rows that were kept of it."""
    told = {field.name: getattr(summary, field.name) for field in fields(ReplaySummary)}
    return ReplayResult(**told, **rows._asdict())


def replay_into(
    take: Callable[[RecordArrays], None],
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    *,
    overridden: frozenset[str] | None = None,
    gaps: Sequence[Gap] = (),
    start: LoggedState | None = None,
    handovers: Sequence[Handover] = (),
    recording: Recording = FULL,
    release: str = BASELINE,
) -> ReplaySummary:
    """Run the estimator over one flight and hand on what it publishes, a stretch of the flight at a time.

    Parameters
    ----------
    take : callable
        Is given the rows of each stretch, in order.
    inputs : EstimatorInputs
        From `fusetune.ekf2.feed.inputs.build_inputs`.
    parameters : mapping
        A complete set, from `fusetune.ekf2.filter.common.parameters.complete`.
    overridden : frozenset of str, optional
        Parameters that the set varies: changes that the log records for them in flight are not applied.
    gaps : sequence of Gap
        Gaps that the replay is continued into beside its normal course. Each starts from the state that the filter
        has at that moment and ends without a trace, so gaps may overlap and cost nothing but their own length.
    start : LoggedState, optional
        State of the vehicle's own estimator that the filter starts from. Nothing is recorded before. Without it, or
        where the samples end before that time, the filter starts from nothing, as when the vehicle boots.
    handovers : sequence of Handover
        Another estimator instance became primary: the filter takes over what that knew of its sensors.
    recording : Recording
        How much of the rows is handed on; what is, has the same figures either way.
    release : str
        Whose estimator is replayed, one of `fusetune.ekf2.releases.behaviours.MODELLED`.

    Raises
    ------
    UserError
        The release is not modelled.
    """
    course, first_run, warm_start_us = begin_course(
        inputs, parameters, overridden, start, handovers, recording, release
    )
    tally, runs, ahead = _Tally(), len(inputs.arrays.imu), GapsAhead(course, gaps, first_run)
    for begin, end in course.stretches(first_run, runs, ahead.cuts):
        ahead.go_apart(begin)
        numbers, planned = ahead.within(begin, end)
        rows, found = course.run(begin, end, is_last=end == runs, gaps=planned)
        ahead.take(numbers, found)
        tally.add(rows)
        take(rows)
    return tally.summary(course, first_run, warm_start_us, ahead.results())


def begin_course(
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    overridden: frozenset[str] | None = None,
    start: LoggedState | None = None,
    handovers: Sequence[Handover] = (),
    recording: Recording = FULL,
    release: str = BASELINE,
) -> tuple[Course, int, int | None]:
    """Set the estimator on its way; arguments as for `replay`.

    Returns
    -------
    The course, the run to go on with, and the horizon at which `start` was taken over (None: it was not).
    """
    demand_modelled(release)
    ensure_compiled(release)
    known = {*PARAMETER_NAMES, *parameters_beside(release)}
    changes = [
        (run, change)
        for run, change in inputs.parameter_changes
        if change.name in known and change.name not in (overridden or frozenset())
    ]
    inputs = _without_resets(inputs, start, tuple(handovers))
    record = parameter_record(parameters, release)
    runs = handover_runs(inputs, float(record["EKF2_DELAY_MAX"][0]), handovers)
    course = Course(inputs, record, changes, runs, recording, release)
    first_run, warm_start_us = course.start_from(start) if start is not None else (0, None)
    return course, first_run, warm_start_us


def _without_resets(
    inputs: EstimatorInputs, start: LoggedState | None, handovers: tuple[Handover, ...]
) -> EstimatorInputs:
    """The inputs without the resets that neither a start from a given state nor a handover is; the sets share them."""
    if start is None and not handovers:
        return inputs

    def make() -> EstimatorInputs:
        begun = inputs if start is None else without_first_resets(inputs, start.time_us)
        return without_resets_at(begun, handovers)

    key = ("without resets", start and start.time_us, tuple(one.time_us for one in handovers))
    return inputs.memo.get(key, make)


class _Tally:
    """What is told of all rows, counted as they come."""

    def __init__(self) -> None:
        self._faults = 0
        self._resets = {name: 0 for name in LOCAL_POSITION_ROW.names or () if name.endswith("_reset_counter")}

    def add(self, rows: RecordArrays) -> None:
        position = rows.local_position
        faults = [i for i, name in enumerate(FLAG_COLUMNS) if name.startswith("fs_")]
        bits = rows.flags["flags"][:, faults].astype(np.int64) << np.arange(len(faults))
        self._faults = max(self._faults, int(bits.sum(axis=1).max(initial=0)))
        if len(position):
            self._resets = {name: int(position[name][-1]) for name in self._resets}

    def summary(
        self, course: Course, first_run: int, warm_start_us: int | None, gaps: tuple[GapResult, ...]
    ) -> ReplaySummary:
        return ReplaySummary(
            mode=course.inputs.mode,
            imu_samples=len(course.inputs.arrays.imu),
            updates=int(course.recorder["updates"][0]),
            update_interval_us=course.schedule.update_interval_us(first_run),
            origin=_origin(course.ekf["origin"][0]),
            resets=self._resets,
            filter_fault_flags_max=self._faults,
            diverged=bool(course.recorder["diverged"][0]),
            gaps=gaps,
            warm_start_us=warm_start_us,
            levelled=bool(course.ekf["filter_initialised"][0]),
        )


def _origin(origin: np.void) -> tuple[float, float, float] | None:
    if not origin["valid"]:
        return None
    return float(np.rad2deg(origin["lat_rad"])), float(np.rad2deg(origin["lon_rad"])), float(origin["alt"])
