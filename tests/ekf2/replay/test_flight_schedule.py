"""Schedules of made-up flights, against PX4's buffers written down a second time, run by run, as lists.

The rules are those of `RingBuffer.h` and `estimator_interface.cpp` of PX4 v1.16: a sample is measured its delay and
half a mean interval before it arrives; it is refused where it follows the newest waiting one by less than the buffer's
span over its places less one; at an update the newest that is due and younger than 0.1 s is taken, and what is older
goes.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.ekf2.replay.equal_rows import assert_equal_rows

from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.feed.inputs import (
    ARRIVAL,
    ARRIVAL_FIELDS,
    COMMAND,
    IMU_ROW,
    EstimatorInputs,
    SampleArrays,
    build_inputs,
)
from fusetune.ekf2.feed.sensor_samples import SYSTEM_FLAGS_SAMPLE
from fusetune.ekf2.feed.sensors import SENSOR_MEMORIES
from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.replay.flight_schedule import FlightSchedule, flight_schedule
from fusetune.ekf2.replay.recording import SCORING
from fusetune.ekf2.replay.replay import replay, replay_into
from fusetune.ekf2.schedule.sensor_actions import BUFFERED, DUE, REFUSED
from fusetune.ekf2.schedule.taking_actions import SENSOR_NAMES
from fusetune.px4.flight import ParameterChange

START_US = 10_000_000
IMU_US = 5_000
RUNS = 400
SENSORS = {"mag": "EKF2_MAG_DELAY", "baro": "EKF2_BARO_DELAY", "flow": "EKF2_OF_DELAY"}
MAX_AGE_US = 100_000


@pytest.fixture(scope="module", autouse=True)
def _kernels() -> None:
    ensure_compiled()


class Arrival(NamedTuple):
    run: int
    age_us: int


def inputs_of(arrivals: dict[str, list[Arrival]], imu_us: list[int]) -> EstimatorInputs:
    """A vehicle at rest; samples that arrive at runs, stamped some time before."""
    imu = np.zeros(len(imu_us), IMU_ROW)
    imu["time_us"] = START_US + np.cumsum(imu_us)
    seconds = (np.array(imu_us) * 1e-6).astype(np.float32)
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = seconds
    imu["delta_vel"][:, 2] = -9.80665 * seconds
    samples = {name: np.zeros(0, memory["sample"]) for name, memory in SENSOR_MEMORIES.items() if name != "drag"}
    rows = []
    for name, arrived in arrivals.items():
        samples[name] = np.zeros(len(arrived), SENSOR_MEMORIES[name]["sample"])
        for slot, one in enumerate(arrived):
            samples[name]["time_us"][slot] = imu["time_us"][one.run] - one.age_us
            rows.append((one.run, ARRIVAL_FIELDS.index(name), slot))
    arrays = SampleArrays(
        imu=imu,
        arrivals=np.array(sorted(rows), ARRIVAL),
        air_density=np.full(len(samples["baro"]), 1.2),
        range_limits=np.zeros((0, 2)),
        flow_limits=np.zeros((len(samples["flow"]), 4)),
        command=np.zeros(0, COMMAND),
        **samples,
    )
    assert samples["system_flags"].dtype == SYSTEM_FLAGS_SAMPLE
    return EstimatorInputs("made up", "approx", arrays, ())


class Buffer:
    """One sensor's buffer as a list of (time of measurement, slot)."""

    def __init__(self, places: int) -> None:
        self.places, self.waiting = places, []
        self.emptied = True

    def offer(self, time_us: int, slot: int, least_us: int) -> bool:
        newest = 0 if self.emptied else self.waiting[-1][0]
        if time_us < newest + least_us:
            return False
        self.waiting = [*self.waiting, (time_us, slot)][-self.places :]
        self.emptied = False
        return True

    def due(self, horizon_us: int) -> tuple[int, int] | None:
        ready = [i for i, (time, _) in enumerate(self.waiting) if time <= horizon_us < time + MAX_AGE_US]
        if not ready:
            return None
        taken = self.waiting[ready[-1]]
        self.waiting = self.waiting[ready[-1] + 1 :]
        self.emptied = not self.waiting
        return taken


def expected(
    inputs: EstimatorInputs, schedule: FlightSchedule, params: np.void, name: str, wanted_until: int
) -> list[tuple[int, ...]]:
    """(update, what, run, slot, time) of one sensor, by going through the runs one by one."""
    tables, imu, arrivals = schedule.tables, inputs.arrays.imu, inputs.arrays.arrivals
    period = params["EKF2_PREDICT_US"] / 1000.0
    imu_places = min(max(2, int(np.ceil(params["EKF2_DELAY_MAX"] / period))), 255)
    places = min(int(np.floor(1.5 * params["EKF2_DELAY_MAX"] / period + 0.5)), imu_places)
    ends = {int(run): number for number, run in enumerate(tables.intervals["run"])}
    updates = set(tables.updates["run"].tolist())
    buffer, intervals, found = Buffer(imu_places if name == "flow" else places), [], []
    average, least, update = np.float32(0.01), 0, 0
    mine = arrivals[arrivals["field"] == ARRIVAL_FIELDS.index(name)]
    came = {int(run): int(slot) for run, slot in zip(mine["run"], mine["position"], strict=True)}
    arrived_at: dict[int, int] = {}
    for run in range(len(imu)):
        if run in ends:
            intervals = [*intervals, tables.intervals[ends[run]]][-imu_places:]
            span = int(imu["time_us"][run]) - int(intervals[0]["time_us"])
            least = span // (places - 1) if places > 1 else 0
        if run in came:
            slot = came[run]
            half = int(average * np.float32(5e5))
            delay = int(np.float32(params[SENSORS[name]]) * np.float32(1000.0))
            time = int(getattr(inputs.arrays, name)["time_us"][slot]) - delay - half
            what = BUFFERED if buffer.offer(time, slot, least) else REFUSED
            arrived_at[slot] = run
            found.append((update, what, run, slot, int(imu["time_us"][run])))
        if run in updates:
            oldest = intervals[0]
            nominal = np.float32(1e-6) * np.float32(params["EKF2_PREDICT_US"])
            mean = np.float32(0.5) * (oldest["delta_vel_dt"] + oldest["delta_ang_dt"])
            limited = min(max(mean, np.float32(0.5) * nominal), np.float32(2.0) * nominal)
            average = np.float32(0.99) * average + np.float32(0.01) * limited
            due = buffer.due(int(oldest["time_us"])) if run < wanted_until else None
            if due is not None:
                found.append((update, DUE, arrived_at[due[1]], due[1], due[0]))
            update += 1
    return [one for one in found if one[0] < update]


