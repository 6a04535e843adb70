"""The estimator aboard: its topics, and what it makes of simulated flights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog
from scipy.spatial.transform import Rotation

from fusetune.design.missions.mission import load_mission
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.replay.replay import replay
from fusetune.execute.sensors.faults import DefaultProfile, GnssOutage
from fusetune.execute.simulation import fly, simulate
from fusetune.execute.vehicle import load_vehicle
from fusetune.px4.flight import Flight, stacked
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog

SEED = 5


@pytest.fixture(scope="module")
def log(project_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey flight of the quadrotor with PX4's default parameters."""
    path = tmp_path_factory.mktemp("flight") / "survey.ulg"
    mission = load_mission(project_root / "config/missions/survey.yaml")
    simulate(mission, load_vehicle(project_root / "config/vehicles/quadrotor.yaml"), {}, SEED, (), path)
    return path


@pytest.fixture(scope="module")
def flight(log: Path) -> Flight:
    return read_ulog(log)


@pytest.fixture(scope="module")
def assumed_noise_flight(project_root: Path) -> Flight:
    """The same with the vehicle whose noise is what the default parameters assume."""
    mission = load_mission(project_root / "config/missions/survey.yaml")
    return fly(mission, load_vehicle(project_root / "config/vehicles/default_noise.yaml"), {}, SEED)


def airborne(flight: Flight) -> tuple[int, int]:
    """From five seconds after take-off to two before touch-down, µs."""
    landed = flight.topics["vehicle_land_detected", 0]
    in_air = landed["timestamp"][~landed["landed"].astype(bool)]
    return int(in_air[0]) + 5_000_000, int(in_air[-1]) - 3_000_000


