"""The true motion: earth, attitude, gusts."""

from __future__ import annotations

import dataclasses
import datetime
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.execute.vehicle import Environment, Vehicle
from fusetune.execute.world import earth
from fusetune.execute.world.flight_plan import FlightPlan
from fusetune.execute.world.truth import STANDARD_GRAVITY_M_S2, Truth, simulate_truth
from fusetune.execute.world.wind import gusts, mean_wind, turbulence_scales


@given(st.floats(-1.55, 1.55), st.floats(-3.1, 3.1), st.floats(-100.0, 9000.0))
def test_geodetic_conversion_goes_there_and_back(lat: float, lon: float, height: float) -> None:
    there = earth.ecef_from_geodetic(lat, lon, height)
    back = earth.geodetic_from_ecef(there)
    assert back[0] == pytest.approx(lat, abs=1e-13)
    assert back[1] == pytest.approx(lon, abs=1e-13)
    assert back[2] == pytest.approx(height, abs=2e-8)


def test_normal_gravity_at_pole_and_equator() -> None:
    # WGS-84 (NIMA TR8350.2, table 3.4): 9.8321849379 and 9.7803253359 m/s²
    assert float(earth.normal_gravity(np.float64(math.pi / 2), np.float64(0.0))) == pytest.approx(
        9.8321849379, abs=1e-9
    )
    assert float(earth.normal_gravity(np.float64(0.0), np.float64(0.0))) == pytest.approx(9.7803253359, abs=1e-9)


def test_map_projection_of_a_place_due_east_on_the_equator() -> None:
    north, east = earth.map_projection(np.array([0.0]), np.array([1e-5]), 0.0, 0.0)
    assert float(north[0]) == pytest.approx(0.0, abs=1e-9)
    assert float(east[0]) == pytest.approx(63.71, abs=1e-9)


def test_magnetic_field_matches_the_test_values_of_the_model() -> None:
    # World Magnetic Model 2025, published test values: 2025.0, 0 km, 80° N, 0° E: X 6521.6, Y 145.9, Z 54791.5 nT
    field = earth.magnetic_field_ned(80.0, 0.0, 0.0, datetime.date(2025, 1, 1)) * earth.NANOTESLA_PER_GAUSS
    assert field == pytest.approx([6521.6, 145.9, 54791.5], abs=0.1)


def test_kinematics_are_consistent(truth: Truth) -> None:
    step_s = truth.step_s
    assert np.allclose(np.gradient(truth.position, step_s, axis=0)[2:-2], truth.velocity[2:-2], atol=1e-5)
    # Gusts are linear between the samples of the turbulence, so acceleration has kinks there
    assert np.allclose(np.gradient(truth.velocity, step_s, axis=0)[2:-2], truth.acceleration[2:-2], atol=5e-3)


def test_hover_in_calm_air_is_level_and_feels_gravity(plan: FlightPlan, vehicle: Vehicle) -> None:
    calm = dataclasses.replace(vehicle.environment, wind_speed_m_s=0.0, turbulence_wind_m_s=0.0)
    truth = simulate_truth(plan, dataclasses.replace(vehicle, environment=calm), 1)
    hovering = (np.linalg.norm(truth.velocity, axis=1) < 1e-9) & (-truth.position[:, 2] > 4.0)
    assert hovering.any()
    gravity = earth.normal_gravity(np.float64(plan.frame.lat_rad), np.float64(plan.frame.height_m + 8.0))
    force = truth.specific_force[hovering]
    assert np.allclose(force[:, :2], 0.0, atol=1e-4)
    assert np.allclose(force[:, 2], -float(gravity), atol=2e-5)
    assert truth.rotor_speed[hovering] == pytest.approx(math.sqrt(float(gravity) / STANDARD_GRAVITY_M_S2), abs=1e-4)


