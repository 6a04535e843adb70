"""Replay one flight through the estimator with one parameter set.

The compiled loop does at every IMU sample what PX4's EKF2 module does in one run: take the IMU sample, the newest
message of every aiding topic, the system flags; update the filter; publish. It works through the flight in stretches,
so that what is recorded of one can be written before the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from fusetune.ekf2.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.aid_sources.drag.drag_accumulator import accumulate_drag
from fusetune.ekf2.aid_sources.magnetometer.world_field import save_declination
from fusetune.ekf2.buffers import initialise_buffers, push_drag, push_imu
from fusetune.ekf2.commands import handle_command
from fusetune.ekf2.compilation import ensure_compiled
from fusetune.ekf2.covariance import reset_accel_bias, reset_gyro_bias
from fusetune.ekf2.estimator import EKF, initialise_estimator, update
from fusetune.ekf2.handover import handover_runs, take_sensor_states, without_resets_at
from fusetune.ekf2.imu_down_sampler import accumulate_imu, initialise_down_sampler, reset_down_sampler
from fusetune.ekf2.inputs import EstimatorInputs
from fusetune.ekf2.kernel import entry_kernel, kernel
from fusetune.ekf2.output_predictor import initialise_output_predictor, predict_output
from fusetune.ekf2.parameters import PARAMETER_NAMES, parameter_record, taken_value
from fusetune.ekf2.recording import (
    FLAG_COLUMNS,
    LOCAL_POSITION_ROW,
    RECORDER_MEMORY,
    RecordArrays,
    allocate_records,
    joined,
    joined_rows,
    record_update,
    views_of,
)
from fusetune.ekf2.sample_arrival import (
    receive_airspeed,
    receive_auxvel,
    receive_baro,
    receive_ev,
    receive_flow,
    receive_gnss,
    receive_mag,
    receive_range,
    receive_system_flags,
)
from fusetune.ekf2.warm_start import take_over, without_first_resets
from fusetune.ekf2.withholding import WITHHOLDABLE
from fusetune.px4.flight import ParameterChange
from fusetune.px4.logged_state import Handover, LoggedState

RUNS_PER_STRETCH = 8192
HORIZON_MARGIN_US = 12_000
"""The horizon moves by one update interval at a time, so that its lag differs by less than this."""

MIN_DT_FACTOR, MAX_DT_FACTOR = np.float32(0.5), np.float32(2.0)


@dataclass(frozen=True)
class Gap:
    """A time in which the measurements of one sensor are withheld from the filter.

    Attributes
    ----------
    sensor : a key of `fusetune.ekf2.withholding.WITHHOLDABLE`
    start, stop : IMU timestamps (µs)
    """

    sensor: str
    start: int
    stop: int


@dataclass(frozen=True)
class GapResult:
    """What the filter did in a gap.

    Attributes
    ----------
    start : fusion time horizon when the withholding began (µs)
    innovations : rows of the sensor's own aid sources: what it measured, against what was predicted without it
    local_position : (2,) rows at the beginning and at the end
    """

    gap: Gap
    start: int
    innovations: np.ndarray
    local_position: np.ndarray


@dataclass(frozen=True, kw_only=True)
class ReplaySummary:
    """How a replay went, without the rows that it published."""

    mode: str
    imu_samples: int
    updates: int
    update_interval_us: float
    """Median time between two updates; 0 with fewer than two."""
    origin: tuple[float, float, float] | None
    """Latitude and longitude (deg) and altitude (m) of the local frame, None while never set."""
    resets: Mapping[str, int]
    """Reset counters at the end of the flight, under the names of `vehicle_local_position`."""
    filter_fault_flags_max: int
    """Largest value of the fault flags seen as one number, like `estimator_status.filter_fault_flags`."""
    diverged: bool
    """Whether a state or variance stopped being a finite number."""
    gaps: tuple[GapResult, ...] = ()
    warm_start_us: int | None = None
    """Fusion time horizon at which the filter took over the vehicle's state, None where it started from nothing."""
    levelled: bool = False
    """Whether the filter ever had its tilt, without which it does not begin."""


@dataclass(frozen=True, kw_only=True)
class ReplayResult(ReplaySummary):
    """What one replay published, as structured arrays in time order (see `fusetune.ekf2.recording`)."""

    innovations: np.ndarray
    states: np.ndarray
    local_position: np.ndarray
    flags: np.ndarray

    def source_names(self) -> np.ndarray:
        """Aid source of each innovation row."""
        return np.array(AID_SOURCE_NAMES)[self.innovations["source"]]


