"""A magnetometer that sits otherwise than its parameters say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.save.made_flight import judged, made_flight

from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.checks.judged_flight import JudgedFlight
from fusetune.save.checks.magnetometer_mounting import (
    QUARTER_TURNS,
    described,
    magnetometer_mounting,
    stillest_mounting,
)
from fusetune.save.thresholds import VerdictThresholds

EARTH = np.array([0.21, 0.02, 0.43])
TURNS = np.round(Rotation.create_group("O").as_matrix())
RANDOM = np.random.default_rng(11)
LEANING = Rotation.from_euler("ZYX", RANDOM.uniform([-3, -0.4, -0.4], [3, 0.4, 0.4], (200, 3)))
Q = LEANING.as_quat()[:, [3, 0, 1, 2]]
IN_BODY = LEANING.inv().apply(EARTH)


@given(st.integers(0, len(TURNS) - 1))
def test_every_quarter_turn_is_found(number):
    """Samples of a sensor turned by A are A m: turning them back leaves no scatter at all."""
    turn = TURNS[number]
    mounting, left = stillest_mounting(Q, IN_BODY @ turn.T)
    if np.trace(turn) == 3.0:
        assert left == 1.0
    else:
        assert left < 1e-9
    np.testing.assert_array_equal(mounting, turn)


def test_hard_iron_and_noise_are_no_other_mounting():
    disturbed = IN_BODY + np.array([0.1, -0.05, 0.08]) + 0.01 * RANDOM.standard_normal(IN_BODY.shape)
    _, left = stillest_mounting(Q, disturbed)
    assert left > 0.5


@pytest.mark.parametrize(
    ("angles", "expected"),
    [((90, 0, 0), "yaw 90°"), ((0, 0, 180), "roll 180°"), ((270, 0, 180), "roll 180°, yaw 270°")],
)
def test_turns_are_named_as_px4_names_them(angles, expected):
    assert described(Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()) == expected


def leaning_flight(turn):
    flight = made_flight()
    table = dict(flight.topics["vehicle_magnetometer", 0])
    time = table["timestamp"]
    share = np.arange(len(time)) / len(time)
    attitude = Rotation.from_euler("ZYX", np.stack([6 * share, 0.3 * np.sin(40 * share), 0.3 * np.cos(31 * share)], 1))
    field = attitude.inv().apply(EARTH) @ turn.T
    table |= {f"magnetometer_ga[{axis}]": field[:, axis].astype(np.float32) for axis in range(3)}
    q = attitude.as_quat()[:, [3, 0, 1, 2]] * np.where(np.arange(len(time)) % 7 < 3, 1.0, -1.0)[:, None]
    tilted = {"timestamp": time, **{f"q[{i}]": q[:, i].astype(np.float32) for i in range(4)}}
    return flight.with_topics(flight.topics | {("vehicle_magnetometer", 0): table, ("vehicle_attitude", 0): tilted})


def test_a_sensor_that_sits_as_told_passes():
    (check,) = [check for check in judged(leaning_flight(np.eye(3))).findings if check.id == "magnetometer_mounting"]
    assert check.severity == "pass"


def test_a_turned_sensor_is_told_with_its_turn():
    quarter = Rotation.from_euler("Z", 90, degrees=True).as_matrix()
    (check,) = [check for check in judged(leaning_flight(quarter)).findings if check.id == "magnetometer_mounting"]
    assert check.severity == "warning"
    assert "yaw 90°" in check.found
    assert "CAL_MAG0_ROT" in check.remedy


def test_only_gazebos_magnetometer_is_turned_among_the_shared_logs(shared_logs):
    """Gazebo's field turns as if its sensor sat a quarter turn off; those of real vehicles and TestFlight1 do not."""
    for stem, expected in (
        ("erdemarslan380__sitl_windy", "warning"),
        ("erdemarslan380__sitl_max_80", "warning"),
        ("JAParedes__TestFlight1", "pass"),
        ("SkyRats__log_8_2021-8-12-15-53-14", "pass"),
    ):
        flight = canonical(read_ulog(shared_logs / f"{stem}.ulg"))
        assert magnetometer_mounting.findings(JudgedFlight(flight, VerdictThresholds()))[0].severity == expected


def test_the_quarter_turns_are_the_rotations_of_a_cube():
    """SciPy's octahedral group."""
    ours = {tuple(turn.ravel()) for turn in np.round(QUARTER_TURNS)}
    assert ours == {tuple(turn.ravel() + 0.0) for turn in TURNS}


@given(st.integers(0, len(TURNS) - 1))
def test_names_give_the_rotation_back(number):
    turn = TURNS[number]
    words = {
        part.split()[0]: int(part.split()[1].removesuffix("°")) for part in described(turn).split(", ") if "°" in part
    }
    angles = [words.get(name, 0) for name in ("yaw", "pitch", "roll")]
    np.testing.assert_allclose(Rotation.from_euler("ZYX", angles, degrees=True).as_matrix(), turn, atol=1e-9)
