"""Everything the estimator takes from one flight, in the order in which it arrives.

Built once per flight, since no parameter of the estimator enters: parameter sets share it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fusetune.ekf2.feed import message_samples as convert
from fusetune.ekf2.feed.arrival_order import RunSchedule, schedule_runs
from fusetune.ekf2.feed.memo import Memo
from fusetune.ekf2.feed.sensor_samples import IMU_SAMPLE, SYSTEM_FLAGS_SAMPLE
from fusetune.ekf2.feed.taken_samples import AIDING, only_usable
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.flight import Flight, ParameterChange, TopicTable, select_rows

ARMING_STATE_ARMED = 2
VEHICLE_TYPE_FIXED_WING = 2
LAUNCH_STATE_WAITING = 1
STATUS_MAX_AGE_US = 3_000_000

COMMAND_SET_GPS_GLOBAL_ORIGIN = 100000
COMMAND_EXTERNAL_POSITION_ESTIMATE = 43003
COMMAND_EXTERNAL_WIND_ESTIMATE = 43004
ESTIMATOR_COMMANDS = (
    COMMAND_SET_GPS_GLOBAL_ORIGIN,
    COMMAND_EXTERNAL_POSITION_ESTIMATE,
    COMMAND_EXTERNAL_WIND_ESTIMATE,
)

ARRIVAL_TOPICS = (*sorted(AIDING), "system_flags", "command")

BIAS_RESETS = ("reset_accel_bias", "reset_gyro_bias")

ARRIVAL_FIELDS = (*ARRIVAL_TOPICS, *BIAS_RESETS)
"""What can arrive with an IMU sample, by number: samples, system flags, a command, the news of another sensor."""

ARRIVAL = np.dtype([("run", "i4"), ("field", "i4"), ("position", "i4")])
"""What arrives at a run: the number of its field in ARRIVAL_FIELDS, and its position in the array of its samples; of a
reset that is 1."""

IMU_ROW = np.dtype(
    [
        ("time_us", "i8"),
        ("delta_ang", "f4", (3,)),
        ("delta_vel", "f4", (3,)),
        ("delta_ang_dt", "f4"),
        ("delta_vel_dt", "f4"),
        ("delta_vel_clipping", "u1", (3,)),
    ],
    align=True,
)
"""An IMU_SAMPLE at half its size, for a flight has hundreds a second: PX4 gives all its figures single precision."""

IMU_ROWS_AT_ONCE = 1 << 16

COMMAND = np.dtype([("timestamp", "i8"), ("command", "i8"), ("param", "f8", (7,))], align=True)


class SampleArrays(NamedTuple):
    """The arrays that the compiled replay reads; `arrivals` stand in the order of their runs."""

    imu: np.ndarray
    arrivals: np.ndarray
    gnss: np.ndarray
    mag: np.ndarray
    baro: np.ndarray
    air_density: np.ndarray
    range: np.ndarray
    range_limits: np.ndarray
    flow: np.ndarray
    flow_limits: np.ndarray
    ev: np.ndarray
    airspeed: np.ndarray
    auxvel: np.ndarray
    system_flags: np.ndarray
    command: np.ndarray


def imu_samples(rows: np.ndarray) -> np.ndarray:
    """IMU_ROW → IMU_SAMPLE."""
    samples = np.zeros(len(rows), IMU_SAMPLE)
    for name in rows.dtype.names or ():
        samples[name] = rows[name]
    return samples


def without_arrivals(arrivals: np.ndarray, names: Collection[str], runs: np.ndarray) -> np.ndarray:
    """ARRIVAL of a flight without those of some fields at some runs; `runs` (N,) is true for these."""
    fields = [number for number, name in enumerate(ARRIVAL_FIELDS) if name in names]
    return arrivals[~(np.isin(arrivals["field"], fields) & runs[arrivals["run"]])]


def _arrivals(name: str, position: np.ndarray) -> np.ndarray:
    """What arrives in one field, given for every run, as ARRIVAL."""
    run = np.flatnonzero(position >= 0 if name in ARRIVAL_TOPICS else position)
    found = np.zeros(len(run), ARRIVAL)
    found["run"], found["position"] = run, position[run]
    found["field"] = ARRIVAL_FIELDS.index(name)
    return found


@dataclass(frozen=True)
class EstimatorInputs:
    """Samples of one flight and the order of their arrival."""

    flight: str
    mode: str
    """``"timestamps"`` or ``"approx"``, see `fusetune.ekf2.feed.arrival_order`."""
    arrays: SampleArrays
    parameter_changes: tuple[tuple[int, ParameterChange], ...]
    """(run, change): changes that the log records in flight, and the run before which each takes effect."""
    gnss_measured_us: np.ndarray | None = None
    """Times of measurement of `arrays.gnss` as their messages tell them, (samples,) int64; None where they do not."""
    memo: Memo = field(default_factory=Memo, init=False, repr=False, compare=False)
    """What replays of these samples have in common; inputs made of others by `dataclasses.replace` have their own."""


def build_inputs(flight: Flight) -> EstimatorInputs:
    """Collect the estimator's inputs from a canonical flight.

    Parameters
    ----------
    flight : Flight
        In the layout of `px4.layouts.release_layouts.canonical`; needs `sensor_combined`, all else is optional.

    Raises
    ------
    KeyError
        The flight has no `sensor_combined`.
    """
    runs = schedule_runs(flight)
    arrived, samples, beside = [], {}, {}
    for name, take in AIDING.items():
        one = take(flight, runs)
        arrived.append(_arrivals(name, one.arrival))
        samples[name], beside[name] = one.samples, one.beside
    for name, (samples[name], position) in (
        ("system_flags", _system_flags(flight, runs)),
        ("command", _commands(flight, runs)),
    ):
        arrived.append(_arrivals(name, position))
    arrived += [_arrivals(f"reset_{sensor}_bias", _bias_resets(flight, runs, sensor)) for sensor in ("accel", "gyro")]
    arrivals = np.concatenate(arrived)
    arrays = SampleArrays(
        imu=_imu_rows(flight.topics["sensor_combined", 0], runs.imu_rows),
        arrivals=arrivals[np.argsort(arrivals["run"], kind="stable")],
        air_density=beside["baro"],
        range_limits=beside["range"],
        flow_limits=beside["flow"],
        **samples,
    )
    changes = tuple(
        (int(np.searchsorted(runs.timestamp, change.timestamp)), change) for change in flight.parameters.changed
    )
    measured = convert.gnss_measurement_times(flight.topic(SENSORS["gnss"].topics[0].name))
    return EstimatorInputs(flight.name, runs.mode, arrays, changes, measured)


def _imu_rows(table: TopicTable, chosen: np.ndarray) -> np.ndarray:
    """Chosen rows of `sensor_combined` as IMU_ROW; the wide samples exist of some at a time."""
    rows = np.zeros(len(chosen), IMU_ROW)
    for first in range(0, len(chosen), IMU_ROWS_AT_ONCE):
        part = slice(first, first + IMU_ROWS_AT_ONCE)
        samples = convert.imu_samples(select_rows(table, chosen[part]))
        for name in IMU_ROW.names or ():
            rows[name][part] = samples[name]
    return rows


def _bias_resets(flight: Flight, runs: RunSchedule, sensor: str) -> np.ndarray:
    """Runs at which the accelerometer or gyro in use (`accel`, `gyro`), or its calibration, changes, (N,) bool."""
    imu = flight.topics["sensor_combined", 0]
    selection = flight.topic("sensor_selection")
    count = convert.column(imu, f"{sensor}_calibration_count", 0.0)[runs.imu_rows]
    reset = convert.changed_since_previous(count, 0.0)
    if selection is not None and f"{sensor}_device_id" in selection:
        newest = runs.newest_message("sensor_selection", selection["timestamp"])
        device = selection[f"{sensor}_device_id"].astype(np.int64)
        seen = np.flatnonzero(newest >= 0)
        reset[seen] |= convert.changed_since_previous(device[newest[seen]], 0.0)
    return reset


def _carried(flight: Flight, runs: RunSchedule, topic: str) -> tuple[np.ndarray, np.ndarray]:
    """For each run: row of the newest message so far (-1 before the first), and whether it is new."""
    table = flight.topic(topic)
    if table is None or not len(table["timestamp"]):
        nothing = np.full(len(runs.timestamp), -1)
        return nothing, nothing >= 0
    newest = runs.newest_message(topic, table["timestamp"])
    return np.maximum.accumulate(newest), newest >= 0


def _system_flags(flight: Flight, runs: RunSchedule) -> tuple[np.ndarray, np.ndarray]:
    """One sample whenever `vehicle_status` or `vehicle_land_detected` is new; messages over 3 s old are ignored.

    With it the position of the sample that arrives at each run, -1 for none.
    """
    status_row, status_new = _carried(flight, runs, "vehicle_status")
    land_row, land_new = _carried(flight, runs, "vehicle_land_detected")
    launch_row, _ = _carried(flight, runs, "launch_detection_status")
    at = np.flatnonzero(status_new | land_new)
    position = np.full(len(runs.timestamp), -1)
    position[at] = np.arange(len(at))
    samples = np.zeros(len(at), SYSTEM_FLAGS_SAMPLE)
    samples["time_us"] = runs.timestamp[at]
    samples["status_is_new"], samples["land_is_new"] = status_new[at], land_new[at]
    status = _fresh(flight, "vehicle_status", status_row[at], runs.timestamp[at])
    if status is not None:
        rows, table = status
        samples["in_air"][rows] = table["arming_state"] == ARMING_STATE_ARMED
        samples["is_fixed_wing"][rows] = convert_vehicle_type(table) == VEHICLE_TYPE_FIXED_WING
    land = _fresh(flight, "vehicle_land_detected", land_row[at], runs.timestamp[at])
    if land is not None:
        rows, table = land
        samples["at_rest"][rows] = convert.column(table, "at_rest", 0.0) > 0
        samples["in_air"][rows] = convert.column(table, "landed", 0.0) == 0
        samples["gnd_effect"][rows] = convert.column(table, "in_ground_effect", 0.0) > 0
    launch = _fresh(flight, "launch_detection_status", launch_row[at], runs.timestamp[at])
    if launch is not None:
        rows, table = launch
        samples["constant_pos"][rows] = table["launch_detection_state"] == LAUNCH_STATE_WAITING
    return samples, position


def convert_vehicle_type(table):  # type: ignore[no-untyped-def]
    """`vehicle_type` of `vehicle_status`; releases before it existed say `is_rotary_wing`."""
    if "vehicle_type" in table:
        return table["vehicle_type"]
    return np.where(convert.column(table, "is_rotary_wing", 1.0) > 0, 1, VEHICLE_TYPE_FIXED_WING)


def _fresh(flight: Flight, topic: str, rows: np.ndarray, now: np.ndarray):  # type: ignore[no-untyped-def]
    """(which samples, the message of each) for messages at most 3 s old; None without the topic."""
    table = flight.topic(topic)
    if table is None or not len(table["timestamp"]):
        return None
    fresh = (rows >= 0) & (now < table["timestamp"].astype(np.int64)[rows] + STATUS_MAX_AGE_US)
    return np.flatnonzero(fresh), {name: values[rows[fresh]] for name, values in table.items()}


def _commands(flight: Flight, runs: RunSchedule) -> tuple[np.ndarray, np.ndarray]:
    """Commands that move the estimator's origin, position or wind, and which of them arrives at each run."""
    table = flight.topic("vehicle_command")
    if table is None:
        return np.zeros(0, COMMAND), np.full(len(runs.timestamp), -1)
    commands = np.zeros(len(table["timestamp"]), COMMAND)
    commands["timestamp"] = table["timestamp"]
    commands["command"] = table["command"]
    for i in range(7):
        commands["param"][:, i] = convert.column(table, f"param{i + 1}")
    relevant = np.isin(commands["command"], ESTIMATOR_COMMANDS)
    return commands, only_usable(runs.newest_message("vehicle_command", table["timestamp"]), relevant)
