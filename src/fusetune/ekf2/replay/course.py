"""The estimator on its way through a flight.

It works through the flight in stretches, so that what is recorded of one can be written before the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from itertools import pairwise

import numpy as np

from fusetune.ekf2.feed.inputs import EstimatorInputs
from fusetune.ekf2.filter.common.core_memory import zeros_on_cache_lines
from fusetune.ekf2.filter.common.parameters import taken_value
from fusetune.ekf2.filter.estimator import EKF
from fusetune.ekf2.replay.handover import take_sensor_states
from fusetune.ekf2.replay.loop import run_estimator
from fusetune.ekf2.replay.recording import (
    RECORDER_MEMORY,
    RecordArrays,
    allocate_records,
    joined_rows,
    views_of,
)
from fusetune.ekf2.replay.warm_start import take_over
from fusetune.px4.flight import ParameterChange
from fusetune.px4.layouts.logged_state import LoggedState

RUNS_PER_STRETCH = 8192
HORIZON_MARGIN_US = 12_000
"""The horizon moves by one update interval at a time, so that its lag differs by less than this."""
NO_TIME_US = np.iinfo(np.int64).max
"""No horizon comes to it."""


class Course:
    """The estimator on its way through a flight: its memory, its parameters, and what it has recorded last."""

    def __init__(
        self,
        inputs: EstimatorInputs,
        params: np.ndarray,
        changes: Sequence[tuple[int, ParameterChange]],
        handovers: Sequence[tuple[int, LoggedState]] = (),
    ):
        self.inputs, self.params, self.changes, self.handovers = inputs, params, changes, handovers
        self.ekf = zeros_on_cache_lines(EKF)
        self.recorder = np.zeros(1, RECORDER_MEMORY)
        self.records = allocate_records(RUNS_PER_STRETCH)

    def start_from(self, state: LoggedState) -> tuple[int, int | None]:
        """Fill the buffers up to the time of a logged state and take it over.

        Returns
        -------
        The run to go on with and the horizon; (0, None), as if nothing had happened, where the samples end before.
        """
        before = self.branch()
        for begin, end in self.stretches(0, 1):
            self.advance(begin, end)
        fresh = self.ekf.copy()
        run = self.reach(1, state.time_us)
        if self.ekf["time_delayed_us"][0] < state.time_us:
            self.ekf, self.params, self.recorder = before.ekf, before.params, before.recorder
            return 0, None
        take_over(self.ekf, fresh, self.params[0], self.inputs, state)
        self.recorder = np.zeros(1, RECORDER_MEMORY)
        return run, int(self.ekf["time_delayed_us"][0])

    def reach(self, run: int, time_us: int) -> int:
        """Go on from a run until the horizon has come to a time or the samples end; the run to go on with."""
        times = self.inputs.arrays.imu["time_us"]
        while run < len(times) and (horizon := int(self.ekf["time_delayed_us"][0])) < time_us:
            lag = int(self.ekf["time_latest_us"][0]) - horizon + HORIZON_MARGIN_US if horizon else 0
            near = min(max(int(np.searchsorted(times, time_us + lag)), run + 1), len(times))
            for begin, end in self.stretches(run, near):
                run = begin + self.advance(begin, end, time_us)
                if run < end:
                    return run
        return run

    def branch(self) -> Course:
        """Another course that starts where this one is."""
        other = copy(self)
        other.ekf, other.params, other.recorder = zeros_on_cache_lines(EKF), self.params.copy(), self.recorder.copy()
        other.ekf[:] = self.ekf
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

    def run(self, start: int, stop: int) -> RecordArrays:
        """Process some runs; copies of what they recorded."""
        self.advance(start, stop)
        done = self.recorder[0]
        counts = (done["innovation_rows"], done["update_rows"], done["update_rows"], done["flag_rows"])
        return RecordArrays(
            *(joined_rows([rows[:count]], rows.dtype) for rows, count in zip(self.records, counts, strict=True))
        )

    def advance(self, start: int, stop: int, horizon_us: int = NO_TIME_US) -> int:
        """Process some runs, those after which the horizon has come to a time left out; what they record stays until
        the next.

        Returns
        -------
        How many were processed
        """
        self.recorder[["innovation_rows", "update_rows", "flag_rows"]] = 0
        views, arrays = views_of(self.ekf), self.inputs.arrays.of_runs(start, stop)
        done = run_estimator(
            self.ekf[0], self.params[0], arrays, views, self.recorder[0], self.records, stop - start, horizon_us
        )
        return int(done)