class _Tally:
    """What is told of all rows, counted as they come."""

    def __init__(self) -> None:
        self._horizons: list[np.ndarray] = []
        self._diverged = False
        self._faults = 0
        self._resets = {name: 0 for name in LOCAL_POSITION_ROW.names or () if name.endswith("_reset_counter")}

    def add(self, rows: RecordArrays) -> None:
        states, position = rows.states, rows.local_position
        self._horizons.append(states["timestamp_sample"].copy())
        self._diverged |= not (np.isfinite(states["states"]).all() and np.isfinite(states["covariances"]).all())
        faults = [i for i, name in enumerate(FLAG_COLUMNS) if name.startswith("fs_")]
        bits = rows.flags["flags"][:, faults].astype(np.int64) << np.arange(len(faults))
        self._faults = max(self._faults, int(bits.sum(axis=1).max(initial=0)))
        if len(position):
            self._resets = {name: int(position[name][-1]) for name in self._resets}

    def summary(self, course: Course, warm_start_us: int | None, gaps: Sequence[GapResult | None]) -> ReplaySummary:
        time = np.concatenate([np.zeros(0, np.int64), *self._horizons])
        return ReplaySummary(
            mode=course.inputs.mode,
            imu_samples=len(course.inputs.arrays.imu),
            updates=int(course.recorder["updates"][0]),
            update_interval_us=float(np.median(np.diff(time))) if len(time) > 1 else 0.0,
            origin=_origin(course.ekf["origin"][0]),
            resets=self._resets,
            filter_fault_flags_max=self._faults,
            diverged=self._diverged,
            gaps=tuple(one for one in gaps if one is not None),
            warm_start_us=warm_start_us,
            levelled=bool(course.ekf["filter_initialised"][0]),
        )


