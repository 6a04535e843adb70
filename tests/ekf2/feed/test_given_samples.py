"""What the estimator is given: by the releases' own rules, by PX4's source; counted by the code that gives it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusetune.ekf2.feed.given_samples import given_samples
from fusetune.ekf2.feed.inputs import ARRIVAL_FIELDS, build_inputs
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.layouts.release_layouts import canonical

ROWS = 40
TIME = 1_000_000 + 20_000 * np.arange(ROWS, dtype=np.int64)
SENSORS = (
    "vehicle_gps_position",
    "vehicle_magnetometer",
    "vehicle_air_data",
    "vehicle_optical_flow",
    "vehicle_visual_odometry",
    "distance_sensor",
    "airspeed",
    "airspeed_validated",
    "landing_target_pose",
    "vehicle_status",
    "vehicle_land_detected",
    "vehicle_command",
    "launch_detection_status",
    "sensor_selection",
)


def constant(value, dtype=np.float32):
    return np.full(ROWS, value, dtype)


def vectors(size, **values):
    return {f"{name}[{axis}]": constant(value) for name, value in values.items() for axis in range(size)}


def whole(**values):
    return {name: constant(value, np.uint8) for name, value in values.items()}


def scalars(**values):
    return {name: constant(value) for name, value in values.items()}


def version(*release):
    return {"ver_sw_release": release[0] << 24 | release[1] << 16 | release[2] << 8 | 255} if release else {}


def made_flight(*release):
    """Every sensor at 50 Hz, in the fields of v1.16; all messages can be used."""
    topics = {
        "sensor_combined": vectors(3, gyro_rad=0.0, accelerometer_m_s2=-9.8)
        | {name: constant(20_000, np.uint32) for name in ("gyro_integral_dt", "accelerometer_integral_dt")},
        "vehicle_gps_position": {
            **{"latitude_deg": constant(47.0, float), "longitude_deg": constant(8.0, float)},
            **scalars(altitude_msl_m=500.0, vel_n_m_s=1.0, vel_e_m_s=0.0, vel_d_m_s=0.0, eph=0.5, epv=0.8),
            **scalars(s_variance_m_s=0.2, heading=0.1, heading_offset=0.0, heading_accuracy=0.05, hdop=0.7, vdop=0.9),
            **whole(fix_type=3, satellites_used=12, vel_ned_valid=1, spoofing_state=0, device_id=3),
            "timestamp_sample": TIME - 30_000,
        },
        "vehicle_magnetometer": vectors(3, magnetometer_ga=0.2) | {"timestamp_sample": TIME - 1_000},
        "vehicle_air_data": scalars(baro_alt_meter=500.0, rho=1.2) | {"timestamp_sample": TIME - 1_000},
        "vehicle_optical_flow": vectors(2, pixel_flow=0.01)
        | vectors(3, delta_angle=0.0)
        | scalars(max_flow_rate=5.0, min_ground_distance=0.1, max_ground_distance=30.0, distance_m=np.nan)
        | {"integration_timespan_us": constant(20_000, np.uint32), "timestamp_sample": TIME}
        | whole(quality=200),
        "vehicle_visual_odometry": vectors(3, position=1.0, velocity=0.1, position_variance=0.01)
        | vectors(3, velocity_variance=0.01, orientation_variance=0.01)
        | {f"q[{part}]": constant(float(part == 0)) for part in range(4)}
        | whole(pose_frame=1, velocity_frame=1, reset_counter=0, quality=90)
        | {"timestamp_sample": TIME - 5_000},
        "distance_sensor": scalars(current_distance=2.0, min_distance=0.1, max_distance=40.0)
        | whole(orientation=25)
        | {"signal_quality": constant(100, np.int8)},
        "airspeed": scalars(true_airspeed_m_s=22.0, indicated_airspeed_m_s=20.0) | {"timestamp_sample": TIME},
        "airspeed_validated": scalars(true_airspeed_m_s=22.0, calibrated_airspeed_m_s=20.0)
        | {"airspeed_source": constant(1, np.int8)},
        "landing_target_pose": scalars(vx_rel=0.1, vy_rel=0.2, cov_vx_rel=0.01, cov_vy_rel=0.01)
        | whole(is_static=1, rel_vel_valid=1),
        "vehicle_status": whole(arming_state=2, vehicle_type=1),
        "vehicle_land_detected": whole(landed=0, at_rest=0, in_ground_effect=0),
        "vehicle_command": {"command": constant(400, np.uint32)}
        | {f"param{number}": constant(0.0, float) for number in range(1, 8)},
        "launch_detection_status": whole(launch_detection_state=4),
        "sensor_selection": {name: constant(7, np.uint32) for name in ("accel_device_id", "gyro_device_id")},
    }
    tables = {(name, 0): {"timestamp": TIME.copy(), **table} for name, table in topics.items()}
    return Flight("made", tables, ParameterHistory(), version(*release))


def with_fields(flight, topic, **fields):
    table = flight.topics[topic, 0] | {name: np.asarray(values) for name, values in fields.items()}
    return flight.with_topics(flight.topics | {(topic, 0): table})


def without(flight, topic, *fields):
    table = {name: values for name, values in flight.topics[topic, 0].items() if name not in fields}
    return flight.with_topics(flight.topics | {(topic, 0): table})


def given(flight, sensor):
    one = given_samples(canonical(flight)).get(sensor)
    return None if one is None else (one.given, dict(one.refused))


def test_of_sound_sensors_every_message_is_given():
    found = given_samples(canonical(made_flight(1, 16, 0)))
    assert {
        "gnss",
        "gnss_yaw",
        "mag",
        "baro",
        "range",
        "flow",
        "ev_pos",
        "ev_vel",
        "ev_yaw",
        "airspeed",
        "auxvel",
    } == set(found)
    # the first message of a range finder is used up by selecting it; validated airspeed stands for the raw one
    expected = dict.fromkeys(found, ROWS) | {"range": ROWS - 1}
    assert {name: one.given for name, one in found.items()} == expected
    assert not any(one.refused for one in found.values())


def test_the_count_is_what_the_inputs_hold():
    flight = canonical(made_flight(1, 16, 0))
    arrays = build_inputs(flight).arrays
    found = given_samples(flight)
    for name in ("gnss", "mag", "baro", "range", "flow", "airspeed", "auxvel"):
        assert found[name].given == len(_positions(arrays, name))


@pytest.mark.parametrize(
    ("release", "taken"),
    [
        ((1, 8, 0), True),
        ((1, 11, 0), True),
        ((1, 13, 3), True),
        ((1, 14, 0), False),
        ((1, 15, 0), False),
        ((1, 16, 0), False),
        ((), False),
    ],
)
def test_gnss_without_valid_velocity_is_used_as_the_release_that_flew_used_it(release, taken):
    flight = with_fields(made_flight(*release), "vehicle_gps_position", vel_ned_valid=constant(0, np.bool_))
    lost = {} if taken else {"velocity not valid (vel_ned_valid)": ROWS}
    assert given(flight, "gnss") == (ROWS if taken else 0, lost)


def test_of_an_unknown_release_whole_numbers_of_latitude_are_older_than_the_velocity_flag():
    flight = with_fields(
        without(made_flight(), "vehicle_gps_position", "latitude_deg"),
        "vehicle_gps_position",
        lat=constant(470_000_000, np.int32),
        vel_ned_valid=constant(0, np.bool_),
    )
    assert given(flight, "gnss") == (ROWS, {})


@pytest.mark.parametrize(
    ("release", "expected"),
    [
        ((1, 12, 3), ROWS),  # the raw sensor, which was all that this release knew
        ((1, 13, 3), ROWS),  # validated airspeed, whatever it came from
        ((1, 14, 0), 0),
        ((1, 16, 0), 0),
    ],
)
def test_airspeed_that_comes_from_no_sensor(release, expected):
    flight = with_fields(made_flight(*release), "airspeed_validated", airspeed_source=constant(-1, np.int8))
    assert given(flight, "airspeed")[0] == expected


@pytest.mark.parametrize(("release", "taken"), [((1, 11, 0), True), ((1, 13, 3), True), ((1, 14, 0), False)])
def test_vision_of_an_unknown_frame_and_quaternions_that_are_no_unit(release, taken):
    flight = with_fields(
        made_flight(*release),
        "vehicle_visual_odometry",
        **whole(pose_frame=0, velocity_frame=0),
        **{"q[0]": constant(1.001)},
    )
    reasons = {"ev_pos": "of an unknown frame", "ev_vel": "of an unknown frame", "ev_yaw": "no unit quaternion"}
    for sensor, reason in reasons.items():
        assert given(flight, sensor) == ((ROWS, {}) if taken else (0, {reason: ROWS}))


@pytest.mark.parametrize(
    ("topic", "fields", "sensor", "reason"),
    [
        (
            "vehicle_optical_flow",
            {"integration_timespan_us": constant(2_000_000, np.uint32)},
            "flow",
            "integrated over",
        ),
        ("vehicle_optical_flow", {"pixel_flow[1]": constant(np.nan)}, "flow", "no number"),
        ("distance_sensor", whole(orientation=0), "range", "not facing down"),
        ("landing_target_pose", whole(is_static=0), "auxvel", "target not static"),
        ("landing_target_pose", whole(rel_vel_valid=0), "auxvel", "velocity not valid"),
        ("landing_target_pose", {"vx_rel": constant(np.nan)}, "auxvel", "no number"),
        ("vehicle_gps_position", {"heading": constant(np.nan)}, "gnss_yaw", "without a heading"),
        ("vehicle_visual_odometry", {"velocity[2]": constant(np.nan)}, "ev_vel", "no number"),
    ],
)
def test_messages_that_the_estimator_is_not_given_are_counted_with_their_reason(topic, fields, sensor, reason):
    flight = made_flight(1, 16, 0)
    table = flight.topics[topic, 0] | fields
    count, refused = given(flight.with_topics(flight.topics | {(topic, 0): table}), sensor)
    assert count == 0
    assert [(why.startswith(reason), rows) for why, rows in refused.items()] == [(True, ROWS)]


def test_messages_of_which_none_arrives_are_not_given():
    """`ekf2_timestamps` says that the estimator saw none of the range finder's messages."""
    flight = made_flight(1, 16, 0)
    seen = {"timestamp": TIME, "distance_sensor_timestamp_rel": constant(32767, np.int16)}
    assert given(flight.with_topics(flight.topics | {("ekf2_timestamps", 0): seen}), "range") == (0, {})