def true_errors(flight: Flight) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position (m), velocity (m/s) and attitude (deg) errors in flight, each (N, 3)."""
    local, truth = flight.topics["vehicle_local_position", 0], flight.topics["vehicle_local_position_groundtruth", 0]
    begin, end = airborne(flight)
    rows = (local["timestamp"] > begin) & (local["timestamp"] < end)
    time = local["timestamp"][rows]

    def error(name: str) -> np.ndarray:
        return local[name][rows] - np.interp(time, truth["timestamp"], truth[name])

    # A degree of latitude on PX4's sphere of 6371 km
    metres = np.radians(1.0) * 6_371_000.0
    origin = (
        (local["ref_lat"][rows] - truth["ref_lat"][0]) * metres,
        (local["ref_lon"][rows] - truth["ref_lon"][0]) * metres * np.cos(np.radians(truth["ref_lat"][0])),
        truth["ref_alt"][0] - local["ref_alt"][rows],
    )
    position = np.column_stack([error(name) + shift for name, shift in zip("xyz", origin, strict=True)])
    velocity = np.column_stack([error(name) for name in ("vx", "vy", "vz")])
    return position, velocity, attitude_errors(flight, begin, end)


def attitude_errors(flight: Flight, begin: int, end: int) -> np.ndarray:
    estimated, truth = flight.topics["vehicle_attitude", 0], flight.topics["vehicle_attitude_groundtruth", 0]
    rows = (estimated["timestamp"] > begin) & (estimated["timestamp"] < end)
    nearest = np.searchsorted(truth["timestamp"], estimated["timestamp"][rows] - 10_000)
    close = np.abs(truth["timestamp"][nearest] - estimated["timestamp"][rows]) <= 2000
    rotations = [
        Rotation.from_quat(quaternions[close], scalar_first=True)
        for quaternions in (stacked(estimated, "q")[rows], stacked(truth, "q")[nearest])
    ]
    return np.asarray(np.degrees((rotations[0] * rotations[1].inv()).as_rotvec()))


def rms(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=0)))


def test_estimate_is_as_good_as_that_of_a_good_filter(flight: Flight) -> None:
    position, velocity, attitude = (rms(errors) for errors in true_errors(flight))
    # GNSS errors of 0.3 m horizontally and 0.45 m vertically are correlated over a minute: no filter takes them out
    assert np.all(position < [0.9, 0.9, 1.35])
    assert np.all(velocity < 0.1)
    assert np.all(attitude < [0.5, 0.5, 2.0])


def test_normalised_innovations_match_their_expectation_where_the_noise_is_as_assumed(
    assumed_noise_flight: Flight,
) -> None:
    begin, end = airborne(assumed_noise_flight)
    for source, axes in (("gnss_vel", 3), ("gnss_pos", 2), ("gnss_hgt", 1), ("baro_hgt", 1), ("mag", 3)):
        table = assumed_noise_flight.topics[f"estimator_aid_src_{source}", 0]
        rows = (table["timestamp"] > begin) & (table["timestamp"] < end)
        fields = ["innovation", "innovation_variance"]
        innovation, variance = (table[field][:, None] if axes == 1 else stacked(table, field) for field in fields)
        nis = np.mean(np.square(innovation[rows]) / variance[rows])
        # Standard deviation of a mean of n squared normal variables is √(2/n); four of them, and a tenth for what is
        # not quite as assumed: the number of IMU samples per update, biases still being learned
        assert nis == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (axes * rows.sum())) + 0.1), source


def test_velocity_errors_match_the_variances_the_filter_claims(assumed_noise_flight: Flight) -> None:
    states, truth = (
        assumed_noise_flight.topics[name, 0] for name in ("estimator_states", "vehicle_local_position_groundtruth")
    )
    begin, end = airborne(assumed_noise_flight)
    rows = (states["timestamp_sample"] > begin) & (states["timestamp_sample"] < end)
    for axis, name in enumerate(("vx", "vy", "vz")):
        true = np.interp(states["timestamp_sample"][rows], truth["timestamp"], truth[name])
        error = states[f"states[{4 + axis}]"][rows] - true
        # Errors last about a second, so 70 s hold some 70 independent ones: mean NEES 1 ± 4 √(2/70)
        assert np.mean(error**2 / states[f"covariances[{3 + axis}]"][rows]) == pytest.approx(1.0, abs=0.7), name


def test_vehicle_estimates_what_a_replay_of_its_log_estimates(flight: Flight) -> None:
    result = replay(build_inputs(canonical(flight)), complete(flight.parameters.initial, {}, flight.release))
    names = result.source_names()
    for source in ("gnss_vel", "mag"):
        rows = result.innovations[names == source].reshape(-1, 3)
        logged = flight.topics[f"estimator_aid_src_{source}", 0]
        assert np.array_equal(rows["timestamp_sample"][:, 0], logged["timestamp_sample"])
        assert np.array_equal(rows["innovation"], stacked(logged, "innovation").astype(np.float32))


def test_topics_have_the_names_and_types_of_px4(log: Path, shared_logs: Path) -> None:
    ours = ULog(str(log))
    known: dict[str, dict[str, str]] = {}
    # The first flew v1.16.1 without GNSS; what it lacks is in a log of v1.17
    for name in ("erdemarslan380__sitl_windy.ulg", "Auterion__quadrotor_local.ulg"):
        for data in ULog(str(shared_logs / name)).data_list:
            known[data.name] = {field.field_name: field.type_str for field in data.field_data}
    estimator = [
        data
        for data in ours.data_list
        if data.name.startswith("estimator_") or data.name in ("vehicle_attitude", "vehicle_local_position")
    ]
    assert len(estimator) >= 14
    for data in estimator:
        assert data.name in known
        for field in data.field_data:
            assert known[data.name].get(field.field_name) == field.type_str, (data.name, field.field_name)


def test_control_mode_flags_are_the_status_flags_as_bits(flight: Flight) -> None:
    flags, status = flight.topics["estimator_status_flags", 0], flight.topics["estimator_status", 0]
    row = np.searchsorted(flags["timestamp"], status["timestamp"], side="right") - 1
    # PX4's filter_control_status: bit 0 tilt aligned, bit 2 GNSS position, bit 7 in air, bit 9 barometer height
    for bit, name in ((0, "cs_tilt_align"), (2, "cs_gnss_pos"), (7, "cs_in_air"), (9, "cs_baro_hgt")):
        bits = (status["control_mode_flags"] >> np.uint64(bit)) & np.uint64(1)
        assert np.array_equal(bits[row >= 0].astype(bool), flags[name][row[row >= 0]].astype(bool))


def test_outage_makes_the_vehicle_dead_reckon_and_recover(project_root: Path) -> None:
    mission = load_mission(project_root / "config/missions/survey.yaml")
    vehicle = load_vehicle(project_root / "config/vehicles/quadrotor.yaml")
    flight = fly(mission, vehicle, {}, SEED, (GnssOutage(20.0, 6.0, silent=True),))
    flags = flight.topics["estimator_status_flags", 0]
    takeoff = airborne(flight)[0] - 5_000_000
    during = (flags["timestamp"] > takeoff + 22_500_000) & (flags["timestamp"] < takeoff + 25_500_000)
    assert flags["cs_inertial_dead_reckoning"][during].any()
    assert not flags["cs_inertial_dead_reckoning"][flags["timestamp"] > takeoff + 30_000_000].any()
    velocity = true_errors(flight)[1]
    assert 0.05 < np.abs(velocity).max() < 3.0


def test_default_profile_logs_estimator_topics_slowly(project_root: Path, tmp_path: Path) -> None:
    mission = load_mission(project_root / "config/missions/survey.yaml")
    vehicle = load_vehicle(project_root / "config/vehicles/quadrotor.yaml")
    flight = fly(mission, vehicle, {}, SEED, (DefaultProfile(),))
    for topic, interval_us in (("estimator_innovations", 500_000), ("estimator_states", 1_000_000)):
        assert np.diff(flight.topics[topic, 0]["timestamp"]).min() >= interval_us
    write_ulog(tmp_path / "thin.ulg", flight)
    assert (tmp_path / "thin.ulg").stat().st_size < 4_000_000
