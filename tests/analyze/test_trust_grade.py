"""Grades from figures, by hand; and of a simulated flight whose log is whole, and thinned."""

import dataclasses

import numpy as np
import pytest

from fusetune.analyze.as_flown_figures import AsFlownFigures
from fusetune.analyze.reconstruction.reconstructed_flight import BARO, IMU, MAG
from fusetune.analyze.replay_flight import prepare
from fusetune.analyze.replay_settings import IN_USE
from fusetune.analyze.trust_grade import GNSS, distance, grade_flight, grade_of, with_half_the_gnss, without_repair
from fusetune.analyze.trust_settings import TrustSettings
from fusetune.errors import UserError
from fusetune.px4.estimator_instances import instance_shares, primary_magnetometer, rows_of_primary
from fusetune.px4.flight import Flight, row_count, select_rows
from fusetune.px4.release_layouts import canonical

SETTINGS = TrustSettings()
PERFECT = AsFlownFigures({"horizontal_velocity": 1.0}, 0.0, 0.0, 1.0, 60.0)


@pytest.mark.parametrize(
    ("figures", "grade"),
    [
        (PERFECT, "A"),
        (dataclasses.replace(PERFECT, innovation_ratio={"horizontal_velocity": 1.0, "heading": 1.5}), "B"),
        (dataclasses.replace(PERFECT, innovation_ratio={"heading": 1 / 1.5}), "B"),
        (dataclasses.replace(PERFECT, velocity_m_s=0.3), "C"),
        (dataclasses.replace(PERFECT, heading_deg=11.0), "D"),
        (dataclasses.replace(PERFECT, flags_equal=0.8), "C"),
        (dataclasses.replace(PERFECT, velocity_m_s=float("nan")), "D"),
        (AsFlownFigures({}, None, None, 1.0, 60.0), "D"),
    ],
)
def test_worst_figure_decides(figures, grade):
    assert grade_of(figures, SETTINGS)[0] == grade


def test_distance_is_one_at_the_limits_of_b():
    limit = AsFlownFigures({"heading": 1.6}, 0.15, 4.0, 0.9, 60.0)
    assert distance(PERFECT, SETTINGS) == 0.0
    assert distance(limit, SETTINGS) == pytest.approx(1.0)


def test_limits_must_rise():
    with pytest.raises(UserError, match="Expected three rising numbers"):
        TrustSettings.from_mapping({"heading_deg": [4, 2, 10]})


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


def test_whole_log_of_the_same_estimator_is_an_a(flight):
    grade = grade_flight(flight)
    assert grade.grade == "A", grade
    assert grade.reason == ""


def test_cause_that_was_put_in_is_the_one_that_is_found(flight):
    imu = flight.topics["sensor_combined", 0]
    lost = np.random.default_rng(1).random(len(imu["timestamp"])) < 0.06
    small = flight.with_topics(
        {key: table for key, table in flight.topics.items() if key[0] != "ekf2_timestamps"}
        | {("sensor_combined", 0): select_rows(imu, ~lost)}
    )
    grade = grade_flight(small)
    causes = {cause.cause: cause for cause in grade.causes if cause.measured}
    assert causes["missing IMU rows"].repaired
    assert causes["missing IMU rows"].cost > 0.1
    assert grade.grade <= grade.as_logged_grade


def test_switched_causes_are_the_flight_prepared_anew(flight):
    """What is taken from the prepared flight must be what preparing it with the switch gives.

    But for the magnetometer's noise, which is found by a replay of all sensors: it stays as it was found.
    """
    plain = dataclasses.replace(IN_USE.reconstruction, magnetometer_by_state=False)
    settings = dataclasses.replace(IN_USE, reconstruction=plain)
    imu = flight.topics["sensor_combined", 0]
    lost = np.random.default_rng(2).random(len(imu["timestamp"])) < 0.06
    thin = {(topic, 0): every_nth(flight, topic, 10) for topic in (MAG, BARO)}
    kept = {key: table for key, table in flight.topics.items() if key[0] != "ekf2_timestamps"}
    small = flight.with_topics(kept | thin | {(IMU, 0): select_rows(imu, ~lost)})
    in_use = prepare(small, settings.reconstruction, settings.start)
    assert {step.sensor for step in in_use.reconstructed.steps if step.done} == {IMU, MAG, BARO}
    for topic, switch in ((IMU, "imu"), (MAG, "magnetometer"), (BARO, "barometer")):
        anew = prepare(small, dataclasses.replace(settings.reconstruction, **{switch: False}), settings.start)
        assert_same_stream(without_repair(in_use, settings, topic), anew)
    halved = small.with_topics(small.topics | {(GNSS, 0): every_nth(small, GNSS, 2)})
    assert_same_stream(with_half_the_gnss(in_use, settings), prepare(halved, settings.reconstruction, settings.start))


def every_nth(flight, topic, step):
    table = flight.topics[topic, 0]
    return select_rows(table, np.arange(0, row_count(table), step))


def assert_same_stream(left, right):
    for name, array in left.inputs.arrays._asdict().items():
        other = getattr(right.inputs.arrays, name)
        for column in array.dtype.names or [...]:
            np.testing.assert_array_equal(array[column], other[column], err_msg=name)
    masks = left.reconstructed.measured, right.reconstructed.measured
    assert masks[0].keys() == masks[1].keys()
    for topic, mask in masks[0].items():
        np.testing.assert_array_equal(mask, masks[1][topic])
    assert left.start.why == right.start.why


def two_instances():
    time = 1_000_000 * np.arange(1, 11)
    status = {"timestamp": time, "mag_device_id": np.full(10, 11)}
    field = {f"magnetometer_ga[{axis}]": np.full(10, 0.1) for axis in range(3)}
    mag = {"timestamp": time + 10, "device_id": np.full(10, 11), **field}
    topics = {
        ("estimator_selector_status", 0): {
            "timestamp": np.array([1_000_000, 6_000_000]),
            "primary_instance": np.array([0, 1]),
        },
        ("estimator_status", 0): status,
        ("estimator_status", 1): status | {"mag_device_id": np.full(10, 22)},
        ("vehicle_magnetometer", 0): mag,
        ("vehicle_magnetometer", 1): mag | {"device_id": np.full(10, 22), "magnetometer_ga[0]": np.full(10, 0.2)},
        ("estimator_aid_src_gnss_vel", 0): {"timestamp": time, "innovation[0]": np.full(10, 1.0)},
        ("estimator_aid_src_gnss_vel", 1): {"timestamp": time, "innovation[0]": np.full(10, 2.0)},
    }
    return Flight("f", topics=topics, last_timestamp=11_000_000)


def test_magnetometer_follows_the_primary_instance():
    table = primary_magnetometer(two_instances())
    np.testing.assert_array_equal(table["magnetometer_ga[0]"], [0.1] * 5 + [0.2] * 5)


def test_estimator_topics_follow_the_primary_instance():
    table = rows_of_primary(two_instances(), "estimator_aid_src_gnss_vel")
    np.testing.assert_array_equal(table["innovation[0]"], [1.0] * 5 + [2.0] * 5)
    assert instance_shares(two_instances()) == {0: 0.5, 1: 0.5}


def test_canonical_follows_the_primary_instance_when_asked():
    flight = two_instances()
    followed = canonical(flight, follow_primary=True).topics["vehicle_magnetometer", 0]
    assert len(np.unique(followed["device_id"])) == 2
    assert len(np.unique(canonical(flight).topics["vehicle_magnetometer", 0]["device_id"])) == 1
