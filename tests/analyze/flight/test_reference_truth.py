"""References other than ground truth, on made tables; and what Gazebo's ground truth says about the attitude."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fusetune.analyze.flight.reference_truth import odometry_reference, read_references, read_truth, rtk_reference
from fusetune.analyze.metrics.attitude import interpolate_quaternion
from fusetune.analyze.metrics.error_figures import ErrorFigure, attitude_figures, true_attitude
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.scoring.true_errors import Reference, true_errors
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.px4.flight import Flight, TopicTable, stacked
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog

TIME = np.arange(500, dtype=np.int64) * 20_000
SECONDS = TIME * 1e-6
RADIUS_M = 6371000.0


def circle() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and heading of a flight round a circle of 5 m in 10 s, nose ahead."""
    angle = 2.0 * np.pi * SECONDS / 10.0
    position = np.column_stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), np.full_like(angle, -3.0)])
    rate = 2.0 * np.pi / 10.0
    velocity = rate * np.column_stack([-5.0 * np.sin(angle), 5.0 * np.cos(angle), np.zeros_like(angle)])
    return position, velocity, angle + np.pi / 2.0


def quaternions(heading: np.ndarray) -> np.ndarray:
    return Rotation.from_euler("Z", heading[:, None]).as_quat(scalar_first=True)


def estimate(position: np.ndarray, velocity: np.ndarray, quaternion: np.ndarray) -> tuple[ReplayedSet, FilterStates]:
    columns = {name: position[:, i] for i, name in enumerate("xyz")}
    columns |= {f"v{name}": velocity[:, i] for i, name in enumerate("xyz")}
    record = ReplayedSet("present", {}, {}, {}, {}, {}, {"timestamp": TIME, **columns})
    variance = np.full((TIME.size, 3), 0.01)
    return record, FilterStates(TIME, quaternion, velocity, variance, variance, variance)


def odometry(position: np.ndarray, velocity: np.ndarray, quaternion: np.ndarray, velocity_frame: int) -> TopicTable:
    table: TopicTable = {"timestamp": TIME, "timestamp_sample": TIME}
    for name, values in (("position", position), ("velocity", velocity), ("q", quaternion)):
        table |= {f"{name}[{i}]": values[:, i].astype(np.float32) for i in range(values.shape[1])}
    frames = {"pose_frame": 2, "velocity_frame": velocity_frame}
    return table | {name: np.full(TIME.size, value, np.uint8) for name, value in frames.items()}


def figures(found: list[ErrorFigure]) -> dict[tuple[str, str, str], float]:
    return {(one.quantity, one.axis, one.metric): one.value for one in found}


WINDOW = ScoringWindow(((1_000_000, 9_000_000),), (), {}, 0)


@pytest.mark.parametrize("has_attitude", [True, False])
def test_motion_capture_with_a_north_and_an_origin_of_its_own(has_attitude: bool) -> None:
    position, velocity, heading = circle()
    record, states = estimate(position, velocity, quaternions(heading))
    turn = Rotation.from_euler("Z", -40.0, degrees=True)
    own = turn.apply(position) + np.array([7.0, -3.0, 1.0])
    attitude = quaternions(heading - np.radians(40.0))
    if not has_attitude:
        attitude = np.full_like(attitude, np.nan)
    truth = odometry_reference(odometry(own, turn.apply(velocity), attitude, 2), "mocap")
    assert truth is not None
    found = figures(true_errors(record, states, Reference(truth), WINDOW, 0.95))
    assert found["position_mean_removed", "all", "rmse"] == pytest.approx(0.0, abs=2e-3)
    assert found["velocity", "all", "rmse"] == pytest.approx(0.0, abs=2e-3)
    assert ("position", "all", "rmse") not in found
    assert (("attitude_deg", "heading", "rmse") in found) == has_attitude


def test_velocities_in_the_body_frame_are_turned() -> None:
    position, velocity, heading = circle()
    forward = np.column_stack([np.linalg.norm(velocity, axis=1), np.zeros(TIME.size), np.zeros(TIME.size)])
    truth = odometry_reference(odometry(position, forward, quaternions(heading), 3), "mocap")
    assert truth is not None
    np.testing.assert_allclose(truth.velocity, velocity, atol=1e-5)


def gnss(position: np.ndarray, velocity: np.ndarray, device: int, fix: int, delay_us: int = 0) -> TopicTable:
    latitude = np.degrees(position[:, 0] / RADIUS_M) + 47.0
    longitude = np.degrees(position[:, 1] / RADIUS_M / np.cos(np.radians(latitude[0]))) + 8.0
    table: TopicTable = {
        "timestamp": TIME + delay_us,
        "latitude_deg": latitude,
        "longitude_deg": longitude,
        "altitude_msl_m": 500.0 - position[:, 2],
        "fix_type": np.full(TIME.size, fix, np.uint8),
        "device_id": np.full(TIME.size, device, np.uint32),
    }
    return table | {f"vel_{axis}_m_s": velocity[:, i].astype(np.float32) for i, axis in enumerate("ned")}