ARRIVALS = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 30_000)), max_size=60).map(
    lambda steps: [
        Arrival(int(run), age)
        for run, age in zip(np.cumsum([1 + step for step, _ in steps]), [age for _, age in steps], strict=True)
        if run < RUNS
    ]
)


@settings(max_examples=40, deadline=None)
@given(
    arrivals=st.fixed_dictionaries(dict.fromkeys(SENSORS, ARRIVALS)),
    jitter=st.integers(0, 2**32 - 1),
    predict_us=st.sampled_from([5_000.0, 10_000.0, 13_000.0, 20_000.0]),
    delay_max_ms=st.sampled_from([15.0, 60.0, 200.0]),
    delays_ms=st.tuples(*(st.floats(0.0, 200.0) for _ in SENSORS)),
    switched_off=st.integers(0, RUNS),
)
def test_schedule_is_that_of_px4s_buffers(arrivals, jitter, predict_us, delay_max_ms, delays_ms, switched_off):
    imu_us = np.random.default_rng(jitter).choice([IMU_US, IMU_US, IMU_US, 4_000, 10_000], RUNS).tolist()
    inputs = inputs_of(arrivals, imu_us)
    delays = dict(zip(SENSORS.values(), delays_ms, strict=True))
    values = {"EKF2_PREDICT_US": predict_us, "EKF2_DELAY_MAX": delay_max_ms, "EKF2_OF_CTRL": 1.0} | delays
    params = parameter_record(complete({}, values))[0]
    params["EKF2_DELAY_MAX"] = delay_max_ms  # as it is where all delays are shorter
    off = (switched_off, ParameterChange(START_US, "EKF2_MAG_TYPE", 5.0))
    schedule = flight_schedule(inputs, params, (off,))
    actions = schedule.tables.actions[:-1]
    assert np.all(np.diff(actions["update"]) >= 0)
    # from levelling on, which takes a sample of at least the length of an interval, every interval is an update
    runs = schedule.tables.intervals["run"]
    np.testing.assert_array_equal(
        schedule.tables.updates["run"][1:], runs[len(runs) - len(schedule.tables.updates) + 1 :]
    )
    for name in SENSORS:
        mine = actions[actions["sensor"] == SENSOR_NAMES.index(name)]
        found = [tuple(int(one[field]) for field in ("update", "what", "run", "slot", "time_us")) for one in mine]
        wanted_until = switched_off if name == "mag" else RUNS
        assert found == expected(inputs, schedule, params, name, wanted_until), name


def test_sets_share_what_their_parameters_have_in_common(survey_flight):
    inputs = build_inputs(survey_flight)
    params = parameter_record(complete(survey_flight.parameters.initial, {}, survey_flight.release))[0]
    first = flight_schedule(inputs, params, ())
    other = params.copy()
    other["EKF2_BARO_NOISE"] = 9.0
    assert flight_schedule(inputs, other, ()) is first
    other["EKF2_GPS_DELAY"] = 50.0
    delayed = flight_schedule(inputs, other, ())
    assert delayed is not first
    assert delayed.tables.updates is first.tables.updates
    of_gnss = first.tables.actions["sensor"] == SENSOR_NAMES.index("gnss")
    others = delayed.tables.actions["sensor"] != SENSOR_NAMES.index("gnss")
    assert_equal_rows(first.tables.actions[~of_gnss], delayed.tables.actions[others])
    # other samples have a schedule of their own
    assert flight_schedule(replace(inputs, flight="another"), params, ()) is not first


def test_threads_replay_sets_as_one_after_the_other(survey_flight):
    """The compiled loops hold neither the interpreter nor a memory of their own."""
    shared, alone = build_inputs(survey_flight), build_inputs(survey_flight)
    sets = [
        complete(survey_flight.parameters.initial, {"EKF2_GPS_DELAY": delay}, survey_flight.release)
        for delay in (110.0, 50.0, 110.0, 20.0)
    ]
    with ThreadPoolExecutor(4) as threads:
        together = list(threads.map(lambda params: replay(shared, params, recording=SCORING), sets))
    for params, found in zip(sets, together, strict=True):
        rows = []
        replay_into(rows.append, alone, params, recording=SCORING)
        assert_equal_rows(np.concatenate([part.innovations for part in rows]), found.innovations)
        assert_equal_rows(np.concatenate([part.states for part in rows]), found.states)
