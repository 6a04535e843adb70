"""Delays of several flights joined, by hand calculation, and when a told one counts as wrong."""

from pathlib import Path

import pytest

from fusetune.analyze.delays.sensor_delays import SensorDelay
from fusetune.analyze.delays.settings import DelaySettings
from fusetune.analyze.delays.wrong_delays import (
    JoinedDelay,
    join_delays,
    joined,
    mended_values,
    read_joined,
    write_joined,
)
from fusetune.storage.documents import write_document

SETTINGS = DelaySettings()


def delay(value: float, error: float = 3.0, told: float = 110.0, sensor: str = "gnss") -> SensorDelay:
    parameter = {"gnss": "EKF2_GPS_DELAY", "range": "EKF2_RNG_DELAY"}[sensor]
    return SensorDelay(sensor, parameter, told, value, value - 2.0 * error, value + 2.0 * error, error, 300, 200.0)


def of_flights(*values: float, **changes: float) -> JoinedDelay:
    flights = {f"flight_{number}": (delay(value, **changes),) for number, value in enumerate(values)}
    (one,) = join_delays(flights, None, SETTINGS)
    return one


def test_flights_that_differ_no_more_than_their_errors_have_the_interval_of_these() -> None:
    """Errors √(4.5² + 2²) = 4.924 of three flights: 4.924/√3 = 2.843, times t(0.975; 2) = 4.3027 is 12.23."""
    mean, lower, upper = joined([200.0, 203.0, 206.0], [4.5, 4.5, 4.5])
    assert mean == pytest.approx(203.0)
    assert (mean - lower, upper - mean) == (pytest.approx(12.23, abs=0.01), pytest.approx(12.23, abs=0.01))


def test_flights_that_differ_by_more_have_the_interval_of_their_scatter() -> None:
    """Equal weights: the mean's error is s/√n = 40/√3 = 23.09, times 4.3027 is 99.4."""
    mean, lower, _ = joined([160.0, 200.0, 240.0], [3.0, 3.0, 3.0])
    assert mean == pytest.approx(200.0)
    assert mean - lower == pytest.approx(99.4, abs=0.1)


def test_a_delay_that_all_flights_contradict_is_wrong_and_mended_in_steps_of_an_update() -> None:
    one = of_flights(203.0, 205.0, 207.0, 204.0)
    assert one.is_wrong
    assert one.mended_ms == 200.0
    # (200 + 10) ms in updates of 8 ms, which count as 10, are 270
    assert mended_values([one]) == {"EKF2_GPS_DELAY": 200.0, "EKF2_DELAY_MAX": 270.0}


@pytest.mark.parametrize(
    "values",
    [
        (205.0,),  # one flight shows no scatter between flights
        (112.0, 108.0, 115.0, 109.0),  # right
        (121.0, 122.0, 123.0, 122.0),  # wrong by less than matters
        (60.0, 150.0, 200.0, 260.0),  # too scattered
    ],
)
def test_a_delay_is_not_called_wrong_without_proof(values: tuple[float, ...]) -> None:
    assert not of_flights(*values).is_wrong


def test_a_value_that_px4_does_not_take_is_brought_into_range() -> None:
    """EKF2_GPS_DELAY lies from 0 to 300 ms."""
    assert of_flights(-40.0, -41.0, -42.0, -39.0).mended_ms == 0.0
    assert not of_flights(-40.0, -41.0, -42.0, -39.0, told=0.0).is_wrong


def test_what_is_told_now_is_what_the_flight_of_the_present_parameters_was_told() -> None:
    flights = {"a": (delay(205.0, told=200.0),), "b": (delay(204.0),), "c": (delay(206.0),)}
    assert join_delays(flights, "c", SETTINGS)[0].is_wrong
    assert not join_delays(flights, "a", SETTINGS)[0].is_wrong


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    files = {}
    for name, value in (("a", 204.0), ("b", 206.0), ("c", 205.0)):
        files[name] = tmp_path / f"{name}.json"
        write_document(files[name], {"flight": name, "delays": [delay(value).document()]})
    found = write_joined(files, "c", SETTINGS, tmp_path / "delays.json")
    assert read_joined(tmp_path / "delays.json") == found
    assert found[0].flights == ("a", "b", "c")