def replay(
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    *,
    overridden: frozenset[str] | None = None,
    gaps: Sequence[Gap] = (),
    start: LoggedState | None = None,
    handovers: Sequence[Handover] = (),
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
    kept: list[RecordArrays] = []
    summary = replay_into(
        lambda rows: kept.append(rows if keep is None else keep(rows)),
        inputs,
        parameters,
        overridden=overridden,
        gaps=gaps,
        start=start,
        handovers=handovers,
    )
    told = {field.name: getattr(summary, field.name) for field in fields(ReplaySummary)}
    return ReplayResult(**told, **joined(kept)._asdict())


def replay_into(
    take: Callable[[RecordArrays], None],
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    *,
    overridden: frozenset[str] | None = None,
    gaps: Sequence[Gap] = (),
    start: LoggedState | None = None,
    handovers: Sequence[Handover] = (),
) -> ReplaySummary:
    """Run the estimator over one flight and hand on what it publishes, a stretch of the flight at a time.

    Parameters
    ----------
    take : callable
        Is given the rows of each stretch, in order.
    inputs : EstimatorInputs
        From `fusetune.ekf2.inputs.build_inputs`.
    parameters : mapping
        A complete set, from `fusetune.ekf2.parameters.complete`.
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
    """
    ranges = [_runs_of(inputs, gap) for gap in gaps]
    course, first_run, warm_start_us = begin_course(inputs, parameters, overridden, start, handovers)
    tally = _Tally()
    found: list[GapResult | None] = [None] * len(gaps)
    for begin, end in course.stretches(first_run, len(inputs.arrays.imu), [first for first, _ in ranges]):
        for number, (first, last) in enumerate(ranges):
            if first == begin:
                found[number] = _continue_into_gap(course, gaps[number], first, last)
        rows = course.run(begin, end)
        tally.add(rows)
        take(rows)
    return tally.summary(course, warm_start_us, found)


def begin_course(
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    overridden: frozenset[str] | None = None,
    start: LoggedState | None = None,
    handovers: Sequence[Handover] = (),
) -> tuple[Course, int, int | None]:
    """Set the estimator on its way; arguments as for `replay`.

    Returns
    -------
    The course, the run to go on with, and the horizon at which `start` was taken over (None: it was not).
    """
    ensure_compiled()
    changes = [
        (run, change)
        for run, change in inputs.parameter_changes
        if change.name in PARAMETER_NAMES and change.name not in (overridden or frozenset())
    ]
    if start is not None:
        inputs = without_first_resets(inputs, start.time_us)
    inputs = without_resets_at(inputs, handovers)
    record = parameter_record(parameters)
    course = Course(inputs, record, changes, handover_runs(inputs, float(record["EKF2_DELAY_MAX"][0]), handovers))
    first_run, warm_start_us = course.start_from(start) if start is not None else (0, None)
    return course, first_run, warm_start_us


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
        self.ekf = np.zeros(1, EKF)
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
            self.run(begin, end)
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
        runs = len(self.inputs.arrays.imu)
        horizon = int(self.ekf["time_delayed_us"][0])
        lag = max(int(self.ekf["time_latest_us"][0]) - horizon - HORIZON_MARGIN_US, 0) if horizon else 0
        near = min(max(int(np.searchsorted(self.inputs.arrays.imu["time_us"], time_us + lag)), run), runs)
        for begin, end in self.stretches(run, near):
            self.run(begin, end)
        while near < runs and self.ekf["time_delayed_us"][0] < time_us:
            for begin, end in self.stretches(near, near + 1):
                self.run(begin, end)
            near += 1
        return near

    def branch(self) -> Course:
        """Another course that starts where this one is."""
        other = copy(self)
        other.ekf, other.params, other.recorder = self.ekf.copy(), self.params.copy(), self.recorder.copy()
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
        self.recorder[["innovation_rows", "update_rows", "flag_rows"]] = 0
        views, arrays = views_of(self.ekf), self.inputs.arrays.of_runs(start, stop)
        run_estimator(self.ekf[0], self.params[0], arrays, views, self.recorder[0], self.records, stop - start)
        done = self.recorder[0]
        counts = (done["innovation_rows"], done["update_rows"], done["update_rows"], done["flag_rows"])
        return RecordArrays(
            *(joined_rows([rows[:count]], rows.dtype) for rows, count in zip(self.records, counts, strict=True))
        )


def _runs_of(inputs: EstimatorInputs, gap: Gap) -> tuple[int, int]:
    first, last = np.searchsorted(inputs.arrays.imu["time_us"], (gap.start, gap.stop))
    return int(first), int(last)


def _continue_into_gap(course: Course, gap: Gap, first: int, last: int) -> GapResult | None:
    """Replay the gap on a copy of the filter; None where the filter has not started, or the flight has no such time."""
    if not course.ekf["filter_initialised"][0]:
        return None
    branch = course.branch()
    branch.ekf["withheld"][gap.sensor] = True
    start = int(branch.ekf["time_delayed_us"][0])
    innovations, _, local_position, _ = joined([branch.run(*stretch) for stretch in branch.stretches(first, last)])
    if not len(local_position):
        return None
    sources = [AID_SOURCE_NAMES.index(name) for name in WITHHOLDABLE[gap.sensor]]
    return GapResult(
        gap=gap,
        start=start,
        innovations=innovations[np.isin(innovations["source"], sources)],
        local_position=local_position[[0, -1]],
    )


def _origin(origin: np.void) -> tuple[float, float, float] | None:
    if not origin["valid"]:
        return None
    return float(np.rad2deg(origin["lat_rad"])), float(np.rad2deg(origin["lon_rad"])), float(origin["alt"])


@entry_kernel
def run_estimator(ekf, params, inputs, views, recorder, records, runs):
    """Process a stretch of a flight; `inputs` are of its runs."""
    for run in range(runs):
        arrivals = inputs.arrivals[run]
        if arrivals.command >= 0:
            handle_command(ekf, params, inputs.command[arrivals.command])
        if arrivals.reset_accel_bias:
            reset_accel_bias(ekf, params)
        if arrivals.reset_gyro_bias:
            reset_gyro_bias(ekf, params)
        receive_imu(ekf, params, inputs.imu[run])
        receive_aiding(ekf, params, inputs, arrivals)
        if update(ekf, params, inputs):
            save_declination(ekf, params)
            record_update(ekf, params, views, recorder, records, inputs.imu[run].time_us)


@kernel
def receive_imu(ekf, params, imu):
    """Feed the output predictor and the down-sampler; move the horizon when an interval is complete."""
    if not ekf.buffers.initialised:
        initialise_buffers(ekf, params, imu.time_us)
        initialise_down_sampler(ekf.down_sampler)
        initialise_output_predictor(ekf)
        initialise_estimator(ekf, params)
    ekf.time_latest_us = imu.time_us
    predict_output(ekf, params, imu)
    if accumulate_imu(ekf.down_sampler, imu):
        ekf.imu_newest = ekf.down_sampler.sample
        reset_down_sampler(ekf.down_sampler, params)
        period = np.float32(params.EKF2_PREDICT_US) * np.float32(1e-6)
        low, high = MIN_DT_FACTOR * period, MAX_DT_FACTOR * period
        ekf.imu_newest.delta_ang_dt = min(max(np.float32(ekf.imu_newest.delta_ang_dt), low), high)
        ekf.imu_newest.delta_vel_dt = min(max(np.float32(ekf.imu_newest.delta_vel_dt), low), high)
        push_imu(ekf, imu.time_us)
        ekf.imu_updated = True
    buffers = ekf.buffers
    if accumulate_drag(ekf, params, imu, buffers.imu_length, buffers.observation_length):
        push_drag(ekf, ekf.drag.produced)


@kernel
def receive_aiding(ekf, params, inputs, arrivals):
    """Buffer what arrived with this IMU sample, in the order of PX4's module."""
    if arrivals.airspeed >= 0:
        receive_airspeed(ekf, params, inputs, arrivals.airspeed)
    if arrivals.auxvel >= 0:
        receive_auxvel(ekf, params, inputs, arrivals.auxvel)
    if arrivals.baro >= 0:
        receive_baro(ekf, params, inputs, arrivals.baro)
    if arrivals.ev >= 0:
        receive_ev(ekf, params, inputs, arrivals.ev)
    if arrivals.flow >= 0:
        receive_flow(ekf, params, inputs, arrivals.flow)
    if arrivals.gnss >= 0:
        receive_gnss(ekf, params, inputs, arrivals.gnss)
    if arrivals.mag >= 0:
        receive_mag(ekf, params, inputs, arrivals.mag)
    if arrivals.range >= 0:
        receive_range(ekf, params, inputs, arrivals.range)
    if arrivals.system_flags >= 0:
        receive_system_flags(ekf, inputs, arrivals.system_flags)