def test_wind_tilts_the_hovering_vehicle_against_it(plan: FlightPlan, vehicle: Vehicle) -> None:
    steady = dataclasses.replace(vehicle.environment, wind_speed_m_s=4.0, wind_from_deg=0.0, turbulence_wind_m_s=0.0)
    truth = simulate_truth(plan, dataclasses.replace(vehicle, environment=steady), 1)
    index = int(np.flatnonzero((np.linalg.norm(truth.velocity, axis=1) < 1e-9) & (-truth.position[:, 2] > 4.0))[0])
    # Drag per mass over gravity: (0.25 + 0.012 · 4) · 4 / 9.80
    airframe = vehicle.airframe
    drag = (airframe.linear_drag_1_s + airframe.quadratic_drag_1_m * 4.0) * 4.0
    down = truth.attitude[index].apply([0.0, 0.0, 1.0])
    assert math.atan2(math.hypot(down[0], down[1]), down[2]) == pytest.approx(math.atan2(drag, 9.8045), abs=1e-3)
    # The wind comes from the north, so the vehicle leans north: its down axis points south
    assert down[0] < 0.0


def test_turn_feels_the_centripetal_force_without_side_force(plan: FlightPlan, vehicle: Vehicle) -> None:
    airframe = dataclasses.replace(vehicle.airframe, linear_drag_1_s=0.0, quadratic_drag_1_m=0.0)
    truth = simulate_truth(plan, dataclasses.replace(vehicle, airframe=airframe), 1)
    flying = (truth.after_takeoff_s > 2.0) & (truth.time_s < truth.events.touchdown_s - 2.0)
    # Without drag the rotors make the whole force: a bank of atan(a/g) and no force across the body
    assert np.allclose(truth.specific_force[flying][:, :2], 0.0, atol=1e-9)
    horizontal = np.hypot(truth.acceleration[:, 0], truth.acceleration[:, 1])
    index = int(np.argmax(np.where(flying, horizontal, 0.0)))
    bank = math.acos(truth.attitude[index].as_matrix()[2, 2])
    expected = math.atan2(horizontal[index], 9.8045 - truth.acceleration[index, 2])
    assert bank == pytest.approx(expected, abs=1e-3)


def test_vehicle_rests_before_take_off_and_after_landing(truth: Truth) -> None:
    resting = (truth.time_s < truth.events.takeoff_s) | (truth.time_s > truth.events.touchdown_s)
    assert np.allclose(truth.velocity[resting], 0.0, atol=1e-9)
    assert np.allclose(truth.position[truth.time_s < truth.events.takeoff_s], 0.0, atol=1e-9)
    assert np.linalg.norm(truth.position[-1]) < 1e-6


def test_gusts_push_the_vehicle_by_decimetres_not_metres(truth: Truth, plan: FlightPlan) -> None:
    pushed = np.linalg.norm(truth.position - plan.path.evaluate(truth.time_s), axis=1)
    assert 0.02 < pushed.max() < 1.0


def test_turbulence_has_the_deviation_and_spectrum_of_dryden() -> None:
    environment = Environment(datetime.date(2025, 6, 1), 3.0, 270.0, 8.0)
    time_s = np.arange(0.0, 4000.0, 0.1)
    wind = gusts(environment, time_s, 10.0, 5.0, 3)
    scales = turbulence_scales(10.0, 8.0, math.hypot(3.0, 5.0))
    # MIL-F-8785C at 32.8 ft: σ_w = 0.1 W20, L_w = h, σ_u / σ_w = (0.177 + 0.000823 h)^-0.4
    assert scales.deviation[2] == pytest.approx(0.8)
    assert scales.deviation[0] == pytest.approx(0.8 / (0.177 + 0.000823 * 32.808) ** 0.4, rel=1e-4)
    assert scales.time_constant_s[2] == pytest.approx(10.0 / math.hypot(3.0, 5.0))
    assert wind[:, 2].std() == pytest.approx(scales.deviation[2], rel=0.05)
    # From the west: the longitudinal gust is the eastern one, a first-order process
    lag = 5
    east = wind[:, 1] - wind[:, 1].mean()
    correlation = float(np.mean(east[lag:] * east[:-lag]) / np.mean(east**2))
    assert correlation == pytest.approx(math.exp(-0.5 / scales.time_constant_s[0]), abs=0.02)
    assert mean_wind(environment) == pytest.approx([0.0, 3.0, 0.0], abs=1e-12)
