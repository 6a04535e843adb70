"""The schedule of a replay: what of it no state of the filter enters, built once and shared.

It follows from the flight and from few parameters (lengths of intervals and buffers, delays, which sensors are asked
for). Replays of many sets, and all gaps of one, walk the same schedule; a set that differs in one delay needs that
sensor's part alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from fusetune.ekf2.feed.buffers import BUFFER_LENGTHS, RING
from fusetune.ekf2.feed.inputs import ARRIVAL_FIELDS, BIAS_RESETS, EstimatorInputs
from fusetune.ekf2.feed.sample_arrival import NOTE, NOTED
from fusetune.ekf2.feed.sensor_samples import DRAG_SAMPLE
from fusetune.ekf2.filter.aid_sources.drag.drag_memory import drag_accumulator
from fusetune.ekf2.filter.common.aid_mask import MASK_DRAG
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_3D, MAG_TYPE_NONE
from fusetune.ekf2.filter.common.parameters import taken_value
from fusetune.ekf2.filter.imu_down_sampler.imu_down_sampler import DOWN_SAMPLER_MEMORY
from fusetune.ekf2.releases.behaviours import BASELINE, BEHAVIOURS
from fusetune.ekf2.replay.loop import (
    COMMAND,
    EVENT,
    RESET_ACCEL_BIAS,
    RESET_GYRO_BIAS,
    find_actions,
    find_drag,
    find_intervals,
    find_updates,
)
from fusetune.ekf2.schedule.imu_intervals import IMU_INTERVAL
from fusetune.ekf2.schedule.longest_delay import longest_delay_ms
from fusetune.ekf2.schedule.sensor_actions import ACTION, ARRIVED, DUE
from fusetune.ekf2.schedule.starting_samples import looks_of_runs, low_passed, taken_at
from fusetune.ekf2.schedule.taking_actions import DRAG, FLOW, SENSOR_NAMES, SYSTEM_FLAGS
from fusetune.ekf2.schedule.timeline import Steps, steps_of, timeline
from fusetune.ekf2.schedule.updates import NEVER, UPDATE, levelling_record
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.flight import ParameterChange

Changes = Sequence[tuple[int, ParameterChange]]
Rows = np.ndarray[Any, np.dtype[Any]]

_NONE_FOLLOWS = np.iinfo(np.int32).max
"""Update or run of the entry that ends a table, so that whoever walks it need not count."""

_WANTED: dict[str, tuple[str, Callable[[float], float]]] = {
    "mag": ("EKF2_MAG_TYPE", lambda value: float(int(value) != MAG_TYPE_NONE)),
    "flow": ("EKF2_OF_CTRL", lambda value: float(int(value) == 1)),
    "gnss": ("EKF2_GPS_CTRL", lambda value: float(int(value) != 0)),
    "airspeed": ("EKF2_ARSP_THR", lambda value: float(value > 0.0)),
    "drag": ("EKF2_DRAG_CTRL", lambda value: float(int(value) > 0)),
}
"""By which parameter the filter asks for a sensor's samples; the others are always asked for."""


class ScheduleTables(NamedTuple):
    """The tables that the compiled replay walks."""

    intervals: Rows
    updates: Rows
    actions: Rows
    drag: Rows
    events: Rows
    lengths: Rows
    levelling: Rows


