"""The estimator on its way through a flight.

It works through the flight in stretches, so that what is recorded of one can be written before the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fusetune.ekf2.feed.inputs import EstimatorInputs
from fusetune.ekf2.filter.common.core_memory import zeros_on_cache_lines
from fusetune.ekf2.filter.common.parameters import taken_value
from fusetune.ekf2.filter.estimator import ekf_record
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.ekf2.replay.flight_schedule import FlightSchedule, flight_schedule, notes_of
from fusetune.ekf2.replay.handover import take_sensor_states
from fusetune.ekf2.replay.loop import GAP_RUN, Estimator, run_estimator
from fusetune.ekf2.replay.recording import (
    FULL,
    IS_FULL,
    IS_GAP,
    IS_SCORING,
    IS_TRACED,
    SCORING,
    TRACED,
    RecordArrays,
    Recording,
    RecordRoom,
    allocate_records,
    copied,
    copied_bytes,
    joined,
    new_recorder,
    views_of,
)
from fusetune.ekf2.replay.warm_start import take_over
from fusetune.ekf2.schedule.taking_actions import SENSOR_NAMES
from fusetune.px4.flight import ParameterChange
from fusetune.px4.layouts.logged_state import LoggedState

RUNS_PER_STRETCH = 8192

_MODES = {FULL: IS_FULL, SCORING: IS_SCORING, TRACED: IS_TRACED}


class PlannedGap(NamedTuple):
    """A gap by the updates of a schedule: the first, that after the last, sensor by number, its aid sources by bits."""

    first_update: int
    last_update: int
    sensor: int
    sources: int


class Course:
    """The estimator on its way through a flight: its memory, its parameters, and its schedule."""

    def __init__(
        self,
        inputs: EstimatorInputs,
        params: np.ndarray,
        changes: Sequence[tuple[int, ParameterChange]],
        handovers: Sequence[tuple[int, LoggedState]] = (),
        recording: Recording = FULL,
        release: str = BASELINE,
    ):
        self.inputs, self.changes, self.handovers, self.release = inputs, changes, handovers, release
        self.notes = notes_of(params[0], changes)
        self.mode = _MODES[recording]
        self._main = _estimator(zeros_on_cache_lines(ekf_record(release)), params, new_recorder(self.mode))
        self._branch = self._main

    @property
    def ekf(self) -> np.ndarray:
        """One record of the estimator's memory."""
        return self._main.ekf

    @property
    def params(self) -> np.ndarray:
        """One record of its parameters."""
        return self._main.params

    @property
    def recorder(self) -> np.ndarray:
        """One record of what the recorder knows."""
        return self._main.recorder

    @cached_property
    def schedule(self) -> FlightSchedule:
        """When the filter updates, with which samples."""
        return flight_schedule(self.inputs, self.params[0], self.changes, release=self.release)

    def start_from(self, state: LoggedState) -> tuple[int, int | None]:
        """Go on to the time of a logged state, so that sensors are known, and take it over.

        Returns
        -------
        The run to go on with and the horizon; (0, None), as if nothing had happened, where the samples end before.
        """
        schedule = flight_schedule(self.inputs, self.params[0], self.changes, state.time_us, self.release)
        run = schedule.started_run
        if run is None:
            return 0, None
        self.schedule = schedule
        for begin, end in self.stretches(0, 1):
            self.advance(begin, end)
        fresh = copied_bytes(self.ekf)
        for begin, end in self.stretches(1, run):
            self.advance(begin, end)
        take_over(self.ekf, fresh, self.params[0], self.inputs, state)
        self.recorder[:] = new_recorder(self.mode)
        return run, int(self.ekf["time_delayed_us"][0])

    def reach(self, run: int, time_us: int) -> int:
        """Go on from a run until the horizon has come to a time or the samples end; the run to go on with."""
        if run and self.ekf["time_delayed_us"][0] >= time_us:
            return run
        at = self.schedule.run_of_horizon(run, time_us)
        stop = len(self.inputs.arrays.imu) if at is None else at + 1
        for begin, end in self.stretches(run, stop):
            self.advance(begin, end)
        return max(run, stop)

    def branch(self) -> Course:
        """Another course that starts where this one is."""
        other = copy(self)
        ekf = zeros_on_cache_lines(self.ekf.dtype)
        ekf.view(np.uint8)[:] = self.ekf.view(np.uint8)
        other._main = other._branch = _estimator(ekf, self.params.copy(), self.recorder.copy())
        return other

    def without_samples(self) -> Course:
        """A branch to which nothing arrives any more, and nothing that has is due."""
        other = self.branch()
        tables = self.schedule.tables
        other.schedule = FlightSchedule(tables._replace(actions=tables.actions[-1:], events=tables.events[-1:]))
        return other

    def gap_apart(self, gap: PlannedGap, start: int, stop: int) -> GapRows:
        """Run through a gap of some runs on a branch, which changes what the log changes; updates are not asked for."""
        other, name = self.branch(), SENSOR_NAMES[gap.sensor]
        other.ekf["sensors"][name]["withheld"] = True
        # in parts, so that the position of the last update is gone when it turns out to be the last
        other.mode = IS_SCORING
        other.recorder[:] = new_recorder(IS_SCORING)
        other.recorder["sources"], other.recorder["last_sample"] = gap.sources, self.recorder["last_sample"]
        start_us = int(other.ekf["time_delayed_us"][0])
        started = bool(other.ekf["filter_initialised"][0])
        parts = [other.run(*stretch, is_last=stretch[1] == stop)[0] for stretch in other.stretches(start, stop)]
        rows = joined(parts)
        return GapRows(start_us, rows.innovations, rows.local_position[: len(rows.local_position) * started])

    def stretches(self, first: int, last: int, cuts: Sequence[int] = ()) -> Iterator[tuple[int, int]]:
        """Split the runs; between the parts, change parameters and take over sensors where the log says so."""
        changed = {min(run, last) for run, _ in (*self.changes, *self.handovers) if run >= first}
        edges = {*range(first, last, RUNS_PER_STRETCH), *changed, *(cut for cut in cuts if first <= cut < last), last}
        for start, stop in pairwise(sorted(edges)):
            for run, change in self.changes:
                if run == start:
                    self.params[change.name] = taken_value(change.name, change.value, self.release)
            for run, state in self.handovers:
                if run == start:
                    take_sensor_states(self.ekf[0], state)
            yield start, stop

    def run(
        self, start: int, stop: int, is_last: bool = False, gaps: Sequence[PlannedGap] = ()
    ) -> tuple[RecordArrays, list[GapRows]]:
        """Process some runs, and the gaps that begin at one of their updates.

        Parameters
        ----------
        is_last : what was kept back for what might follow is recorded, too
        gaps : in order of their first updates

        Returns
        -------
        What was recorded on the way, and what in each gap that the filter had started for
        """
        first, last = self.schedule.updates_until(start), self.schedule.updates_until(stop)
        room = allocate_records(last - first, self.mode)
        found = self._process(start, stop, room, is_last, gaps)
        done = self.recorder[0]
        position = room.local_position[: done["position_rows"]]
        states = room.states if self.mode == IS_FULL else room.scored_states
        rows = RecordArrays(
            copied(room.innovations[: done["innovation_rows"]]),
            states[: done["state_rows"]],
            copied(position) if self.mode == IS_SCORING else position,
            copied(room.flags[: done["flag_rows"]]),
        )
        return rows, found

    def advance(self, start: int, stop: int) -> None:
        """Process some runs; what they record is lost."""
        updates = self.schedule.updates_until(stop) - self.schedule.updates_until(start)
        self._process(start, stop, allocate_records(updates, self.mode), False, ())

    def _process(
        self, start: int, stop: int, room: RecordRoom, is_last: bool, gaps: Sequence[PlannedGap]
    ) -> list[GapRows]:
        self.recorder[["innovation_rows", "state_rows", "position_rows", "flag_rows"]] = 0
        planned = np.zeros(len(gaps), GAP_RUN)
        if gaps:
            planned[list(PlannedGap._fields)] = gaps
            if self._branch is self._main:
                self._branch = self.branch()._main
            self._branch.recorder[:] = new_recorder(IS_GAP)
        updates = sum(gap.last_update - gap.first_update for gap in gaps)
        gap_room = allocate_records(updates, IS_GAP)
        run_estimator(
            self._main, self._branch, self.inputs.arrays, self.schedule.tables, self.notes, room, planned, gap_room,
            start, stop, is_last,
        )  # fmt: skip
        return _gap_rows(planned, gap_room)


class GapRows(NamedTuple):
    """What was recorded in a gap: the horizon when it began, innovations of its sources, first and last position."""

    start_us: int
    innovations: np.ndarray
    local_position: np.ndarray


def _gap_rows(gaps: np.ndarray, room: RecordRoom) -> list[GapRows]:
    if not len(gaps):
        return []
    # the rows of one gap follow those of the one before
    innovations = copied(room.innovations[: gaps[-1]["innovations_to"]])
    positions = copied(room.local_position[: gaps[-1]["positions_to"]])
    edges = ("start_us", "innovations_from", "innovations_to", "positions_from", "positions_to")
    return [
        GapRows(start_us, innovations[first:stop], positions[begin:end])
        for start_us, first, stop, begin, end in gaps[[*edges]].tolist()
    ]


def _estimator(ekf: np.ndarray, params: np.ndarray, recorder: np.ndarray) -> Estimator:
    return Estimator(ekf, params, recorder, views_of(ekf))
