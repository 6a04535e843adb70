"""A saved flight is read no further than is asked for: some topics, and of these some columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fusetune.px4.flight import Flight
from fusetune.save.flight_folder import load_flight, write_flight


def test_columns_that_are_asked_for_and_the_time_are_read(tmp_path: Path) -> None:
    time = np.arange(3, dtype=np.int64)
    whole = {"timestamp": time, "q[0]": np.ones(3), "q[1]": np.zeros(3)}
    topics = {("vehicle_attitude", 0): whole, ("vehicle_status", 0): {"timestamp": time, "nav_state": np.ones(3)}}
    write_flight(tmp_path, Flight("made", topics=topics))
    flight = load_flight(tmp_path, {"vehicle_attitude": ("q[0]", "lacking"), "vehicle_status": None, "absent": None})
    assert {key: list(table) for key, table in flight.topics.items()} == {
        ("vehicle_attitude", 0): ["timestamp", "q[0]"],
        ("vehicle_status", 0): ["timestamp", "nav_state"],
    }
    assert list(load_flight(tmp_path, ("vehicle_attitude",)).topics["vehicle_attitude", 0]) == list(whole)
