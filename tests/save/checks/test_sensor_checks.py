"""What stands still or cannot be is told, and what is merely quantised or quiet is not."""

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


@pytest.mark.parametrize(
    ("factor", "status"),
    [
        (0.0, "fail"),
        (1 / 9.80665, "fail"),  # g
        (1000 / 9.80665, "fail"),  # milli-g; all of it is beyond what a sensor can say, too
        (0.85, "warning"),
        (0.95, "pass"),
        (1.25, "pass"),
        (1.4, "warning"),
        (3.2808, "fail"),  # feet
    ],
)
def test_accelerometers_see_gravity(factor: float, status: str) -> None:
    flight = made_flight()
    imu = flight.topics["sensor_combined", 0]
    for axis in range(3):
        imu[f"accelerometer_m_s2[{axis}]"] *= np.float32(factor)
    verdict = judged(flight)
    if factor > 100.0:
        assert verdict.status == "refused"
        return
    check = check_of(flight, "accelerometer_gravity")
    assert check.severity == status
    assert check.figure == pytest.approx(factor * 9.81 / 9.80665, rel=1e-3)
    assert ("m/s²" in check.remedy) == (status != "pass")


def test_vibration_hides_gravity_from_no_one() -> None:
    """Two g at 50 Hz raise the mean of the strength beyond the limit, but not the strength of the mean."""
    flight = made_flight()
    imu = flight.topics["sensor_combined", 0]
    seconds = imu["timestamp"] * 1e-6
    for axis in range(3):
        imu[f"accelerometer_m_s2[{axis}]"] += (20.0 * np.sin(2 * np.pi * 50.0 * seconds + axis)).astype(np.float32)
    assert check_of(flight, "accelerometer_gravity").severity == "pass"


@pytest.mark.parametrize("column", ["gyro_integral_dt", "accelerometer_integral_dt"])
@pytest.mark.parametrize(
    ("factor", "status", "words"),
    [
        (1.01, "pass", ""),
        (1.05, "warning", "do not fit its time stamps"),
        (2.0, "fail", "do not fit its time stamps"),
        (100.0, "fail", "do not fit its time stamps"),
    ],
)
def test_integration_times_fit_the_time_stamps(column: str, factor: float, status: str, words: str) -> None:
    flight = made_flight()
    imu = flight.topics["sensor_combined", 0]
    imu[column] = np.round(imu[column] * factor).astype(np.uint32)
    check = check_of(flight, "imu_coverage")
    assert (check.severity, check.figure) == (status, pytest.approx(factor, rel=1e-3))
    assert words in check.found


def test_integration_times_in_milliseconds_are_told_from_lost_samples() -> None:
    flight = made_flight()
    for column in ("gyro_integral_dt", "accelerometer_integral_dt"):
        flight.topics["sensor_combined", 0][column][:] = 5
    reason = judged(flight).reasons[0]
    assert "not in microseconds (5)" in reason


def test_imu_samples_that_are_logged_twice() -> None:
    flight = made_flight()
    imu = flight.topics["sensor_combined", 0]
    again = np.arange(len(imu["timestamp"])) // 10 * 10 + np.maximum(np.arange(len(imu["timestamp"])) % 10, 1)
    for column in imu:
        if column.startswith(("gyro_rad", "accelerometer_m_s2")):
            imu[column] = imu[column][again]
    check = check_of(flight, "imu_repeats")
    assert (check.severity, check.figure) == ("warning", pytest.approx(0.1, abs=0.01))


@pytest.mark.parametrize(
    ("factor", "status"),
    [(1.0, "pass"), (1e-4, "warning"), (0.0, "warning"), (3.5, "warning")],  # Gauss, tesla, nothing, a magnet
)
def test_the_field_is_the_earths(factor: float, status: str) -> None:
    """The field of the made flight is 0.21, 0.01, 0.43 Gs."""
    flight = made_flight()
    table = flight.topics["vehicle_magnetometer", 0]
    for axis in range(3):
        table[f"magnetometer_ga[{axis}]"] *= np.float32(factor)
    check = check_of(flight, "magnetometer_strength")
    strength = factor * float(np.linalg.norm([0.21, 0.01, 0.43]))
    assert (check.severity, check.figure) == (status, pytest.approx(strength, rel=0.01, abs=1e-9))


def test_the_simulated_flight_passes(survey_flight: Flight) -> None:
    names = ("accelerometer_gravity", "imu_repeats", "magnetometer_strength", "imu_coverage", *STUCK)
    for check in judged(survey_flight).findings:
        assert check.id not in names or check.severity == "pass", check