@pytest.mark.parametrize("topic", SENSORS)
def test_without_any_one_field_nothing_that_is_given_is_no_number(topic):
    """Each field in turn: the topic is left out by the name of the field, or what is given stays sound."""
    sound = made_flight(1, 16, 0)
    for name in sound.topics[topic, 0]:
        if name == "timestamp":
            continue
        flight = canonical(without(sound, topic, name))
        arrays = build_inputs(flight).arrays
        told = [entry for entry in flight.left_out if entry.topic == topic]
        if told:
            assert told[0].reason == f"lacks the field {name}"
            assert told[0].rows == ROWS
        sensors = ("gnss", "mag", "baro", "range", "flow", "airspeed", "auxvel")
        used = {sensor: getattr(arrays, sensor)[_positions(arrays, sensor)] for sensor in sensors}
        for column in ("lat_deg", "lon_deg", "alt", "vel", "hacc", "vacc", "sacc", "pdop"):
            assert np.isfinite(used["gnss"][column]).all(), (name, column)
        for sensor, column in (("mag", "mag"), ("baro", "hgt"), ("flow", "flow_rate"), ("range", "range")):
            assert np.isfinite(used[sensor][column]).all(), (name, sensor)
        for column in ("true_airspeed", "eas2tas"):
            assert np.isfinite(used["airspeed"][column]).all(), name
        assert np.isfinite(used["auxvel"]["vel"]).all()
        assert np.isfinite(used["auxvel"]["vel_var"]).all()
        assert np.isfinite(arrays.air_density).all()


