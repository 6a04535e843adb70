"""Choose the range finder, and when the optical-flow sensor's distance stands in for it, as the EKF2 module does.

The first downward-facing `distance_sensor` instance that has just published is selected, and its message of that
moment is used up by the selection. One second without a message ends the selection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.ekf2.arrival_order import RunSchedule
from fusetune.ekf2.message_samples import column, sample_time
from fusetune.ekf2.sensor_samples import RANGE_SAMPLE
from fusetune.px4.flight import Flight, TopicTable

ROTATION_DOWNWARD_FACING = 25
STALE_US = 100_000
RESELECT_AFTER_US = 1_000_000
MAX_INSTANCES = 4
FLOW_QUALITY_MAX = 255.0


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
    newest = {i: runs.newest_message("distance_sensor", table["timestamp"]) for i, table in tables.items()}
    flow = flight.topic("vehicle_optical_flow")
    flow_newest = np.full(len(runs.timestamp), -1)
    if flow is not None and "distance_m" in flow:
        flow_newest = runs.newest_message("vehicle_optical_flow", flow["timestamp"])
    busy = flow_newest >= 0
    for arrival in newest.values():
        busy = busy | (arrival >= 0)
    arrival = np.full(len(runs.timestamp), -1)
    rows: list[tuple[int, float, int]] = []
    limits: list[tuple[float, float]] = []
    selection = _Selection()
    for run in np.flatnonzero(busy):
        now = int(runs.timestamp[run])
        if run > 0 and selection.last_update < int(runs.timestamp[run - 1]) - RESELECT_AFTER_US:
            selection.instance = -1
        if flow is not None and flow_newest[run] >= 0:
            distance = float(flow["distance_m"][flow_newest[run]])
            if np.isfinite(distance) and now > selection.last_update + RESELECT_AFTER_US:
                arrival[run] = len(rows)
                rows.append(_flow_range(flow, int(flow_newest[run]), distance))
                limits.append(_row_limits(flow, int(flow_newest[run]), "min_ground_distance", "max_ground_distance"))
        message = _distance_message(tables, newest, selection, int(run), now)
        if message is not None:
            instance, row = message
            arrival[run] = len(rows)
            rows.append(_distance_range(tables[instance], row))
            limits.append(_row_limits(tables[instance], row, "min_distance", "max_distance"))
            selection.last_update = now
    samples = np.array(rows, dtype=RANGE_SAMPLE) if rows else np.zeros(0, RANGE_SAMPLE)
    return RangeInputs(samples, np.array(limits, dtype=np.float64).reshape(-1, 2), arrival)


def _distance_message(
    tables: dict[int, TopicTable], newest: dict[int, np.ndarray], selection: _Selection, run: int, now: int
) -> tuple[int, int] | None:
    """Instance and row of the message to use at this run; selects an instance where none is selected."""
    used_up = -1
    if selection.instance < 0:
        for instance, table in tables.items():
            row = int(newest[instance][run])
            if row < 0:
                continue
            timestamp = int(table["timestamp"][row])
            if timestamp > now - STALE_US and int(table["orientation"][row]) == ROTATION_DOWNWARD_FACING:
                selection.instance = used_up = instance
                selection.last_update = timestamp
                break
    instance = selection.instance
    if instance < 0 or instance == used_up:
        return None
    row = int(newest[instance][run])
    if row < 0 or int(tables[instance]["orientation"][row]) != ROTATION_DOWNWARD_FACING:
        return None
    return instance, row


def _distance_range(table: TopicTable, row: int) -> tuple[int, float, int]:
    quality = int(table["signal_quality"][row]) if "signal_quality" in table else -1
    return int(table["timestamp"][row]), float(table["current_distance"][row]), quality


def _flow_range(table: TopicTable, row: int, distance: float) -> tuple[int, float, int]:
    quality = int(float(table["quality"][row]) / FLOW_QUALITY_MAX * 100.0)
    return int(sample_time(table)[row]), distance, quality


def _row_limits(table: TopicTable, row: int, low: str, high: str) -> tuple[float, float]:
    return float(column(table, low)[row]), float(column(table, high)[row])
