"""A short flight and its truth, shared by the tests of the simulated vehicle."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from fusetune.design.missions.mission import Home, Landing, Mission, Takeoff, Waypoint
from fusetune.execute.vehicle import InertialSensor, Vehicle, Vibration, load_vehicle
from fusetune.execute.world.flight_plan import FlightPlan, plan_flight
from fusetune.execute.world.truth import Truth, simulate_truth

SEED = 7


@pytest.fixture(scope="session")
def vehicle(project_root: Path) -> Vehicle:
    return load_vehicle(project_root / "config/vehicles/quadrotor.yaml")


@pytest.fixture(scope="session")
def ideal_imu_vehicle(vehicle: Vehicle) -> Vehicle:
    """The quadrotor with perfect inertial sensors."""
    perfect = InertialSensor(0.0, 0.0, 0.0, 0.0, 0.0, 1e9)
    imu = dataclasses.replace(
        vehicle.imu, accelerometer=perfect, gyro=perfect, vibration=Vibration(90.0, 0.0, 0.0, 0.0, 0.0)
    )
    return dataclasses.replace(vehicle, imu=imu)


@pytest.fixture(scope="session")
def mission() -> Mission:
    """Up, a fly-over corner, a fly-by corner, a hold, back and down."""
    return Mission(
        name="short",
        home=Home(47.397742, 8.545594, 488.0, geoid_undulation_m=47.4, heading_deg=30.0),
        takeoff=Takeoff(5.0, climb_speed_m_s=2.0, ground_s=5.0),
        waypoints=(
            Waypoint(47.397922, 8.545594, 6.0, 5.0, turn="fly_over"),
            Waypoint(47.397922, 8.545860, 8.0, 5.0),
            Waypoint(47.397742, 8.545860, 8.0, 5.0, hold_s=2.0),
        ),
        landing=Landing("return", descent_speed_m_s=1.2, ground_s=4.0),
        speed_m_s=5.0,
    )


@pytest.fixture(scope="session")
def plan(mission: Mission, vehicle: Vehicle) -> FlightPlan:
    return plan_flight(mission, vehicle.limits)


@pytest.fixture(scope="session")
def truth(plan: FlightPlan, vehicle: Vehicle) -> Truth:
    return simulate_truth(plan, vehicle, SEED)