@pytest.mark.parametrize("topic", SENSORS)
def test_a_topic_without_messages_gives_nothing_and_stops_nothing(topic):
    flight = made_flight(1, 16, 0)
    empty = {name: values[:0] for name, values in flight.topics[topic, 0].items()}
    flight = canonical(flight.with_topics(flight.topics | {(topic, 0): empty}))
    assert len(build_inputs(flight).arrays.imu) == ROWS
    assert all(one.topic != topic for one in given_samples(flight).values())


def _positions(arrays, name):
    """Of the samples of a sensor, those that arrive."""
    return arrays.arrivals["position"][arrays.arrivals["field"] == ARRIVAL_FIELDS.index(name)]


@pytest.mark.parametrize(
    "fields",
    [
        ("latitude_deg", "longitude_deg", "altitude_msl_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"),
        ("eph", "epv", "s_variance_m_s", "fix_type", "satellites_used"),
    ],
)
def test_gnss_without_what_every_release_has_is_left_out(fields):
    for name in fields:
        flight = canonical(without(made_flight(1, 16, 0), "vehicle_gps_position", name))
        assert flight.topic("vehicle_gps_position") is None
        assert "gnss" not in given_samples(flight)


def test_gnss_of_v1_8_had_no_heading_and_is_used():
    later = ("heading", "heading_offset", "heading_accuracy", "spoofing_state", "device_id", "timestamp_sample")
    flight = without(made_flight(1, 8, 0), "vehicle_gps_position", *later)
    assert given(flight, "gnss") == (ROWS, {})
    assert given(flight, "gnss_yaw") == (0, {"without a heading": ROWS})


