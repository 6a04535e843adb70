"""Grades from figures, by hand; and of a simulated flight whose log is whole, and thinned."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.analyze.analyze_flight import COMPARED_TOPICS
from fusetune.analyze.reconstruction.reconstructed_flight import BARO, IMU, MAG
from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare
from fusetune.analyze.replaying.settings import IN_USE, StartSettings
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, AsFlownReplay, distance
from fusetune.analyze.trust.as_flown_figures import AsFlownFigures, compared_rows
from fusetune.analyze.trust.grade import TRUST_TOPICS, grade_flight, grade_of
from fusetune.analyze.trust.grade_causes import GNSS, cost_of, with_half_the_gnss, without_repair
from fusetune.analyze.trust.settings import FIGURES, TrustSettings
from fusetune.analyze.trust.words import limits_of_grade, not_compared
from fusetune.px4.flight import Flight, row_count, select_rows
from fusetune.px4.layouts.estimator_instances import (
    instance_shares,
    of_one_instance,
    primary_magnetometer,
    rows_of_primary,
)
from fusetune.px4.layouts.release_layouts import canonical

SETTINGS = TrustSettings()
PERFECT = AsFlownFigures({"horizontal_velocity": 1.0}, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 60.0, {"height": (0, 0)})
NOTHING = AsFlownFigures({}, None, None, None, None, None, None, 60.0, {})


def changed(**figures):
    return dataclasses.replace(PERFECT, **figures)


@pytest.mark.parametrize(
    ("figures", "grade"),
    [
        (PERFECT, "A"),
        (changed(innovation_ratio={"horizontal_velocity": 1.0, "heading": 1.5}), "B"),
        (changed(innovation_ratio={"heading": 1 / 1.5}), "B"),
        (changed(velocity_m_s=0.3), "C"),
        (changed(heading_deg=11.0), "D"),
        (changed(height_m=0.5), "B"),
        (changed(vertical_velocity_m_s=0.7), "D"),
        (changed(resets={"height": (2, 2), "vertical velocity": (3, 2)}), "B"),
        (changed(resets={"height": (144, 0), "vertical velocity": (0, 0)}), "D"),
        (changed(flags_equal=0.8), "C"),
        (changed(height_flags_equal=0.46), "D"),
        (changed(velocity_m_s=float("nan")), "D"),
        (dataclasses.replace(NOTHING, flags_equal=1.0), "D"),
    ],
)
def test_worst_figure_decides(figures, grade):
    assert grade_of(figures, SETTINGS).grade == grade


@pytest.mark.parametrize(
    ("figures", "grade", "missing"),
    [
        # all that can be said of many a simulation with hardware in the loop
        (dataclasses.replace(NOTHING, velocity_m_s=0.0, heading_deg=0.0), "C", 6),
        (changed(innovation_ratio={}), "B", 1),
        (changed(heading_deg=None), "B", 1),
        (changed(velocity_m_s=None), "C", 1),
        (changed(height_m=None, vertical_velocity_m_s=None), "C", 2),
        (changed(resets={}), "C", 1),
        (changed(velocity_m_s=None, heading_deg=None, resets={"height": (144, 0)}), "D", 2),
        (NOTHING, "D", len(FIGURES)),
    ],
)
def test_what_could_not_be_compared_limits_the_grade(figures, grade, missing):
    graded = grade_of(figures, SETTINGS)
    assert graded.grade == grade
    assert len(graded.not_compared) == missing
    assert not set(graded.not_compared) & graded.figure_grades.keys()


def test_what_does_not_speak_for_a_replay_may_speak_against_it():
    flags = dataclasses.replace(NOTHING, flags_equal=1.0, height_flags_equal=0.95)
    assert not grade_of(flags, SETTINGS).is_compared
    assert not grade_of(NOTHING, SETTINGS).is_compared
    assert grade_of(dataclasses.replace(flags, resets={"height": (144, 0)}), SETTINGS).is_compared
    assert grade_of(PERFECT, SETTINGS).is_compared


@given(st.sets(st.sampled_from(FIGURES)))
def test_a_figure_less_never_betters_the_grade(names):
    less = changed(
        **{name: None for name in names if name not in ("innovation_factor", "height_resets")},
        **({"innovation_ratio": {}} if "innovation_factor" in names else {}),
        **({"resets": {}} if "height_resets" in names else {}),
    )
    graded = grade_of(less, SETTINGS)
    assert set(graded.not_compared) == names
    assert graded.grade >= grade_of(PERFECT, SETTINGS).grade
    assert (graded.grade == "A") == (not names)


def test_limits_name_the_resets_and_what_could_not_be_compared():
    figures = changed(velocity_m_s=None, resets={"height": (144, 0), "vertical velocity": (1, 1)})
    (resets,) = limits_of_grade(figures, ["height_resets"], "D", SETTINGS)
    assert resets.found == "the replay resets its height 144 times where the vehicle did so 0 times"
    # a C would have been given for up to three
    assert (resets.id, resets.severity, resets.figure, resets.threshold) == ("height_resets", "fail", 144, 3.0)
    assert not_compared(["velocity_m_s"]).found == "the log does not let horizontal velocity be compared"
    assert not_compared(["velocity_m_s", "heading_deg", "flags_equal"]).found == (
        "the log does not let horizontal velocity, heading and flags be compared"
    )
    worst = changed(innovation_ratio={"heading": 0.5, "vision_position": 1.8}, resets={"vertical velocity": (1, 4)})
    assert [limit.found for limit in limits_of_grade(worst, FIGURES, "B", SETTINGS)][:3] == [
        "the replay resets its vertical velocity once where the vehicle did so 4 times",
        "the replay takes its height from the vehicle's sources in only 100% of the time",
        "innovations of heading are 0.5 times the vehicle's",
    ]


def test_distance_is_one_at_the_limits_of_b():
    limit = AsFlownFigures({"heading": 1.6}, 0.15, 4.0, 1.0, 0.225, 0.9, 0.9, 60.0, {})
    assert distance(PERFECT, SETTINGS) == 0.0
    assert distance(limit, SETTINGS) == pytest.approx(1.0)


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


def test_whole_log_of_the_same_estimator_is_an_a(flight):
    grade = grade_flight(prepare(flight, IN_USE.reconstruction, IN_USE.start))
    assert grade.grade == "A", grade
    assert grade.reason == ""


def test_what_is_at_hand_or_known_is_not_replayed_again(flight, monkeypatch):
    """A whole log that is replayed from nothing: as it was logged it is what is in use."""
    prepared = prepare(flight, IN_USE.reconstruction, StartSettings(mode="cold"))
    kept = prepared.replay(prepared.parameters({}), keep=compared_rows(onboard_samples(flight)))
    replays, replay = [], PreparedFlight.replay
    monkeypatch.setattr(PreparedFlight, "replay", lambda *args, **named: replays.append(1) or replay(*args, **named))
    anew = grade_flight(prepared)
    assert len(replays) == 1
    comparison = AsFlownComparison(flight, SETTINGS)
    comparison.figures(prepared, AsFlownReplay(*kept))
    assert grade_flight(prepared, comparison=comparison) == anew
    assert len(replays) == 1
    warm = grade_flight(prepare(flight, IN_USE.reconstruction, StartSettings(mode="warm")))
    assert warm.start.startswith("warm")
    assert [cost_of(one) for one in warm.causes] == [
        distance(warm.as_logged, SETTINGS) - distance(warm.repaired, SETTINGS)
    ]
    # the one in use, and from nothing as the log is; what the start from nothing costs is known by then
    assert len(replays) == 3


def test_cause_that_was_put_in_is_the_one_that_is_found(flight):
    imu = flight.topics["sensor_combined", 0]
    lost = np.random.default_rng(1).random(len(imu["timestamp"])) < 0.06
    small = flight.with_topics(
        {key: table for key, table in flight.topics.items() if key[0] != "ekf2_timestamps"}
        | {("sensor_combined", 0): select_rows(imu, ~lost)}
    )
    grade = grade_flight(prepare(small, IN_USE.reconstruction, IN_USE.start))
    causes = {cause.found: cause for cause in grade.causes if cause.evidence["measured"]}
    assert causes["missing IMU rows"].evidence["repaired"]
    assert causes["missing IMU rows"].id == "imu_coverage"
    assert cost_of(causes["missing IMU rows"]) > 0.1
    assert grade.reason.startswith("; ".join(limit.found for limit in grade.limits))
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


def test_flight_of_one_instance_has_what_that_one_used():
    one = of_one_instance(two_instances())
    assert canonical(one).topics["vehicle_magnetometer", 0]["device_id"].tolist() == [11] * 10
    assert {instance for name, instance in one.topics if name.startswith("estimator_")} == {0}


def with_two_imus(flight):
    """`vehicle_imu` of two devices at 200 Hz; the second instance of the estimator uses the second."""
    time = np.arange(1_000_000, 11_000_000, 5_000)
    rows = len(time)
    columns = {f"delta_angle[{axis}]": np.zeros(rows, np.float32) for axis in range(3)}
    columns |= {f"delta_velocity[{axis}]": np.zeros(rows, np.float32) for axis in range(3)}
    columns |= {"delta_angle_dt": np.full(rows, 5000, np.uint16), "delta_velocity_dt": np.full(rows, 5000, np.uint16)}
    topics = dict(flight.topics)
    for instance, device in ((0, 101), (1, 102)):
        used = np.full(10, device)
        topics["estimator_status", instance] = topics["estimator_status", instance] | {"accel_device_id": used}
        imu = columns | {"timestamp": time + instance, "timestamp_sample": time + instance}
        topics["vehicle_imu", instance] = imu | {"accel_device_id": np.full(rows, device, np.uint32)}
    gyro = {f"gyro_rad[{axis}]": np.zeros(10, np.float32) for axis in range(3)}
    force = {f"accelerometer_m_s2[{axis}]": np.zeros(10, np.float32) for axis in range(3)}
    slow = {"timestamp": 1_000_000 * np.arange(1, 11), "gyro_integral_dt": np.full(10, 5000, np.uint32)}
    topics["sensor_combined", 0] = slow | gyro | force
    return flight.with_topics(topics)


def test_replay_scores_and_grade_of_a_flight_see_the_same_sensors_where_instances_switch():
    """Each step reads topics of its own; what two of them read is the same table."""
    flight = with_two_imus(two_instances())
    shapes = [
        canonical(flight.with_topics({key: one for key, one in flight.topics.items() if key[0] in topics}))
        for topics in (REPLAY_TOPICS, SCORE_TOPICS, TRUST_TOPICS, COMPARED_TOPICS)
    ]
    for shape in shapes[:3]:
        time = shape.topics["sensor_combined", 0]["timestamp"]
        assert len(time) == 2000
        # instance 1, whose IMU is stamped 1 µs later, is primary from 6 s on
        np.testing.assert_array_equal(time % 5, time >= 6_000_000)
    for topic, instance in {key for shape in shapes for key in shape.topics}:
        tables = [shape.topics[topic, instance] for shape in shapes if (topic, instance) in shape.topics]
        for other in tables[1:]:
            assert tables[0].keys() == other.keys()
            for column, values in tables[0].items():
                np.testing.assert_array_equal(values, other[column], err_msg=f"{topic} {column}")