def test_an_rtk_receiver_beside_the_one_that_is_fused_is_the_truth() -> None:
    position, velocity, heading = circle()
    arm = np.array([0.3, 0.0, 0.0])
    rotation = Rotation.from_euler("Z", heading[:, None])
    antenna = position + rotation.apply(arm)
    swept = velocity + np.gradient(rotation.apply(arm), SECONDS, axis=0)
    flight = Flight(
        name="f",
        topics={
            ("vehicle_gps_position", 0): gnss(position, velocity, device=1, fix=3),
            ("sensor_gps", 0): gnss(position, velocity, device=1, fix=3),
            ("sensor_gps", 1): gnss(antenna, swept, device=2, fix=6, delay_us=100_000),
        },
    )
    parameters = {"EKF2_GPS_DELAY": 100.0, "EKF2_GPS_POS_X": 0.3}
    truth = rtk_reference(flight, parameters)
    assert truth is not None
    assert truth.kind == "rtk"
    record, states = estimate(position, velocity, quaternions(heading))
    found = figures(true_errors(record, states, Reference(truth), WINDOW, 0.95))
    # Delay and lever arm are accounted for: 0.3 m at 0.63 rad/s would be 0.19 m/s.
    assert found["velocity", "all", "rmse"] == pytest.approx(0.0, abs=2e-3)
    assert found["position_mean_removed", "all", "rmse"] == pytest.approx(0.0, abs=2e-3)


def test_an_rtk_receiver_that_is_fused_has_a_name_of_its_own_and_one_without_a_fix_is_none() -> None:
    position, velocity, _ = circle()
    fed = Flight(name="f", topics={("vehicle_gps_position", 0): gnss(position, velocity, 1, 6)})
    truth = rtk_reference(fed, {})
    assert truth is not None
    assert truth.kind == "rtk_fed"
    floating = Flight(name="f", topics={("vehicle_gps_position", 0): gnss(position, velocity, 1, 5)})
    assert rtk_reference(floating, {}) is None


def test_vision_is_a_reference_only_while_no_set_fuses_it() -> None:
    position, velocity, heading = circle()
    table = odometry(position, velocity, quaternions(heading), 2)
    flight = Flight(name="f", topics={("vehicle_visual_odometry", 0): table, ("vehicle_mocap_odometry", 0): table})
    assert [one.kind for one in read_references(flight, {"gnss_vel"}, {})] == ["mocap", "vision"]
    assert [one.kind for one in read_references(flight, {"ev_pos"}, {})] == ["mocap"]


def test_a_reference_is_not_known_in_its_gaps() -> None:
    position, velocity, heading = circle()
    table = odometry(position, velocity, quaternions(heading), 2)
    kept = (TIME < 4_000_000) | (TIME > 5_000_000)
    truth = odometry_reference({name: values[kept] for name, values in table.items()}, "mocap")
    assert truth is not None
    known = truth.known_at(np.array([3_970_000, 4_500_000, 5_030_000, 20_000_000], dtype=np.int64))
    assert known.tolist() == [True, False, True, False]


@pytest.mark.parametrize("name", ["erdemarslan380__sitl_max_80", "erdemarslan380__sitl_windy"])
def test_gazebo_attitude_differs_in_heading_alone_as_its_magnetic_field_does(name: str, shared_logs: Path) -> None:
    flight = canonical(read_ulog(shared_logs / f"{name}.ulg"))
    truth, own, mag = read_truth(flight), flight.topic("vehicle_attitude"), flight.topic("vehicle_magnetometer")
    assert truth is not None
    assert own is not None
    assert mag is not None
    # Two seconds after alignment, before take-off.
    time = own["timestamp_sample"].astype(np.int64)
    rest = (time > truth.time[0] + 1_600_000) & (time < truth.time[0] + 2_600_000)
    attitude = interpolate_quaternion(truth.attitude_time, truth.quaternion, time[rest])
    told = attitude_figures(stacked(own, "q")[rest], true_attitude(attitude))
    found = {(one.axis, one.metric): one.value for one in told}
    assert found["tilt", "rmse"] < 0.3
    # The field in the true frame against the declination of the estimator's model explains the heading.
    sampled = mag["timestamp_sample"].astype(np.int64)
    rows = (sampled > truth.time[0]) & (sampled < truth.time[0] + 1_600_000)
    turned = Rotation.from_quat(
        interpolate_quaternion(truth.attitude_time, truth.quaternion, sampled[rows]), scalar_first=True
    ).apply(stacked(mag, "magnetometer_ga")[rows])
    azimuth = np.degrees(np.arctan2(turned[:, 1], turned[:, 0])).mean()
    declination = float(flight.parameters.initial["EKF2_MAG_DECL"])
    assert found["heading", "mean_error"] == pytest.approx(declination - azimuth, abs=0.3)
    assert found["heading", "mean_error"] == pytest.approx(6.0, abs=0.3)
