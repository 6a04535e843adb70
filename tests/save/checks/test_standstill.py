"""What stands still is told, and what is merely quantised or quiet is not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.save.made_flight import LANDING_ROW, SLOW_HZ, TAKE_OFF_ROW, check_of, judged, made_flight

from fusetune.save.checks.standstill import standstill

if TYPE_CHECKING:
    from fusetune.px4.flight import Flight

STUCK = {
    "accelerometer_stuck": ("sensor_combined", ["accelerometer_m_s2[1]"], -0.25),
    "gyroscope_stuck": ("sensor_combined", [f"gyro_rad[{axis}]" for axis in range(3)], 0.0),
    "magnetometer_stuck": ("vehicle_magnetometer", ["magnetometer_ga[0]"], 0.2),
    "barometer_stuck": ("vehicle_air_data", ["baro_alt_meter"], 488.0),
    "gnss_stuck": ("vehicle_gps_position", ["latitude_deg", "longitude_deg"], 47.0),
}


def hold(flight: Flight, name: str, begin_s: float, end_s: float) -> None:
    """Let a sensor stand still between two times after the first sample."""
    topic, columns, value = STUCK[name]
    table = flight.topics[topic, 0]
    time_s = (table["timestamp"] - table["timestamp"][0]) * 1e-6
    for column in columns:
        table[column][(time_s >= begin_s) & (time_s < end_s)] = value


@pytest.mark.parametrize("name", STUCK)
def test_a_sensor_that_is_stuck_for_the_flight_refuses_it(name: str) -> None:
    flight = made_flight()
    assert check_of(flight, name).severity == "pass"
    hold(flight, name, 0.0, 60.0)
    check = check_of(flight, name)
    assert (check.severity, check.figure) == ("fail", pytest.approx(1.0))
    assert "holds one value" in check.found
    assert check.remedy
    assert judged(flight).status == "refused"


@pytest.mark.parametrize("name", STUCK)
def test_a_sensor_that_is_stuck_for_a_while_is_warned_of(name: str) -> None:
    """Ten of the thirty seconds in the air; the row before and the row behind differ."""
    flight = made_flight()
    hold(flight, name, 20.0, 30.0)
    check = check_of(flight, name)
    assert check.severity == "warning"
    assert check.figure == pytest.approx(10.0, abs=0.06)
    # the first sample of the made flight is at 1 s
    assert [check.start_us, check.stop_us] == pytest.approx([21_000_000, 31_000_000], abs=60_000)
    assert judged(flight).status == "replayable"


@pytest.mark.parametrize("name", STUCK)
def test_on_the_ground_sensors_may_stand_still(name: str) -> None:
    """12 s before take-off and 18 s behind the landing."""
    flight = made_flight()
    hold(flight, name, 0.0, TAKE_OFF_ROW / SLOW_HZ - 0.1)
    hold(flight, name, LANDING_ROW / SLOW_HZ + 0.1, 60.0)
    assert check_of(flight, name).severity == "pass"


@pytest.mark.parametrize("name", ["accelerometer_stuck", "barometer_stuck"])
def test_a_log_without_a_flight_is_not_refused_for_it(name: str) -> None:
    flight = made_flight()
    flight.topics["vehicle_land_detected", 0]["landed"][:] = True
    hold(flight, name, 0.0, 60.0)
    assert check_of(flight, name).severity == "warning"


def test_sensors_that_are_not_used_may_be_stuck() -> None:
    flight = made_flight()
    flight.parameters.initial |= {"EKF2_MAG_TYPE": 5, "EKF2_BARO_CTRL": 0, "EKF2_GPS_CTRL": 0}
    for name in ("magnetometer_stuck", "barometer_stuck", "gnss_stuck"):
        hold(flight, name, 0.0, 60.0)
        assert check_of(flight, name).severity == "does-not-apply"


def test_positions_without_a_fix_may_stand_still() -> None:
    flight = made_flight()
    hold(flight, "gnss_stuck", 0.0, 60.0)
    flight.topics["vehicle_gps_position", 0]["fix_type"][:] = 0
    assert check_of(flight, "gnss_stuck").severity == "does-not-apply"


def test_quantised_sensors_are_not_stuck() -> None:
    """A barometer in steps of a decimetre that takes each of them for four seconds."""
    flight = made_flight()
    baro = flight.topics["vehicle_air_data", 0]
    baro["baro_alt_meter"] = (np.arange(len(baro["timestamp"])) // (4 * SLOW_HZ) * 0.1).astype(np.float32)
    assert check_of(flight, "barometer_stuck").severity == "pass"


def test_standstills_are_measured_from_first_row_to_last() -> None:
    """Rows at 0, 1, 2 … s; the values 1 1 1 1 1 1 2 3 3: six rows span five seconds, two are too few."""
    table = {"timestamp": np.arange(9) * 1_000_000, "a": np.array([1, 1, 1, 1, 1, 1, 2, 3, 3.0])}
    found = standstill(table, ["a"], 2.0, np.ones(8, np.bool_))
    assert found == (5.0, 5.0 / 8.0, 1.0, 0, 5_000_000)
    flying = np.array([False] * 3 + [True] * 5)
    assert standstill(table, ["a"], 1.0, flying).longest_s == 0.0


def test_the_simulated_flight_passes(survey_flight: Flight) -> None:
    names = ("accelerometer_gravity", "imu_repeats", "magnetometer_strength", "imu_coverage", *STUCK)
    for check in judged(survey_flight).findings:
        assert check.id not in names or check.severity == "pass", check