def test_a_heading_of_the_antennas_alone_is_none_of_the_vehicle():
    flight = without(made_flight(1, 16, 0), "vehicle_gps_position", "heading_offset")
    assert given(flight, "gnss") == (ROWS, {})
    assert given(flight, "gnss_yaw") == (0, {"without a heading": ROWS})


def test_sample_times_that_ekf2_does_not_read_may_be_anything():
    """GNSS is stamped with the time of publication; a magnetometer with that of the sample, which then counts."""
    absurd = {"timestamp_sample": np.full(ROWS, 517, np.int64)}
    flight = with_fields(
        with_fields(made_flight(1, 16, 0), "vehicle_gps_position", **absurd), "airspeed_validated", **absurd
    )
    late = TIME + 600_000_000
    moved = {key: table | {"timestamp": late} for key, table in flight.topics.items() if "airspeed" in key[0]}
    moved |= {key: flight.topics[key] | {"timestamp": late} for key in flight.topics if key not in moved}
    for key in (("vehicle_magnetometer", 0), ("vehicle_air_data", 0), ("airspeed", 0)):
        moved[key]["timestamp_sample"] = late
    for name in ("vehicle_optical_flow", "vehicle_visual_odometry"):
        moved[name, 0]["timestamp_sample"] = late
    flight = canonical(replace(flight, topics=moved))
    assert flight.left_out == ()
    found = given_samples(flight)
    assert found["gnss"].given == found["airspeed"].given == ROWS
    moved["vehicle_magnetometer", 0] |= absurd
    assert canonical(replace(flight, topics=moved)).left_out[0].topic == "vehicle_magnetometer"


def test_vision_that_has_lost_all_that_it_measures_is_left_out():
    lost = [f"{name}[{axis}]" for name in ("position", "velocity", "q") for axis in range(4)]
    flight = canonical(without(made_flight(1, 16, 0), "vehicle_visual_odometry", *lost))
    assert [entry.reason for entry in flight.left_out] == ["lacks the field position[0]"]
    only = canonical(without(made_flight(1, 16, 0), "vehicle_visual_odometry", *lost[:8]))
    found = given_samples(only)
    assert [found[name].given for name in ("ev_pos", "ev_vel", "ev_yaw")] == [0, 0, ROWS]
    assert not found["ev_pos"].is_withheld


@pytest.mark.parametrize(
    ("topic", "fields", "sensor", "withheld"),
    [
        ("distance_sensor", whole(orientation=0), "range", False),
        ("landing_target_pose", whole(is_static=0), "auxvel", False),
        ("landing_target_pose", whole(rel_vel_valid=0), "auxvel", True),
        ("vehicle_optical_flow", {"pixel_flow[0]": constant(np.nan)}, "flow", False),
        ("vehicle_gps_position", {"vel_ned_valid": constant(0, np.bool_)}, "gnss", True),
    ],
)
def test_what_a_sensor_does_not_measure_for_the_estimator_is_not_withheld(topic, fields, sensor, withheld):
    flight = made_flight(1, 16, 0)
    table = flight.topics[topic, 0] | fields
    one = given_samples(canonical(flight.with_topics(flight.topics | {(topic, 0): table})))[sensor]
    assert one.given == 0
    assert one.is_withheld == withheld
