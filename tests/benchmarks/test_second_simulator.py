"""The second simulator: its derivatives, its sensors without errors, and the statistics of their errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytestmark = pytest.mark.usefixtures("benchmarks")


@pytest.fixture(scope="module")
def truth():
    """An aggressive flight of 30 s in a wind."""
    from benchmarks.decision_study.second_simulator.path import fly_path
    from benchmarks.decision_study.second_simulator.truth import STEP_S, true_motion

    return true_motion(fly_path("aggressive", 30.0, STEP_S, np.random.default_rng(3)), np.array([3.0, -1.0, 0.0]))


def errorless():
    from benchmarks.decision_study.second_simulator.settings import Imu, Inertial

    nothing = Inertial(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Imu(accelerometer=nothing, gyro=nothing)


def test_velocity_and_acceleration_are_derivatives(truth) -> None:
    from benchmarks.decision_study.second_simulator.truth import STEP_S

    inner = slice(1, -1)
    for value, derivative in ((truth.position, truth.velocity), (truth.velocity, truth.acceleration)):
        # Central differences err by the third derivative times a sixth of the squared step, some 1e-6 here.
        central = (value[2:] - value[:-2]) / (2.0 * STEP_S)
        assert np.abs(central - derivative[inner]).max() < 1e-4


def test_aggressive_flights_are_as_fast_as_they_say(truth) -> None:
    assert 7.0 < np.linalg.norm(truth.velocity, axis=1).max() < 11.0
    assert 4.0 < np.linalg.norm(truth.acceleration, axis=1).max() < 9.0


def test_the_vehicle_stands_level_before_take_off(truth) -> None:
    from benchmarks.decision_study.second_simulator.truth import GRAVITY_M_S2

    assert truth.specific_force[0] == pytest.approx([0.0, 0.0, -GRAVITY_M_S2], abs=1e-9)


def test_an_imu_without_errors_leads_back_to_the_truth(truth) -> None:
    """Strapdown integration of the samples: attitude by rotation vectors, velocity with half of each rotation."""
    from benchmarks.decision_study.second_simulator.chance import streams
    from benchmarks.decision_study.second_simulator.imu import sensor_combined
    from benchmarks.decision_study.second_simulator.truth import EARTH_RATE, GRAVITY_M_S2

    table = sensor_combined(truth, errorless(), streams(0))
    rate = np.column_stack([table[f"gyro_rad[{axis}]"] for axis in range(3)]).astype(float)
    force = np.column_stack([table[f"accelerometer_m_s2[{axis}]"] for axis in range(3)]).astype(float)
    step_s = table["gyro_integral_dt"][0] * 1e-6
    assert table["timestamp"][0] == round(step_s * 1e6)
    # Ten seconds in the air; sample k ends at instant every * (k + 1) of the truth.
    every, first, last = 4, 20 * 250, 30 * 250
    attitude, velocity = truth.attitude[every * first], truth.velocity[every * first].copy()
    earth = Rotation.from_rotvec(-EARTH_RATE * step_s)
    for turned, push in zip(rate[first:last] * step_s, force[first:last], strict=True):
        coriolis = 2.0 * np.cross(EARTH_RATE, velocity)
        half = attitude * Rotation.from_rotvec(0.5 * turned)
        velocity += step_s * (half.apply(push) + [0.0, 0.0, GRAVITY_M_S2] - coriolis)
        attitude = earth * attitude * Rotation.from_rotvec(turned)
    assert np.degrees((attitude.inv() * truth.attitude[every * last]).magnitude()) < 0.01
    # Single precision of the samples alone makes a random walk of some 1e-4 m/s.
    assert velocity == pytest.approx(truth.velocity[every * last], abs=0.005)


def test_a_receiver_without_errors_says_where_the_vehicle_was(truth) -> None:
    from benchmarks.decision_study.second_simulator.aiding import vehicle_gps_position
    from benchmarks.decision_study.second_simulator.settings import Gnss, Wander
    from benchmarks.decision_study.second_simulator.truth import LAT_DEG

    nothing = Wander(0.0, 0.0, 1.0)
    gnss = Gnss(delay_ms=210.0, velocity=nothing, position=nothing)
    table = vehicle_gps_position(truth, gnss, np.random.default_rng(0))
    measured_s = table["timestamp"] * 1e-6 - 0.210
    assert table["vel_n_m_s"] == pytest.approx(truth.at(measured_s, truth.velocity[:, 0]), abs=1e-4)
    # A degree of latitude is 111 km, here 110.81 km (WGS-84 at 27.5° south).
    north = (table["latitude_deg"] - LAT_DEG) * 110_811.0
    assert north == pytest.approx(truth.at(measured_s, truth.position[:, 0]), abs=0.01)


def test_markov_errors_have_their_spread_and_time() -> None:
    from benchmarks.decision_study.second_simulator.chance import markov

    errors = markov(np.random.default_rng(0), 200_000, 1, 0.2, 0.3, 2.0)[:, 0]
    assert errors.std() == pytest.approx(0.3, rel=0.03)
    # exp(-1 s / 2 s)
    assert np.corrcoef(errors[:-5], errors[5:])[0, 1] == pytest.approx(np.exp(-0.5), abs=0.02)


def test_the_resonance_has_unit_variance_and_its_peak_where_it_is_said() -> None:
    from benchmarks.decision_study.second_simulator.chance import resonance

    shaking = resonance(np.random.default_rng(0), 2**16, 1, 1 / 250, 38.0, 0.1)[:, 0]
    assert shaking.std() == pytest.approx(1.0, rel=0.03)
    power = np.abs(np.fft.rfft(shaking.reshape(-1, 256), axis=1)) ** 2
    assert np.fft.rfftfreq(256, 1 / 250)[power.mean(axis=0).argmax()] == pytest.approx(38.0, abs=2.0)


def test_settings_that_do_not_exist_are_refused() -> None:
    from benchmarks.decision_study.second_simulator import second_world

    assert second_world("w", {"gnss": {"velocity": {"white": 0.8}}}).gnss.velocity.white == 0.8
    with pytest.raises(TypeError, match="Gnss has no setting rate"):
        second_world("w", {"gnss": {"rate": 5}})


def test_a_default_profile_log_begins_at_arming_and_is_thinned() -> None:
    from benchmarks.decision_study.second_simulator import fly, second_world

    whole = fly(second_world("w", {"airborne_s": 30.0}), 0, 7)
    small = fly(second_world("w", {"airborne_s": 30.0, "default_profile": True}), 0, 7)
    times = {name: small.topics[name, 0]["timestamp"] for name in ("sensor_combined", "vehicle_magnetometer")}
    assert times["sensor_combined"][0] >= 13_000_000  # armed 3 s before take-off at 16 s
    kept = np.count_nonzero(whole.topics["sensor_combined", 0]["timestamp"] >= 13_000_000)
    assert times["sensor_combined"].size == pytest.approx(0.96 * kept, rel=0.02)
    assert np.median(np.diff(times["vehicle_magnetometer"])) == pytest.approx(500_000, rel=0.1)
    assert ("estimator_states", 0) in small.topics