@dataclass(frozen=True)
class FlightSchedule:
    """When the filter updates on a flight, with which samples."""

    tables: ScheduleTables

    @property
    def started_run(self) -> int | None:
        """The run from which the filter goes on with the state that it was given; None where it never comes to it."""
        run = int(self.tables.levelling["started_run"][0])
        return run if run >= 0 else None

    def updates_until(self, run: int) -> int:
        """How many updates there are before a run."""
        return int(np.searchsorted(self._update_runs, run))

    @cached_property
    def _update_runs(self) -> Rows:
        return np.ascontiguousarray(self.tables.updates["run"])

    def update_interval_us(self, run: int) -> float:
        """Median time (µs) between the updates from a run on; 0 with fewer than two."""
        if run not in self._median_intervals:
            updates = self.tables.updates["delayed"][self.updates_until(run) :]
            steps = np.diff(self.tables.intervals["time_us"][updates])
            self._median_intervals[run] = float(np.median(steps)) if len(steps) else 0.0
        return self._median_intervals[run]

    @cached_property
    def _median_intervals(self) -> dict[int, float]:
        return {}

    @cached_property
    def _horizons(self) -> tuple[Rows, Rows, Rows]:
        """Runs at which the horizon moves, to what time, and the latest of these so far."""
        newest = np.arange(len(self.tables.intervals))
        oldest = np.maximum(newest - int(self.tables.lengths["imu_length"][0]) + 1, 0)
        times = self.tables.intervals["time_us"][oldest]
        return np.ascontiguousarray(self.tables.intervals["run"]), times, np.maximum.accumulate(times)

    def run_of_horizon(self, since: int, time_us: int) -> int | None:
        """The first run, not before `since`, at which the horizon comes to a time; None for never."""
        runs, times, latest = self._horizons
        place = max(int(np.searchsorted(latest, time_us)), int(np.searchsorted(runs, since)))
        while place < len(times) and times[place] < time_us:
            place += 1
        return int(runs[place]) if place < len(times) else None


class SampleStart(NamedTuple):
    """By what a release starts that waits for samples: whether it needs a heading, and delays of the sensors."""

    needs_heading: bool
    mag_delay: Steps
    baro_delay: Steps


class Clock(NamedTuple):
    """What updates follow from: interval, longest delay, when a state is given, release, and what its start needs."""

    predict_us: Steps
    delay_max_ms: float
    start_us: int
    release: str
    start: SampleStart | None


def flight_schedule(
    inputs: EstimatorInputs, params: np.void, changes: Changes, start_us: int | None = None, release: str = BASELINE
) -> FlightSchedule:
    """The schedule of a flight for some parameters; built on the first call, shared by the others.

    Parameters
    ----------
    params : EKF2_PARAMETERS record at the start
    changes : changes in flight that are in effect
    start_us : the filter is given a state once the horizon has come to this time
    release : whose estimator is replayed
    """

    def steps(name: str, meaning: Callable[[float], float] = float) -> Steps:
        changed = [(run, taken_value(name, change.value, release)) for run, change in changes if change.name == name]
        return steps_of(float(params[name]), changed, meaning)

    def at_start(name: str) -> float:
        return [value for run, value in steps(name) if run == 0][-1]

    delay_max = longest_delay_ms(at_start, release)
    start = None
    if BEHAVIOURS[release].starts_with_samples:
        needs_heading = int(at_start("EKF2_MAG_TYPE")) <= MAG_TYPE_3D
        start = SampleStart(needs_heading, *(steps(SENSORS[name].delay_parameter or "") for name in ("mag", "baro")))
    clock = Clock(steps("EKF2_PREDICT_US"), delay_max, NEVER if start_us is None else start_us, release, start)
    told = {}
    for sensor in SENSOR_NAMES:
        delay = SENSORS[sensor].delay_parameter if sensor in SENSORS else None
        asks = _asking_parameter(sensor, release)
        wanted = steps(*asks) if asks else ((0, 1.0),)
        if sensor == "gnss" and _told_gnss_times(inputs, release) is not None:
            delay = None
        told[sensor] = (steps(delay) if delay else ((0, 0.0),), wanted)
    memo = inputs.memo
    key = ("schedule", clock, tuple(told.values()))
    return memo.get(key, lambda: _Builder(inputs, clock).schedule(told), lambda made: _bytes(made.tables))


