"""Whole simulated flights: the log that is left, faults, determinism."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from fusetune.design.missions.mission import Mission
from fusetune.errors import UserError
from fusetune.execute.logger import NO_SAMPLE
from fusetune.execute.sensors.faults import DefaultProfile, Fault, LoggerDropout, parse_faults
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import Vehicle, load_vehicle
from fusetune.px4.flight import Flight
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError
from fusetune.px4.ulog.writer import write_ulog

FLOWN = {"EKF2_ACC_NOISE": 0.7, "EKF2_GPS_CTRL": 7}
SEED = 11
COMPARED_TOPICS = (
    "sensor_combined",
    "vehicle_magnetometer",
    "vehicle_air_data",
    "vehicle_gps_position",
    "vehicle_status",
    "vehicle_land_detected",
    "ekf2_timestamps",
    "vehicle_attitude_groundtruth",
    "vehicle_angular_velocity_groundtruth",
    "vehicle_local_position_groundtruth",
    "vehicle_global_position_groundtruth",
)


def sensors_only(mission: Mission, vehicle: Vehicle, faults: tuple[Fault, ...] = (), seed: int = SEED) -> Flight:
    return fly(mission, vehicle, FLOWN, seed, faults, "short", with_estimator=False)


@pytest.fixture(scope="module")
def log(mission: Mission, vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "short.ulg"
    write_ulog(path, sensors_only(mission, vehicle))
    return path


def test_pyulog_reads_what_px4_would_have_written(log: Path) -> None:
    ulog = ULog(str(log))
    assert not ulog.file_corruption
    assert ulog.get_version_info() == (1, 16, 0, 255)
    assert ulog.msg_info_dict["sys_name"] == "PX4"
    assert ulog.initial_parameters["EKF2_ACC_NOISE"] == pytest.approx(0.7)
    assert ulog.initial_parameters["EKF2_GPS_POS_Z"] == pytest.approx(-0.09)
    assert set(PARAMETERS) <= set(ulog.initial_parameters)
    assert ulog.get_default_parameters(0)["EKF2_ACC_NOISE"] == pytest.approx(0.35)
    rates = {
        "sensor_combined": 250.0,
        "vehicle_magnetometer": 50.0,
        "vehicle_air_data": 20.0,
        "vehicle_gps_position": 5.0,
    }
    for topic, rate in rates.items():
        times = ulog.get_dataset(topic).data["timestamp"].astype(np.int64)
        assert (len(times) - 1) / ((times[-1] - times[0]) * 1e-6) == pytest.approx(rate, rel=0.01)
    names = {data.name for data in ulog.data_list}
    for quantity in ("attitude", "angular_velocity", "local_position", "global_position"):
        assert f"vehicle_{quantity}_groundtruth" in names
    assert any("Takeoff" in message.message for message in ulog.logged_messages)


def test_field_types_are_those_of_px4(log: Path, shared_logs: Path) -> None:
    ours, theirs = ULog(str(log)), ULog(str(shared_logs / "erdemarslan380__sitl_windy.ulg"))
    for topic in COMPARED_TOPICS:
        expected = {field.field_name: field.type_str for field in theirs.get_dataset(topic).field_data}
        for field in ours.get_dataset(topic).field_data:
            assert expected.get(field.field_name, field.type_str) == field.type_str, (topic, field.field_name)
        assert {field.field_name for field in ours.get_dataset(topic).field_data} <= set(expected) | {"rtcm_msg_used"}


@pytest.mark.parametrize(
    ("tool", "arguments", "expected"),
    [
        ("info", (), "sensor_combined"),
        ("params", (), "EKF2_ACC_NOISE"),
        ("messages", (), "Takeoff"),
        ("info", ("-v",), "FUSETUNE_SIM"),
    ],
)
def test_command_line_tools_read_the_log(log: Path, tool: str, arguments: tuple[str, ...], expected: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", f"import pyulog.{tool} as tool; tool.main()", *arguments, str(log)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert expected in run.stdout


def test_ulog2csv_writes_every_topic(log: Path, tmp_path: Path) -> None:
    code = "import pyulog.ulog2csv as tool; tool.main()"
    subprocess.run([sys.executable, "-c", code, "-o", str(tmp_path), str(log)], capture_output=True, check=True)
    assert {f"short_{data.name}_0.csv" for data in ULog(str(log)).data_list} == {
        path.name for path in tmp_path.iterdir()
    }


def test_same_seed_gives_the_same_bytes(log: Path, mission: Mission, vehicle: Vehicle, tmp_path: Path) -> None:
    again, other = tmp_path / "short.ulg", tmp_path / "other.ulg"
    write_ulog(again, sensors_only(mission, vehicle))
    write_ulog(other, sensors_only(mission, vehicle, seed=SEED + 1))
    assert again.read_bytes() == log.read_bytes()
    assert other.read_bytes() != log.read_bytes()


def test_replay_timestamps_name_every_sample_once_and_in_time(mission: Mission, vehicle: Vehicle) -> None:
    flight = sensors_only(mission, vehicle)
    runs = flight.topics["ekf2_timestamps", 0]
    assert np.array_equal(runs["timestamp"], flight.topics["sensor_combined", 0]["timestamp"])
    for topic in ("vehicle_magnetometer", "vehicle_air_data"):
        relative = runs[f"{topic}_timestamp_rel"]
        taken = relative != NO_SAMPLE
        published = flight.topics[topic, 0]["timestamp"]
        assert taken.sum() in (len(published), len(published) - 1)
        told = runs["timestamp"][taken] // 100 + relative[taken]
        assert np.array_equal(told, (published // 100)[: taken.sum()])
        # A sample is taken by the first run after it: at most one IMU interval of 4 ms before, 0.45 ms after the IMU
        assert relative[taken].min() >= -40
        assert relative[taken].max() <= 5
    assert np.all(runs["airspeed_timestamp_rel"] == NO_SAMPLE)


def test_land_detector_and_arming_tell_the_flight(mission: Mission, vehicle: Vehicle) -> None:
    flight = sensors_only(mission, vehicle)
    landed, status = flight.topics["vehicle_land_detected", 0], flight.topics["vehicle_status", 0]
    truth = flight.topics["vehicle_local_position_groundtruth", 0]
    in_air = landed["timestamp"][~landed["landed"]]
    flying = truth["timestamp"][truth["z"] < -0.3]
    assert in_air[0] <= flying[0] <= in_air[0] + 1_500_000
    assert in_air[-1] >= flying[-1]
    armed = status["timestamp"][status["arming_state"] == 2]
    assert armed[0] < in_air[0] - 2_500_000
    at_rest = landed["timestamp"][landed["at_rest"]]
    assert not ((at_rest > armed[0]) & (at_rest < armed[-1])).any()
    assert landed["in_ground_effect"].any()
    assert np.diff(landed["timestamp"]).max() <= 1_020_000


def test_default_profile_thins_and_loses_what_px4s_logger_does(mission: Mission, vehicle: Vehicle) -> None:
    full, thin = sensors_only(mission, vehicle), sensors_only(mission, vehicle, (DefaultProfile(imu_loss=0.05),))
    assert ("ekf2_timestamps", 0) not in thin.topics
    imu = thin.topics["sensor_combined", 0]["timestamp"]
    kept = np.isin(full.topics["sensor_combined", 0]["timestamp"], imu)
    from_arming = full.topics["sensor_combined", 0]["timestamp"] >= imu[0]
    assert 1.0 - kept[from_arming].mean() == pytest.approx(0.05, abs=0.01)
    for topic, rate in (("vehicle_magnetometer", 2.0), ("vehicle_air_data", 5.0), ("vehicle_gps_position", 5.0)):
        times = thin.topics[topic, 0]["timestamp"]
        assert 1e6 / np.median(np.diff(times)) == pytest.approx(rate, rel=0.05)
    armed = full.topics["vehicle_status", 0]
    assert imu[0] >= armed["timestamp"][armed["arming_state"] == 2][0] - 20_000
    assert thin.parameters.initial["SDLOG_PROFILE"] == 1


def test_logger_dropout_loses_everything_and_says_so(mission: Mission, vehicle: Vehicle, tmp_path: Path) -> None:
    flight = sensors_only(mission, vehicle, (LoggerDropout(5.0, 0.8),))
    write_ulog(tmp_path / "drop.ulg", flight)
    ulog = ULog(str(tmp_path / "drop.ulg"))
    assert [dropout.duration for dropout in ulog.dropouts] == [800]
    assert np.diff(ulog.get_dataset("sensor_combined").data["timestamp"].astype(np.int64)).max() >= 800_000


def test_faults_do_not_change_the_noise_of_other_sensors(mission: Mission, vehicle: Vehicle) -> None:
    plain = sensors_only(mission, vehicle)
    fault = parse_faults([{"kind": "gnss_outage", "start_s": 5, "duration_s": 5}])
    faulty = sensors_only(mission, vehicle, fault)
    for topic in ("sensor_combined", "vehicle_magnetometer", "vehicle_air_data"):
        for column, values in plain.topics[topic, 0].items():
            assert np.array_equal(values, faulty.topics[topic, 0][column]), (topic, column)


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({"kind": "gnss_outage", "start_s": 1}, ("faults[0]", "'duration_s' is missing")),
        ({"kind": "gnss_outag", "start_s": 1}, ("faults[0].kind", "'gnss_outage'")),
        (
            {"kind": "gnss_glitch", "start_s": 1, "duration_s": 2, "offset_m": [1, 2]},
            ("faults[0].offset_m", "a list of 2"),
        ),
        ({"kind": "vibration", "start_s": 1, "duration_s": 2, "factr": 3}, ("'factr'", "did you mean 'factor'")),
        ({"kind": "default_profile", "imu_loss": 2}, ("faults[0].imu_loss", "between 0 and 0.5")),
    ],
)
def test_broken_fault_is_told(entry: dict[str, object], expected: tuple[str, ...]) -> None:
    with pytest.raises(UserError) as error:
        parse_faults([entry], "config.yaml")
    for words in ("config.yaml", *expected):
        assert words in str(error.value)


def test_unknown_parameter_is_refused(mission: Mission, vehicle: Vehicle) -> None:
    with pytest.raises(ParameterError, match="EKF2_NOTHING"):
        fly(mission, vehicle, {"EKF2_NOTHING": 1.0}, SEED, with_estimator=False)


def test_endless_mission_is_refused(mission: Mission, vehicle: Vehicle) -> None:
    slow = tuple(dataclasses.replace(waypoint, hold_s=1600.0) for waypoint in mission.waypoints)
    with pytest.raises(UserError, match="minutes"):
        fly(dataclasses.replace(mission, waypoints=slow), vehicle, {}, SEED, with_estimator=False)


@pytest.mark.parametrize("name", ["quadrotor", "default_noise"])
def test_shipped_vehicles_load(project_root: Path, name: str) -> None:
    assert load_vehicle(project_root / f"config/vehicles/{name}.yaml").name == name


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("noise_gauss: 0.006", "noise_gauss: -1"), ("magnetometer.noise_gauss", "-1", "between 0 and 0.5")),
        (("hover_throttle: 0.42", "hoover: 0.42"), ("airframe", "'hoover'", "'hover_throttle' is missing")),
        (("date: 2025-06-15", "date: 2025-02-30"), ("environment.date", "2025-02-30")),
        (("rate_hz: 250", "rate_hz: 300"), ("imu.raw_rate_hz", "multiple")),
        (("EKF2_GPS_DELAY: 110", "EKF2_GPS_DELAY: 9000"), ("EKF2_GPS_DELAY", "9000")),
    ],
)
def test_broken_vehicle_is_told(
    project_root: Path, tmp_path: Path, change: tuple[str, str], expected: tuple[str, ...]
) -> None:
    text = (project_root / "config/vehicles/quadrotor.yaml").read_text()
    assert change[0] in text
    path = tmp_path / "vehicle.yaml"
    path.write_text(text.replace(*change))
    with pytest.raises(UserError) as error:
        load_vehicle(path)
    for words in expected:
        assert words in str(error.value)
