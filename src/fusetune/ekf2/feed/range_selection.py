"""Choose the range finder, and when the optical-flow sensor's distance stands in for it, as the EKF2 module does.

The first downward-facing `distance_sensor` instance that has just published is selected, and its message of that
moment is used up by the selection. One second without a message ends the selection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.ekf2.feed.arrival_order import RunSchedule
from fusetune.ekf2.feed.message_samples import flow_range_samples, range_refusals, range_samples, taken
from fusetune.ekf2.feed.sensor_samples import RANGE_SAMPLE
from fusetune.px4.flight import Flight, TopicTable

STALE_US = 100_000
RESELECT_AFTER_US = 1_000_000
MAX_INSTANCES = 4


@dataclass(frozen=True)
class RangeInputs:
    """Range samples in order of use."""

    samples: np.ndarray
    limits: np.ndarray
    """(n, 2) smallest and largest distance the sensor reports, m."""
    arrival: np.ndarray
    """(runs,) sample that arrives at each run, -1 for none."""


@dataclass
class _Selection:
    instance: int = -1
    last_update: int = 0


def select_range_samples(flight: Flight, runs: RunSchedule) -> RangeInputs:
    """Follow the module's choice through all runs at which a distance or flow message arrives."""
    tables = {i: table for i in range(MAX_INSTANCES) if (table := flight.topic("distance_sensor", i)) is not None}
    sensors = {i: _Sensor(table, runs) for i, table in tables.items()}
    flow = flight.topic("vehicle_optical_flow")
    flow_newest, flow_ranges = np.full(len(runs.timestamp), -1), None
    if flow is not None and "distance_m" in flow:
        flow_newest = runs.newest_message("vehicle_optical_flow", flow["timestamp"])
        flow_ranges = flow_range_samples(flow)
    busy = flow_newest >= 0
    for sensor in sensors.values():
        busy = busy | (sensor.newest >= 0)
    arrival = np.full(len(runs.timestamp), -1)
    samples: list[np.void] = []
    limits: list[np.ndarray] = []
    selection = _Selection()
    for run in np.flatnonzero(busy):
        now = int(runs.timestamp[run])
        if run > 0 and selection.last_update < int(runs.timestamp[run - 1]) - RESELECT_AFTER_US:
            selection.instance = -1
        if flow_ranges is not None and flow_newest[run] >= 0:
            row = int(flow_newest[run])
            if np.isfinite(flow_ranges[0]["range"][row]) and now > selection.last_update + RESELECT_AFTER_US:
                arrival[run] = len(samples)
                samples.append(flow_ranges[0][row])
                limits.append(flow_ranges[1][row])
        message = _distance_message(sensors, selection, int(run), now)
        if message is not None:
            instance, row = message
            arrival[run] = len(samples)
            samples.append(sensors[instance].samples[row])
            limits.append(sensors[instance].limits[row])
            selection.last_update = now
    return RangeInputs(
        np.array(samples, dtype=RANGE_SAMPLE) if samples else np.zeros(0, RANGE_SAMPLE),
        np.array(limits, dtype=np.float64).reshape(-1, 2),
        arrival,
    )


class _Sensor:
    """One instance of `distance_sensor`: its samples, and which of them is new at each run."""

    def __init__(self, table: TopicTable, runs: RunSchedule) -> None:
        self.timestamp = table["timestamp"].astype(np.int64)
        self.newest = runs.newest_message("distance_sensor", table["timestamp"])
        self.usable = taken(table, range_refusals(table))
        self.samples, self.limits = range_samples(table)


def _distance_message(sensors: dict[int, _Sensor], selection: _Selection, run: int, now: int) -> tuple[int, int] | None:
    """Instance and row of the message to use at this run; selects an instance where none is selected."""
    used_up = -1
    if selection.instance < 0:
        for instance, sensor in sensors.items():
            row = int(sensor.newest[run])
            if row < 0:
                continue
            timestamp = int(sensor.timestamp[row])
            if timestamp > now - STALE_US and sensor.usable[row]:
                selection.instance = used_up = instance
                selection.last_update = timestamp
                break
    instance = selection.instance
    if instance < 0 or instance == used_up:
        return None
    row = int(sensors[instance].newest[run])
    if row < 0 or not sensors[instance].usable[row]:
        return None
    return instance, row
