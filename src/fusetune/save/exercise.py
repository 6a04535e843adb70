"""What a saved flight exercises, as far as its folder tells without a replay."""

from __future__ import annotations

import numpy as np

from fusetune.design.around_present import Exercise
from fusetune.save.flight_folder import load_flight, read_metadata
from fusetune.storage.files import AnyPath

_REPORTED = {"eph": "gnss_position_accuracy", "epv": "gnss_height_accuracy", "s_variance_m_s": "gnss_speed_accuracy"}
"""Field of `vehicle_gps_position` → the check whose figure is its median."""
_RATES = {"vehicle_angular_velocity": "xyz", "sensor_combined": "gyro_rad"}
"""Topic → field of the angular velocity in the body frame, rad/s; the first that is there."""
_SHARE = 95.0
"""Percentile of the rates: what is turned now and then is exercised, a single sample is not."""


def exercise_of(folder: AnyPath) -> Exercise:
    """What the flight in a folder exercises.

    Raises
    ------
    UserError
        The folder is not one of a saved flight, or a file in it is damaged.
    """
    metadata = read_metadata(folder)
    figures = {one["id"]: one["figure"] for one in metadata["verdict"]["findings"]}
    reported = {field: figures[check] for field, check in _REPORTED.items() if figures.get(check) is not None}
    topics = frozenset(entry["topic"] for entry in metadata["topics"] if entry["rows"])
    return Exercise(topics, metadata["ekf2_parameters"], reported, _turning(folder))


def _turning(folder: AnyPath) -> tuple[float, float, float]:
    flight = load_flight(folder, tuple(_RATES))
    for topic, field in _RATES.items():
        table = flight.topic(topic)
        if table is not None and f"{field}[0]" in table and len(table["timestamp"]):
            rates = np.column_stack([np.asarray(table[f"{field}[{axis}]"], float) for axis in range(3)])
            rates = rates[np.isfinite(rates).all(axis=1)]
            if len(rates):
                x, y, z = (rates**2).T
                across = (np.sqrt(y + z), np.sqrt(x + z), np.sqrt(x + y))
                first, second, third = (float(np.percentile(one, _SHARE)) for one in across)
                return first, second, third
    return 0.0, 0.0, 0.0
