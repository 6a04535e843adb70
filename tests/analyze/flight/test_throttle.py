"""Throttle out of the topics of each release, by hand."""

import numpy as np
import pytest

from fusetune.analyze.flight.throttle import ASKED, throttle
from fusetune.px4.flight import Flight


def test_commands_of_each_release() -> None:
    """Means of 0.4 … 0.6 and 0.1 more; outputs of 1000 to 2000 µs are 0 to 1; thrust is up, z down."""
    stamps = np.arange(20, dtype=np.int64) * 100_000
    moving = np.linspace(0.4, 0.6, 20)
    motors = {"timestamp": stamps, "control[0]": moving, "control[1]": moving + 0.1, "control[2]": np.full(20, np.nan)}
    outputs = {"timestamp": stamps, "output[0]": 1000.0 + 1000.0 * moving, "output[1]": np.full(20, 1500.0)}
    setpoint = {"timestamp": stamps, "xyz[2]": -moving}
    for topics, expected in (
        ({("actuator_motors", 0): motors, ("actuator_outputs", 0): outputs}, moving + 0.05),
        ({("actuator_motors", 0): motors, ("vehicle_thrust_setpoint", 0): setpoint}, moving),
        ({("actuator_outputs", 0): outputs}, moving),
        ({("actuator_controls_0", 0): {"timestamp": stamps, "control[3]": moving}}, moving),
        ({("vehicle_thrust_setpoint", 0): setpoint}, moving),
    ):
        command = throttle(Flight("made", topics=topics))
        assert command is not None
        assert command.share == pytest.approx(expected)
    assert throttle(Flight("made")) is None


def test_of_what_px4_compensates_with_nothing_else_counts() -> None:
    stamps = np.arange(20, dtype=np.int64) * 100_000
    motors = {"timestamp": stamps, "control[0]": np.linspace(0.4, 0.6, 20)}
    assert throttle(Flight("made", topics={("actuator_motors", 0): motors}), ASKED) is None
