"""Sensors that repeat their last reading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.sensors.faults import Fault, SensorStuck, of_kind
from fusetune.px4.flight import TopicKey, TopicTable

TOPICS = {
    "magnetometer": "vehicle_magnetometer",
    "barometer": "vehicle_air_data",
    "gnss": "vehicle_gps_position",
    "range_finder": "distance_sensor",
}
STILL_MOVE = ("timestamp", "time_utc_usec")
"""Columns that begin so go on."""


def stick(topics: dict[TopicKey, TopicTable], takeoff_s: float, faults: Sequence[Fault]) -> None:
    """Let the readings of stuck sensors repeat, in place; a sensor that the vehicle does not have cannot be stuck."""
    for fault in of_kind(faults, SensorStuck):
        key = (TOPICS[fault.sensor], 0)
        if key not in topics:
            continue
        table = topics[key]
        stuck = fault.holds(table["timestamp"] * 1e-6 - takeoff_s)
        last_good = np.maximum.accumulate(np.where(stuck, 0, np.arange(len(stuck))))
        topics[key] = {
            name: values if name.startswith(STILL_MOVE) else values[last_good] for name, values in table.items()
        }
