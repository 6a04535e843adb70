"""The estimator on its way through a flight.

It works through the flight in stretches, so that what is recorded of one can be written before the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from itertools import pairwise

import numpy as np

from fusetune.ekf2.feed.inputs import EstimatorInputs
from fusetune.ekf2.filter.common.parameters import taken_value
from fusetune.ekf2.filter.estimator import EKF
from fusetune.ekf2.replay.flight_schedule import FlightSchedule, flight_schedule, notes_of
from fusetune.ekf2.replay.handover import take_sensor_states
from fusetune.ekf2.replay.loop import run_estimator
from fusetune.ekf2.replay.recording import (
    FULL,
    IS_FULL,
    IS_GAP,
    IS_SCORING,
    RECORDER_MEMORY,
    RecordArrays,
    Recording,
    RecordRoom,
    allocate_records,
    joined_rows,
    views_of,
)
from fusetune.ekf2.replay.warm_start import take_over
from fusetune.px4.flight import ParameterChange
from fusetune.px4.layouts.logged_state import LoggedState

RUNS_PER_STRETCH = 8192


class Course:
    """The estimator on its way through a flight: its memory, its parameters, and its schedule."""

    def __init__(
        self,
        inputs: EstimatorInputs,
        params: np.ndarray,
        changes: Sequence[tuple[int, ParameterChange]],
        handovers: Sequence[tuple[int, LoggedState]] = (),
        recording: Recording = FULL,
    ):
        self.inputs, self.params, self.changes, self.handovers = inputs, params, changes, handovers
        self.notes = notes_of(params[0], changes)
        self.mode = IS_FULL if recording is FULL else IS_SCORING
        self.ekf = np.zeros(1, EKF)
        self.recorder = self._new_recorder()

    @cached_property
    def schedule(self) -> FlightSchedule:
        """When the filter updates, with which samples."""
        return flight_schedule(self.inputs, self.params[0], self.changes)

    def _new_recorder(self) -> np.ndarray:
        recorder = np.zeros(1, RECORDER_MEMORY)
        recorder["mode"] = self.mode
        recorder["published"]["is_kept"] = True
        return recorder

    def start_from(self, state: LoggedState) -> tuple[int, int | None]:
        """Go on to the time of a logged state, so that sensors are known, and take it over.

        Returns
        -------
        The run to go on with and the horizon; (0, None), as if nothing had happened, where the samples end before.
        """
        schedule = flight_schedule(self.inputs, self.params[0], self.changes, state.time_us)
        run = schedule.started_run
        if run is None:
            return 0, None
        self.schedule = schedule
        for begin, end in self.stretches(0, 1):
            self.advance(begin, end)
        fresh = self.ekf.copy()
        for begin, end in self.stretches(1, run):
            self.advance(begin, end)
        take_over(self.ekf, fresh, self.params[0], self.inputs, state)
        self.recorder = self._new_recorder()
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
        other.ekf, other.params, other.recorder = self.ekf.copy(), self.params.copy(), self.recorder.copy()
        return other

    def gap_branch(self, sensor: str) -> Course:
        """A branch from which a sensor is withheld; of what it records, innovations and the ends of the position."""
        other = self.branch()
        other.ekf["sensors"][sensor]["withheld"] = True
        other.mode = IS_GAP
        other.recorder["mode"] = IS_GAP
        other.recorder["has_position"] = False
        other.recorder["published"]["is_kept"] = True
        return other

    def stretches(self, first: int, last: int, cuts: Sequence[int] = ()) -> Iterator[tuple[int, int]]:
        """Split the runs; between the parts, change parameters and take over sensors where the log says so."""
        changed = {min(run, last) for run, _ in (*self.changes, *self.handovers) if run >= first}
        edges = {*range(first, last, RUNS_PER_STRETCH), *changed, *(cut for cut in cuts if first <= cut < last), last}
        for start, stop in pairwise(sorted(edges)):
            for run, change in self.changes:
                if run == start:
                    self.params[change.name] = taken_value(change.name, change.value)
            for run, state in self.handovers:
                if run == start:
                    take_sensor_states(self.ekf[0], state)
            yield start, stop

    def run(self, start: int, stop: int, is_last: bool = False) -> RecordArrays:
        """Process some runs and hand over what they recorded; with the last, what was kept back."""
        updates = self.schedule.updates_until(stop) - self.schedule.updates_until(start)
        room = allocate_records(updates, self.mode)
        self._process(start, stop, room, is_last)
        done = self.recorder[0]
        states = room.scored_states if self.mode == IS_SCORING else room.states
        innovations = room.innovations[: done["innovation_rows"]]
        return RecordArrays(
            joined_rows([innovations], innovations.dtype),
            states[: done["state_rows"]],
            room.local_position[: done["position_rows"]],
            room.flags[: done["flag_rows"]].copy(),
        )

    def advance(self, start: int, stop: int) -> None:
        """Process some runs; what they record is lost."""
        updates = self.schedule.updates_until(stop) - self.schedule.updates_until(start)
        self._process(start, stop, allocate_records(updates, self.mode), False)

    def _process(self, start: int, stop: int, room: RecordRoom, is_last: bool) -> None:
        self.recorder[["innovation_rows", "state_rows", "position_rows", "flag_rows"]] = 0
        run_estimator(
            self.ekf[0], self.params[0], self.inputs.arrays, self.schedule.tables, self.notes, views_of(self.ekf),
            self.recorder[0], room, start, stop, is_last,
        )  # fmt: skip

    def without_samples(self) -> Course:
        """A branch to which nothing arrives any more, and nothing that has is due."""
        other = self.branch()
        tables = self.schedule.tables
        other.schedule = FlightSchedule(tables._replace(actions=tables.actions[-1:], events=tables.events[-1:]))
        return other