def _asking_parameter(sensor: str, release: str) -> tuple[str, Callable[[float], float]] | None:
    """By which parameter a release asks for a sensor; None for always, as for flow that may tell of a terrain apart.

    EKF2_AID_MASK says whether GNSS is used, and not whether its samples are taken.
    """
    does = BEHAVIOURS[release]
    if does.selects_sources_by_mask and sensor in ("drag", "gnss"):
        return ("EKF2_AID_MASK", lambda value: float(int(value) & MASK_DRAG != 0)) if sensor == "drag" else None
    return None if sensor == "flow" and does.flies_flow_over_terrain else _WANTED.get(sensor)


def _flow_times(inputs: EstimatorInputs) -> Rows:
    """When the intervals of the flow ended, (samples,) int64."""
    timespan = inputs.arrays.flow_limits[:, 3].astype(np.int64)
    return np.ascontiguousarray(inputs.arrays.flow["time_us"]) + timespan // 2


def _told_gnss_times(inputs: EstimatorInputs, release: str) -> Rows | None:
    """When GNSS was measured, where the release takes that from the messages and they tell it."""
    return inputs.gnss_measured_us if BEHAVIOURS[release].stamps_gnss_by_message else None


def notes_of(params: np.void, changes: Changes) -> Rows:
    """What the parameters that act on samples as they arrive say, from which run on."""
    rows = [(0, *(params[name] for name in NOTED))]
    for run, change in sorted(changes, key=lambda one: one[0]):
        if change.name in NOTED:
            place = 1 + list(NOTED).index(change.name)
            rows.append((run, *rows[-1][1:place], taken_value(change.name, change.value), *rows[-1][place + 1 :]))
    return np.array(rows, NOTE)


def _order(actions: Rows, mixed: bool) -> Rows:
    """Places of actions in the order in which they are carried out: by update, then by sensor.

    Where arrivals are `mixed`, those of all sensors are by run, flags first, and then follows what is taken: what is
    known of the vehicle matters to a sample that is looked at as it arrives.
    """
    updates = np.ascontiguousarray(actions["update"])
    if not mixed:
        return np.argsort(updates, kind="stable")
    are_flags = actions["sensor"] == SYSTEM_FLAGS
    are_taken = (actions["what"] == DUE) & ~are_flags
    return np.lexsort((~are_flags, actions["run"], are_taken, updates))


def _size(rows: Rows) -> int:
    return rows.nbytes


def _bytes(arrays: Sequence[Rows]) -> int:
    return sum(array.nbytes for array in arrays)


