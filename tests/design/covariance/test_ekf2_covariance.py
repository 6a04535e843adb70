"""EKF2's covariance recursion along a track: that it is the filter's own, and that it follows from the timing alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusetune.design.covariance.ekf2_covariance import CovarianceAlong, covariance_along
from fusetune.design.covariance.ekf2_design import Ekf2Design, MissionWay, Settings, deviations_of
from fusetune.design.covariance.ekf2_sensors import Ekf2Sensor, told_parameters
from fusetune.design.covariance.perfect_flight import perfect_flight
from fusetune.design.covariance.track import Track
from fusetune.design.missions.mission import load_mission
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_AXES
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.replay.replay import replay
from fusetune.errors import UserError
from fusetune.execute.mission_track import mission_track
from fusetune.execute.vehicle import load_vehicle
from fusetune.px4.aid_sources import AID_SOURCES

SENSORS = {"gnss": Ekf2Sensor(5.0, 110.0), "mag": Ekf2Sensor(50.0), "baro": Ekf2Sensor(20.0)}
STATES = slice(0, 9)
"""Attitude, velocity, position."""


@pytest.fixture(scope="module")
def track(project_root: Path) -> Track:
    return mission_track(
        load_mission(project_root / "config/missions/short_survey.yaml"),
        load_vehicle(project_root / "config/vehicles/quadrotor.yaml"),
    )


@pytest.fixture(scope="module")
def design(track: Track) -> Ekf2Design:
    return Ekf2Design(Path("d.yaml"), "d", Settings(SENSORS, {}), MissionWay("", ""), settle_s=15.0, track=track)


@pytest.fixture(scope="module")
def base(design: Ekf2Design) -> CovarianceAlong:
    return design.along(design.settings)


def test_the_track_is_a_motion_that_its_imu_goes_with(track: Track) -> None:
    """Differences of position are the velocity; of velocity and attitude, what gravity and the IMU say."""
    dt = np.diff(track.timestamp_us)[:, None] * 1e-6
    mean_velocity = 0.5 * (track.velocity[1:] + track.velocity[:-1])
    assert np.abs(np.diff(track.position, axis=0) / dt - mean_velocity).max() < 2e-3
    turn = np.swapaxes(track.body_from_ned_at(track.timestamp_us), -1, -2)
    force = np.einsum("nij,nj->ni", 0.5 * (turn[1:] + turn[:-1]), track.specific_force[1:])
    felt = np.diff(track.velocity, axis=0) / dt - [0.0, 0.0, 9.807]
    assert np.abs(force - felt).max() < 0.02
    assert track.in_air.any()
    assert track.at_rest[0]


def test_perfect_sensors_leave_the_filter_on_its_track(track: Track) -> None:
    told = told_parameters(SENSORS, {})
    result = replay(build_inputs(perfect_flight(track, SENSORS, told)), told)
    settled = result.innovations["timestamp_sample"] > track.timestamp_us[track.in_air][0] + 15_000_000
    names = result.source_names()
    for name in ("gnss_pos", "gnss_vel", "gnss_hgt", "baro_hgt", "mag"):
        rows = result.innovations[settled & (names == name)]
        assert rows["fused"].all()
        assert rows["test_ratio"].max() < 0.02, name


def test_p_follows_from_the_timing_and_not_from_what_is_measured(track: Track, base: CovarianceAlong) -> None:
    """The same flight with noise, white, a fifth of what EKF2 is told: only where F and H are taken differs then.

    With all of it the filter may distrust its accelerometer, by chance (benchmarks/covariance_check.py).
    """
    told = told_parameters(SENSORS, {})
    flight = perfect_flight(track, SENSORS, told)
    rng = np.random.default_rng(1)
    for topic, noises in (
        ("vehicle_gps_position", {"vel_n_m_s": 0.3, "vel_e_m_s": 0.3, "vel_d_m_s": 0.45, "altitude_msl_m": 0.75,
                                  "latitude_deg": 0.5 / 111e3, "longitude_deg": 0.5 / 75e3}),
        ("vehicle_air_data", {"baro_alt_meter": 3.5}),
        ("vehicle_magnetometer", {f"magnetometer_ga[{i}]": 0.05 for i in range(3)}),
    ):  # fmt: skip
        table = flight.topics[topic, 0]
        for name, sd in noises.items():
            table[name] = table[name] + 0.2 * sd * rng.standard_normal(len(table[name]))
    told |= {"EKF2_REQ_HDRIFT": 5.0, "EKF2_REQ_VDRIFT": 5.0}
    flown = track.timestamp_us[track.in_air]
    window = (int(flown[0]) + 15_000_000, int(flown[-1]))
    noisy = covariance_along(flight, told, window)
    assert noisy.horizon_us == pytest.approx(base.horizon_us)
    sd, noisy_sd = (np.sqrt(np.einsum("kii->ki", one.before)[:, STATES].mean(axis=0)) for one in (base, noisy))
    assert noisy_sd == pytest.approx(sd, rel=0.02)


def test_just_before_a_correction_is_what_the_innovation_variance_says(track: Track) -> None:
    """S = H P Hᵀ + R of GNSS velocity, the first that GNSS corrects; without a magnetometer nothing comes before it."""
    sensors = {"gnss": SENSORS["gnss"], "ev": Ekf2Sensor(3.0, 20.0, used=False)}
    told = told_parameters(sensors, {"EKF2_MAG_TYPE": 5, "EKF2_GPS_CTRL": 7, "EKF2_IMU_CTRL": 3})
    flight = perfect_flight(track, sensors, told)
    start = int(track.timestamp_us[track.in_air][0])
    along = covariance_along(flight, told, (start, start + 30_000_000))
    result = replay(build_inputs(flight), told)
    rows = result.innovations[result.source_names() == "gnss_vel"].reshape(-1, AID_SOURCE_AXES["gnss_vel"])
    at = np.searchsorted(rows["timestamp_sample"][:, 0], along.horizon_us, side="right") - 1
    before = (rows["innovation_variance"] - rows["observation_variance"])[at]
    # the first sample resets the velocity and is no correction
    for axis in range(3):
        place = VELOCITY + axis
        assert along.before[1:, place, place] == pytest.approx(before[1:, axis], rel=1e-3)


def test_sensors_off_faster_noisier_and_later_do_what_they_must(design: Ekf2Design, base: CovarianceAlong) -> None:
    assert base.rejected == 0.0
    assert AID_SOURCES[base.source].sensor == "gnss"
    before = deviations_of(base)

    def ratio(state: str, **changes: float | bool | str) -> tuple[float, float]:
        after = design.deviations({name.replace("__", "."): change for name, change in changes.items()})[state]
        assert after.now is not None
        assert before[state].now is not None
        return after.before / before[state].before, after.now / before[state].now

    assert ratio("position_horizontal", gnss__sd="×2")[0] == pytest.approx(2.0, abs=0.2)
    assert ratio("velocity_horizontal", gnss__rate_hz="×2")[0] < 0.9
    assert ratio("position_horizontal", gnss__used=False)[0] > 20.0
    assert ratio("yaw", mag__used=False)[0] > 1.1
    assert ratio("tilt", gyro__sd="÷2")[0] < 0.9
    later = ratio("velocity_horizontal", gnss__delay_ms=250.0)
    # at the horizon nothing is late; what the vehicle has at present was corrected longer ago
    assert later[0] == pytest.approx(1.0, abs=0.01)
    assert later[1] > 1.03


def test_now_is_the_recursion_without_measurements_over_the_delay(base: CovarianceAlong) -> None:
    """The position's variance grows by what velocity and their correlation add: P_p + 2 τ P_pv + τ² P_v, nearly."""
    lag_s = 0.115
    for axis in range(3):
        p, v = 6 + axis, 3 + axis
        grown = base.before[:, p, p] + 2.0 * lag_s * base.before[:, p, v] + lag_s**2 * base.before[:, v, v]
        assert base.now[:, p, p] == pytest.approx(grown, rel=0.01)


def test_a_flight_too_short_to_settle_is_told(design: Ekf2Design) -> None:
    with pytest.raises(UserError, match="in the air, of which 500 s are left out"):
        replace(design, settle_s=500.0).deviations({})
