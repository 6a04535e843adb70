"""A sound flight, spoiled in one way each so that one row must see it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.health_table import health_rows
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight, TopicTable, select_rows

Spoil = Callable[[Flight], Flight]


def rows_of(flight: Flight) -> dict[str, HealthRow]:
    return {row.finding.id: row for row in health_rows(ObservedFlight(flight))}


def window(flight: Flight) -> tuple[int, int]:
    """Ten seconds in the middle of the flight, µs."""
    start, stop = ObservedFlight(flight).clear_of_ground[0]
    return (start + stop) // 2, (start + stop) // 2 + 10_000_000


def within(flight: Flight, table: TopicTable) -> np.ndarray:
    start, stop = window(flight)
    return (table["timestamp"] >= start) & (table["timestamp"] < stop)


def changed(flight: Flight, topic: str, change: Callable[[TopicTable, np.ndarray], TopicTable]) -> Flight:
    table = {name: values.copy() for name, values in flight.topics[topic, 0].items()}
    return flight.with_topics(flight.topics | {(topic, 0): change(table, within(flight, table))})


def frozen(*columns: str) -> Callable[[TopicTable, np.ndarray], TopicTable]:
    def change(table: TopicTable, rows: np.ndarray) -> TopicTable:
        for name in columns:
            table[name][rows] = table[name][np.argmax(rows)]
        return table

    return change


def test_the_sound_flight_has_neither_warnings_nor_failures(survey_flight: Flight) -> None:
    rows = rows_of(survey_flight)
    assert not {name for name, row in rows.items() if row.finding.severity in ("warning", "fail")}
    assert {row.origin for row in rows.values()} == {"vehicle"}
    assert rows["gnss.drift_horizontal"].finding.severity == "pass"


@pytest.mark.parametrize(
    ("topic", "columns", "row"),
    [
        ("vehicle_magnetometer", [f"magnetometer_ga[{axis}]" for axis in range(3)], "mag.stuck_s"),
        ("vehicle_air_data", ["baro_alt_meter"], "baro.stuck_s"),
        (
            "vehicle_gps_position",
            ["latitude_deg", "longitude_deg", "altitude_msl_m", *(f"vel_{axis}_m_s" for axis in "ned")],
            "gps.stuck_s",
        ),
        ("sensor_combined", ["gyro_rad[1]"], "imu.stuck_s"),
    ],
)
def test_a_sensor_that_repeats_one_value_is_stuck(
    survey_flight: Flight, topic: str, columns: list[str], row: str
) -> None:
    found = rows_of(changed(survey_flight, topic, frozen(*columns)))[row].finding
    assert found.severity == ("warning" if topic == "sensor_combined" else "fail")
    assert found.figure == pytest.approx(10.0, abs=0.5)
    start, stop = window(survey_flight)
    assert abs(found.start_us - start) < 500_000
    assert abs(found.stop_us - stop) < 500_000


def test_a_barometer_that_always_repeats_its_values_is_not_stuck(survey_flight: Flight) -> None:
    """One that is read faster than it measures: pairs and triples of equal values are its habit."""

    def coarse(table: TopicTable, rows: np.ndarray) -> TopicTable:
        table["baro_alt_meter"] = np.repeat(table["baro_alt_meter"][::30], 30)[: len(rows)]
        return table

    found = rows_of(changed(survey_flight, "vehicle_air_data", coarse))["baro.stuck_s"].finding
    assert found.figure > 1.0
    assert found.severity == "pass"


def test_messages_that_do_not_come_are_a_gap(survey_flight: Flight) -> None:
    lost = changed(survey_flight, "vehicle_gps_position", lambda table, rows: select_rows(table, ~rows))
    found = rows_of(lost)["gps.longest_gap_s"].finding
    assert (found.severity, found.figure) == ("warning", pytest.approx(10.0, abs=0.5))


def test_poor_gnss_is_a_failure_where_half_the_flight_is_and_a_warning_where_a_tenth_is(survey_flight: Flight) -> None:
    def poor(table: TopicTable, rows: np.ndarray) -> TopicTable:
        table["eph"][rows] = 4.0
        return table

    some = rows_of(changed(survey_flight, "vehicle_gps_position", poor))["gnss.eph"].finding
    assert (some.severity, some.figure, some.threshold) == ("warning", 4.0, 3.0)
    all_ = changed(survey_flight, "vehicle_gps_position", lambda table, rows: poor(table, np.ones(len(rows), bool)))
    assert rows_of(all_)["gnss.eph"].finding.severity == "fail"
    # without its bit in EKF2_GPS_CHECK EKF2 does not look at it
    history = replace(all_.parameters, initial=all_.parameters.initial | {"EKF2_GPS_CHECK": 0})
    assert rows_of(replace(all_, parameters=history))["gnss.eph"].finding.severity == "warning"


def unaided(flight: Flight, says_so: bool) -> Flight:
    """Ten seconds without a fused sample of GNSS, while samples go on to come and be rejected."""
    for source in ("gnss_vel", "gnss_pos"):

        def reject(table: TopicTable, rows: np.ndarray) -> TopicTable:
            table["fused"][rows], table["innovation_rejected"][rows] = False, True
            last = table["timestamp_sample"][np.argmax(rows)]
            if "time_last_fuse" in table:
                table["time_last_fuse"][rows] = last
            return table

        flight = changed(flight, f"estimator_aid_src_{source}", reject)
    start, stop = window(flight)
    flags = flight.topics["estimator_status_flags", 0]
    # flags are logged at their changes: rows of the change and of the return
    rows = np.maximum(np.searchsorted(flags["timestamp"], [start, stop], side="right") - 1, 0)
    added = {name: values[rows] for name, values in flags.items()}
    added |= {"timestamp": np.array([start, stop]), "cs_inertial_dead_reckoning": np.array([says_so, False])}
    if "cs_inertial_dead_reckoning" not in flags:
        flags = flags | {"cs_inertial_dead_reckoning": np.zeros(len(flags["timestamp"]), bool)}
    flags = flags | {
        "cs_inertial_dead_reckoning": flags["cs_inertial_dead_reckoning"] | within(flight, flags) & says_so
    }
    joined = {name: np.r_[values, added[name]] for name, values in flags.items()}
    order = np.argsort(joined["timestamp"], kind="stable")
    return flight.with_topics(flight.topics | {("estimator_status_flags", 0): select_rows(joined, order)})


def test_loss_of_aiding_that_the_filter_does_not_say_is_a_failure(survey_flight: Flight) -> None:
    rows = rows_of(unaided(survey_flight, says_so=False))
    assert rows["aiding.longest_unaided_s"].finding.severity == "fail"
    assert rows["aiding.longest_unaided_s"].finding.figure == pytest.approx(10.0, abs=0.5)
    # a second passes before EKF2 could say it
    assert rows["aiding.unflagged_loss_s"].finding.figure == pytest.approx(8.8, abs=0.5)
    assert rows["aiding.unflagged_loss_s"].finding.severity == "fail"
    assert rows["gnss_pos.longest_unfused_s"].finding.severity == "warning"


def test_loss_of_aiding_that_it_says_is_none_of_that_kind(survey_flight: Flight) -> None:
    rows = rows_of(unaided(survey_flight, says_so=True))
    assert rows["aiding.longest_unaided_s"].finding.severity == "fail"
    assert rows["aiding.unflagged_loss_s"].finding.figure == pytest.approx(0.0, abs=0.1)


def test_a_selector_that_goes_back_and_forth(survey_flight: Flight) -> None:
    start, _ = window(survey_flight)
    times = np.r_[survey_flight.start_timestamp, start + np.arange(5) * 1_500_000].astype(np.int64)
    selector = {"timestamp": times, "primary_instance": np.array([0, 1, 0, 1, 0, 1], np.uint8)}
    rows = rows_of(survey_flight.with_topics(survey_flight.topics | {("estimator_selector_status", 0): selector}))
    assert (rows["instances.switches"].finding.figure, rows["instances.switches"].finding.severity) == (5.0, "warning")
    assert (rows["instances.whipsaw"].finding.figure, rows["instances.whipsaw"].finding.severity) == (5.0, "fail")
    assert rows["instances.whipsaw"].finding.start_us == start


def test_two_receivers_of_which_one_is_worse(survey_flight: Flight) -> None:
    own = survey_flight.topics["vehicle_gps_position", 0]
    worse = own | {"eph": own["eph"] * 5.0, "latitude_deg": own["latitude_deg"] + 2.0 / 111_195.0}
    both = {("sensor_gps", 0): own, ("sensor_gps", 1): worse}
    two = survey_flight.with_topics(survey_flight.topics | both)
    rows = rows_of(two)
    assert rows["receivers.count"].finding.figure == 2.0
    assert rows["receivers.accuracy_ratio"].finding.figure == pytest.approx(5.0)
    assert rows["receivers.apart_m"].finding.figure == pytest.approx(2.0, rel=1e-3)
    # without blending the difference harms nothing
    assert rows["receivers.accuracy_ratio"].finding.severity == "pass"
    history = replace(two.parameters, initial=two.parameters.initial | {"SENS_GPS_MASK": 7})
    assert rows_of(replace(two, parameters=history))["receivers.accuracy_ratio"].finding.severity == "warning"
