"""Whole flights with more sensors: the estimator aboard uses them, and what PX4 is told wrong is in the log."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from fusetune.design.missions.mission import Mission
from fusetune.execute.logger import NO_SAMPLE
from fusetune.execute.sensors.faults import DefaultProfile, Fault, InstanceWhipsaw, ToldWrong, parse_faults
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import AirspeedSensor, Battery, OpticalFlow, RangeFinder, Vehicle, Vision
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.estimator_instances import instance_shares, instance_switches
from fusetune.px4.parameters.ekf2_parameters import ParameterError
from fusetune.px4.ulog.writer import write_ulog

SEED = 5
TOLD = {
    "EKF2_RNG_CTRL": 1, "EKF2_RNG_POS_X": 0.05, "EKF2_RNG_POS_Z": 0.04,
    "EKF2_OF_CTRL": 1, "EKF2_OF_DELAY": 30, "EKF2_OF_POS_X": 0.06, "EKF2_OF_POS_Y": 0.02, "EKF2_OF_POS_Z": 0.04,
    "EKF2_EV_CTRL": 15, "EKF2_EV_DELAY": 40, "EKF2_EV_POS_X": 0.1,
    "EKF2_ARSP_THR": 2.0, "EKF2_ASP_DELAY": 60,
}  # fmt: skip


@pytest.fixture(scope="module")
def equipped(vehicle: Vehicle) -> Vehicle:
    """The quadrotor with all sensors that there are, in calm air: a pitot tube tells the wind ahead alone."""
    return dataclasses.replace(
        vehicle,
        environment=dataclasses.replace(vehicle.environment, wind_speed_m_s=0.3, turbulence_wind_m_s=0.5),
        range_finder=RangeFinder(20.0, 0.02, 0.005, 0.1, 30.0, (0.05, 0.0, 0.04), 0.12, 5.0),
        optical_flow=OpticalFlow(50.0, 0.04, 0.003, 220, 7.4, 30.0, (0.06, 0.02, 0.04), 0.12, 30.0),
        vision=Vision(30.0, 0.02, 0.05, 60.0, 0.05, 0.4, 0.1, 0.1, 1.5, (0.1, 0.0, 0.0), 40.0),
        airspeed=AirspeedSensor(10.0, 1.0, 0.3, 60.0),
        battery=Battery(4, 15.0, 0.5, 0.02, 0.15),
        parameters=vehicle.parameters | TOLD,
    )


@pytest.fixture(scope="module")
def flight(mission: Mission, equipped: Vehicle) -> Flight:
    return fly(mission, equipped, {}, SEED)


def airborne(flight: Flight, table: dict[str, np.ndarray]) -> np.ndarray:
    land = flight.topics["vehicle_land_detected", 0]
    in_air = land["timestamp"][~land["landed"]]
    return (table["timestamp"] > in_air[0] + 4_000_000) & (table["timestamp"] < in_air[-1] - 3_000_000)


@pytest.mark.parametrize("source", ["rng_hgt", "optical_flow", "ev_pos", "ev_hgt", "ev_yaw"])
def test_the_estimator_aboard_fuses_every_new_sensor(flight: Flight, source: str) -> None:
    table = flight.topics[f"estimator_aid_src_{source}", 0]
    rows = airborne(flight, table)
    assert table["fused"][rows].mean() > 0.95
    assert not table["innovation_rejected"][rows].any()
    ratios = np.column_stack([values for name, values in table.items() if name.startswith("test_ratio")])
    # the guide: a sound sensor's ratios stay below 0.5
    assert ratios[rows].max() < 0.5


def test_airspeed_is_fused_where_the_vehicle_flies_fast_enough(flight: Flight) -> None:
    table = flight.topics["estimator_aid_src_airspeed", 0]
    rows = airborne(flight, table)
    assert table["fused"][rows].mean() > 0.3
    assert table["test_ratio"][rows & table["fused"]].max() < 0.5


def test_innovations_of_a_sound_vehicle_have_the_noise_of_its_sensors(flight: Flight) -> None:
    """White noise is in the innovation as it is in the sample, so an innovation is hardly less noisy, nor much more."""
    flow = flight.topics["estimator_aid_src_optical_flow", 0]
    rows = airborne(flight, flow)
    for axis in range(2):
        assert 0.03 < np.std(flow[f"innovation[{axis}]"][rows]) < 0.06
    distance = flight.topics["estimator_aid_src_rng_hgt", 0]
    assert 0.015 < np.std(distance["innovation"][airborne(flight, distance)]) < 0.1


def test_replay_timestamps_name_the_new_samples(flight: Flight) -> None:
    runs = flight.topics["ekf2_timestamps", 0]
    for topic, field in (("distance_sensor", "distance_sensor"), ("vehicle_optical_flow", "optical_flow"),
                         ("vehicle_visual_odometry", "visual_odometry"), ("airspeed", "airspeed")):  # fmt: skip
        taken = int((runs[f"{field}_timestamp_rel"] != NO_SAMPLE).sum())
        assert abs(taken - len(flight.topics[topic, 0]["timestamp"])) <= 2, topic


def test_the_default_profile_thins_the_new_topics_as_px4_does(mission: Mission, equipped: Vehicle) -> None:
    thin = fly(mission, equipped, {}, SEED, (DefaultProfile(),), with_estimator=False)
    assert ("vehicle_visual_odometry", 0) not in thin.topics
    # PX4 v1.16's `add_default_topics`: every second, twice a second, ten times
    for topic, rate_hz in (("distance_sensor", 1.0), ("vehicle_optical_flow", 2.0), ("actuator_motors", 10.0)):
        step_us = np.median(np.diff(thin.topics[topic, 0]["timestamp"]))
        assert step_us == pytest.approx(1e6 / rate_hz, rel=0.05), topic


def test_a_parameter_told_wrong_is_what_the_log_says(mission: Mission, vehicle: Vehicle) -> None:
    wrong = (ToldWrong("EKF2_GPS_DELAY", 200.0),)
    told = fly(mission, vehicle, {"EKF2_GPS_DELAY": 90}, SEED, wrong, with_estimator=False)
    right = fly(mission, vehicle, {}, SEED, with_estimator=False)
    assert told.parameters.initial["EKF2_GPS_DELAY"] == 200.0
    for column, values in right.topics["vehicle_gps_position", 0].items():
        assert np.array_equal(values, told.topics["vehicle_gps_position", 0][column], equal_nan=True)
    with pytest.raises(ParameterError, match="EKF2_NOTHING"):
        fly(mission, vehicle, {}, SEED, (ToldWrong("EKF2_NOTHING", 1.0),), with_estimator=False)


def test_two_instances_take_turns(mission: Mission, vehicle: Vehicle) -> None:
    faults = (InstanceWhipsaw(4.0, 9.0, interval_s=2.0),)
    flight = fly(mission, vehicle, {"EKF2_MULTI_IMU": 2}, SEED, faults)
    plain = fly(mission, vehicle, {}, SEED, with_estimator=False)
    takeoff_s = float(np.min(flight.topics["vehicle_land_detected", 0]["timestamp"][
        ~flight.topics["vehicle_land_detected", 0]["landed"]])) * 1e-6  # fmt: skip
    switches = instance_switches(flight)
    # at 4, 6, 8, 10 and 12 s after take-off, which the land detector notices after 0.15 s
    assert switches * 1e-6 - takeoff_s == pytest.approx([3.85, 5.85, 7.85, 9.85, 11.85], abs=0.03)
    duration_s = (flight.last_timestamp - flight.start_timestamp) * 1e-6
    in_second = 2.0 + 2.0 + (duration_s - (switches[4] * 1e-6 - 2.0))
    assert instance_shares(flight)[1] == pytest.approx(in_second / duration_s, abs=0.02)
    assert set(flight.instances("estimator_states")) == {0, 1}
    own, first = flight.topics["sensor_combined", 0], plain.topics["sensor_combined", 0]
    same = own["accelerometer_m_s2[2]"] == first["accelerometer_m_s2[2]"]
    during = (own["timestamp"] > switches[0]) & (own["timestamp"] < switches[1])
    assert same[own["timestamp"] < switches[0]].all()
    assert same[during].mean() < 0.05
    ids = [np.unique(flight.topics["estimator_status", one]["accel_device_id"]).tolist() for one in (0, 1)]
    assert ids[0] != ids[1]


def test_sensors_that_a_vehicle_lacks_leave_no_topic(mission: Mission, vehicle: Vehicle) -> None:
    stuck: tuple[Fault, ...] = parse_faults(
        [{"kind": "sensor_stuck", "start_s": 1, "duration_s": 2, "sensor": "range_finder"}]
    )
    names = {name for name, _ in fly(mission, vehicle, {}, SEED, stuck, with_estimator=False).topics}
    assert not names & {"distance_sensor", "vehicle_optical_flow", "vehicle_visual_odometry", "airspeed"}
    assert {"actuator_motors", "vehicle_imu_status"} <= names


@pytest.mark.parametrize(
    ("log", "topics"),
    [
        ("Auterion__quadrotor_local.ulg", ("actuator_motors", "battery_status", "vehicle_imu_status",
                                           "vehicle_thrust_setpoint")),
        ("synthetic__mc_range.ulg", ("distance_sensor",)),
        ("synthetic__mc_flow.ulg", ("vehicle_optical_flow",)),
        ("synthetic__mc_vision.ulg", ("vehicle_visual_odometry",)),
    ],
)  # fmt: skip
def test_fields_and_types_are_those_of_px4(
    flight: Flight, log: str, topics: tuple[str, ...], shared_logs: Path, tmp_path: Path
) -> None:
    write_ulog(tmp_path / "own.ulg", flight)
    own, theirs = ULog(str(tmp_path / "own.ulg"), list(topics)), ULog(str(shared_logs / log), list(topics))
    for topic in topics:
        expected = {field.field_name: field.type_str for field in theirs.get_dataset(topic).field_data}
        for field in own.get_dataset(topic).field_data:
            assert expected.get(field.field_name) == field.type_str, (topic, field.field_name)
