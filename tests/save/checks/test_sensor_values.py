"""Values that no vehicle can have are told, and those that merely vibrate are not."""

from __future__ import annotations

import numpy as np
import pytest
from tests.save.made_flight import check_of, judged, made_flight


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