class _Builder:
    """Builds the parts of schedules of one flight that share intervals and updates."""

    def __init__(self, inputs: EstimatorInputs, clock: Clock) -> None:
        self.inputs, self.imu, self.clock = inputs, inputs.arrays.imu, clock
        predict_us = clock.predict_us
        self.predict_us = timeline(predict_us)
        self.intervals = inputs.memo.get(("intervals", predict_us), self._intervals, _size)
        self.updates, self.lengths, self.levelling = inputs.memo.get(("updates", clock), self._updates, _bytes)

    def _intervals(self) -> Rows:
        intervals, sampler = np.zeros(len(self.imu), IMU_INTERVAL), np.zeros(1, DOWN_SAMPLER_MEMORY)
        return _shortened(intervals, find_intervals(self.imu, self.predict_us, sampler, intervals))

    def _updates(self) -> tuple[Rows, Rows, Rows]:
        clock, lengths = self.clock, np.zeros(1, BUFFER_LENGTHS)
        levelling = np.zeros(1, levelling_record(clock.release))
        find = partial(find_updates, self.intervals, self.imu, self.predict_us, clock.delay_max_ms, clock.start_us)
        if clock.start is None:
            updates = np.zeros(len(self.intervals), UPDATE)
            return _shortened(updates, find(lengths, levelling, updates)), lengths, levelling
        return self._updates_with_samples(clock.start, find, lengths, levelling)

    def _updates_with_samples(
        self, start: SampleStart, find: Callable[[Rows, Rows, Rows], int], lengths: Rows, levelling: Rows
    ) -> tuple[Rows, Rows, Rows]:
        """Updates from when there are as many samples of magnetometer and barometer as their buffers hold."""
        levelling["earliest_run"] = len(self.imu)
        updates = np.zeros(len(self.intervals), UPDATE)
        find(lengths, levelling, updates)
        looks = looks_of_runs(self.intervals, len(self.imu), int(lengths["imu_length"][0]))
        mag = taken_at(looks, self._find_actions("mag", start.mag_delay, lengths, looks))
        baro = taken_at(looks, self._find_actions("baro", start.baro_delay, lengths, looks))
        needed = int(lengths["observation_length"][0])
        earliest = [one.run_of(needed) for one in ((mag, baro) if start.needs_heading else (baro,))]
        levelling[0] = np.zeros(1, levelling.dtype)[0]
        levelling["levelled_run"] = -1
        known = [len(self.imu) if run is None else run for run in earliest]
        levelling["earliest_run"] = max(known)
        updates = np.zeros(len(self.intervals), UPDATE)
        updates = _shortened(updates, find(lengths, levelling, updates))
        run = int(levelling["levelled_run"][0])
        if run < 0:
            run = int(updates["run"][0]) if len(updates) else -1
        mags, baros = mag.until(run), baro.until(run)
        levelling["mag_count"], levelling["baro_count"] = mags, baros
        if mags:
            levelling["mag"] = low_passed(self.inputs.arrays.mag["mag"][mag.slots[:mags]])
        if baros:
            heights = self.inputs.arrays.baro["hgt"][baro.slots[:baros]]
            levelling["baro_offset"], levelling["baro_height"] = low_passed(heights), heights[-1]
            levelling["baro_time_us"] = baro.times_us[baros - 1]
        return updates, lengths, levelling

    def schedule(self, told: dict[str, tuple[Steps, Steps]]) -> FlightSchedule:
        memo, drag = self.inputs.memo, np.zeros(0, DRAG_SAMPLE)
        parts = []
        for number, (name, values) in enumerate(told.items()):
            key = (name, self.clock, values)
            if number == DRAG:
                drag, actions = memo.get(key, partial(self._drag, values[1]), _bytes)
            elif name == "system_flags" and BEHAVIOURS[self.clock.release].follows_flags_at_once:
                actions = memo.get(key, self._flags_at_once, _size)
            elif name in ("mag", "baro") and self.clock.start is not None:
                actions = memo.get(key, partial(self._actions_after_start, number, *values), _size)
            else:
                actions = memo.get(key, partial(self._actions, number, *values), _size)
            parts.append(actions)
        end = np.zeros(1, ACTION)
        end["update"] = _NONE_FOLLOWS
        actions = np.concatenate([*parts, end])
        actions = actions[_order(actions, BEHAVIOURS[self.clock.release].follows_flags_at_once)]
        tables = ScheduleTables(
            self.intervals, self.updates, actions, drag, self._events(), self.lengths, self.levelling
        )
        return FlightSchedule(tables)

    def _actions(self, number: int, delay_ms: Steps, wanted: Steps) -> Rows:
        return self._find_actions(SENSOR_NAMES[number], delay_ms, self.lengths, self.updates, wanted)

    def _find_actions(
        self, name: str, delay_ms: Steps, lengths: Rows, updates: Rows, wanted: Steps = ((0, 1.0),)
    ) -> Rows:
        arrived = _arrived(self.inputs, name)
        times = np.ascontiguousarray(getattr(self.inputs.arrays, name)["time_us"])
        told = _told_gnss_times(self.inputs, self.clock.release) if name == "gnss" else None
        number = SENSOR_NAMES.index(name)
        if told is not None:
            times = told
        elif number == FLOW and BEHAVIOURS[self.clock.release].integrates_flow:
            times = _flow_times(self.inputs)
        places = "imu_length" if number == FLOW else "observation_length"
        actions = np.zeros(2 * len(arrived), ACTION)
        count = find_actions(
            arrived, times, timeline(delay_ms), timeline(wanted), self.imu, self.intervals, updates,
            lengths, np.zeros(1, RING), int(lengths[places][0]), actions,
        )  # fmt: skip
        actions["sensor"] = number
        return _shortened(actions, count)

    def _actions_after_start(self, number: int, delay_ms: Steps, wanted: Steps) -> Rows:
        """As `_actions`, without the samples that were taken for the start."""
        run = int(self.levelling["levelled_run"][0])
        looks = looks_of_runs(self.intervals, len(self.imu), int(self.lengths["imu_length"][0]))
        looks = looks[looks["run"] <= run]
        steps = np.concatenate([looks, self.updates])
        actions = self._find_actions(SENSOR_NAMES[number], delay_ms, self.lengths, steps, wanted)
        actions = actions[(actions["what"] != DUE) | (actions["update"] >= len(looks))]
        actions["update"] = np.maximum(actions["update"] - len(looks), 0)
        return actions

    def _flags_at_once(self) -> Rows:
        """Each acts at the first update that is not before its arrival."""
        arrived = _arrived(self.inputs, "system_flags")
        actions = np.zeros(len(arrived), ACTION)
        actions["run"], actions["slot"] = arrived["run"], arrived["slot"]
        actions["update"] = np.searchsorted(self.updates["run"], arrived["run"])
        actions["time_us"] = self.imu["time_us"][arrived["run"]]
        actions["sensor"], actions["what"] = SENSOR_NAMES.index("system_flags"), DUE
        return actions[actions["update"] < len(self.updates)]

    def _drag(self, enabled: Steps) -> tuple[Rows, Rows]:
        # called where it finds nothing, too: what a replay at rest compiles is all that there is to compile
        imu = self.imu if any(value for _, value in enabled) else self.imu[:0]
        samples, arrived = np.zeros(len(imu), DRAG_SAMPLE), np.zeros(len(imu), ARRIVED)
        actions = np.zeros(len(imu) + 1, ACTION)
        sums = np.zeros(1, drag_accumulator(self.clock.release))
        made, count = find_drag(
            timeline(enabled), imu, self.intervals, self.updates, self.lengths, sums, np.zeros(1, RING), arrived,
            samples, actions,
        )  # fmt: skip
        actions["sensor"] = DRAG
        return _shortened(samples, made), _shortened(actions, count)

    def _events(self) -> Rows:
        arrivals = self.inputs.arrays.arrivals
        what = ("command", COMMAND), *zip(BIAS_RESETS, (RESET_ACCEL_BIAS, RESET_GYRO_BIAS), strict=True)
        fields = {ARRIVAL_FIELDS.index(name): number for name, number in what}
        here = arrivals[np.isin(arrivals["field"], list(fields))]
        events = np.zeros(len(here) + 1, EVENT)
        events["run"][:-1], events["position"][:-1] = here["run"], here["position"]
        events["what"][:-1] = [fields[field] for field in here["field"].tolist()]
        events["run"][-1] = _NONE_FOLLOWS
        return np.sort(events, order=["run", "what"])


def _arrived(inputs: EstimatorInputs, name: str) -> Rows:
    """The samples of a sensor that arrive."""

    def by_field() -> list[Rows]:
        field = np.ascontiguousarray(inputs.arrays.arrivals["field"])
        arrivals = inputs.arrays.arrivals[np.argsort(field, kind="stable")]
        rows = np.zeros(len(arrivals), ARRIVED)
        rows["run"], rows["slot"] = arrivals["run"], arrivals["position"]
        return np.split(rows, np.cumsum(np.bincount(field, minlength=len(ARRIVAL_FIELDS)))[:-1])

    return inputs.memo.get("arrived", by_field, _bytes)[ARRIVAL_FIELDS.index(name)]


def _shortened(rows: Rows, count: int) -> Rows:
    """The first rows of an array that nobody else has; the room of the others is given back."""
    rows.resize(count, refcheck=False)
    return rows
