"""Planned paths: limits, corners, smoothness."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.design.missions.filtered_path import FilteredPath
from fusetune.design.missions.limits import Limits
from fusetune.design.missions.mission import Home, Landing, Mission, Takeoff, Waypoint, load_mission, mission_of
from fusetune.design.missions.route import route_of
from fusetune.execute.vehicle import Vehicle
from fusetune.execute.world.flight_plan import FlightPlan, plan_flight
from fusetune.execute.world.truth import simulate_truth

LIMITS = Limits(12.0, 3.0, 1.5, 4.0, 12.0, 60.0, 120.0)


def test_filtered_step_of_velocity_matches_numerical_averaging() -> None:
    windows = (1.0, 0.5, 0.25)
    path = FilteredPath(np.array([0.0, 2.0, 3.0]), np.array([[0.0], [4.0], [3.0]]), windows)
    time_s = np.arange(-3.0, 6.0, 1e-3)
    expected = np.interp(time_s, path.times_s, path.knots[:, 0])
    for window in windows:
        width = round(window * 1e3)
        kernel = np.ones(width + 1)
        kernel[[0, -1]] = 0.5
        expected = np.convolve(expected, kernel / width, mode="same")
    inner = slice(1500, -1500)
    assert np.allclose(path.evaluate(time_s)[inner, 0], expected[inner], atol=1e-5)


def test_derivatives_are_derivatives_of_each_other() -> None:
    path = FilteredPath(np.array([0.0, 2.0, 3.0, 3.2]), np.array([[0.0], [4.0], [3.0], [3.1]]), (1.0, 0.5, 0.25))
    time_s = np.arange(-2.0, 6.0, 1e-4)
    for order in (1, 2, 3):
        numerical = np.gradient(path.evaluate(time_s, order - 1)[:, 0], time_s)
        assert np.allclose(numerical[2:-2], path.evaluate(time_s, order)[2:-2, 0], atol=6e-3)


def mission_through(points: list[tuple[float, float, float, float, bool, bool]], altitude: float) -> Mission:
    waypoints = tuple(
        Waypoint(47.0 + north / 111_000, 8.0 + east / 76_000, alt, speed, "fly_over" if over else "fly_by", 1.0 * hold)
        for north, east, alt, speed, over, hold in points
    )
    return Mission("m", Home(47.0, 8.0, 400.0), Takeoff(altitude), waypoints, Landing("return"))


point = st.tuples(
    st.floats(-80.0, 80.0),
    st.floats(-80.0, 80.0),
    st.floats(2.0, 40.0),
    st.floats(0.5, 15.0),
    st.booleans(),
    st.booleans(),
)


@settings(max_examples=40, deadline=None)
@given(st.lists(point, min_size=1, max_size=5), st.floats(2.0, 30.0))
def test_limits_hold_for_any_mission(
    points: list[tuple[float, float, float, float, bool, bool]], altitude: float
) -> None:
    plan = plan_flight(mission_through(points, altitude), LIMITS)
    time_s = np.arange(plan.events.log_start_s, plan.events.end_s, 0.02)
    velocity, acceleration, jerk = (plan.path.evaluate(time_s, order) for order in (1, 2, 3))
    fastest = max(max(values[3] for values in points), 5.0)
    assert np.hypot(velocity[:, 0], velocity[:, 1]).max() <= min(fastest, LIMITS.horizontal_speed_m_s) + 1e-6
    assert -velocity[:, 2].min() <= LIMITS.climb_speed_m_s + 1e-6
    assert velocity[:, 2].max() <= LIMITS.descent_speed_m_s + 1e-6
    assert np.linalg.norm(acceleration, axis=1).max() <= LIMITS.acceleration_m_s2 + 1e-6
    assert np.linalg.norm(jerk, axis=1).max() <= LIMITS.jerk_m_s3 + 1e-6
    yaw_rate, yaw_acceleration = np.degrees(plan.yaw.evaluate(time_s, 1)), np.degrees(plan.yaw.evaluate(time_s, 2))
    assert np.abs(yaw_rate).max() <= LIMITS.yaw_rate_deg_s + 1e-6
    assert np.abs(yaw_acceleration).max() <= LIMITS.yaw_acceleration_deg_s2 + 1e-6
    start, end = plan.path.evaluate(np.array([plan.events.takeoff_s - 1.0, plan.events.touchdown_s + 1.0]))
    assert np.allclose(start, 0.0, atol=1e-9)
    assert np.allclose(end, 0.0, atol=1e-6)


def nearest_m(plan: FlightPlan, mission: Mission, index: int) -> float:
    waypoint = mission.waypoints[index]
    target = plan.frame.from_geodetic(
        math.radians(waypoint.lat), math.radians(waypoint.lon), plan.frame.height_m + waypoint.alt
    )
    time_s = np.arange(plan.events.takeoff_s, plan.events.touchdown_s, 0.005)
    return float(np.linalg.norm(plan.path.evaluate(time_s) - target, axis=1).min())


def mean_absolute_deviation(windows: tuple[float, ...]) -> float:
    """E|t| of the filter's kernel, the density of a sum of uniform variables, by numerical convolution."""
    step = 1e-3
    kernel = np.ones(1)
    for window in windows:
        kernel = np.convolve(kernel, np.ones(round(window / step)))
    time_s = (np.arange(len(kernel)) - 0.5 * (len(kernel) - 1)) * step
    return float(np.sum(np.abs(time_s) * kernel) / np.sum(kernel))


def test_fly_over_crosses_the_waypoint_and_fly_by_cuts_the_corner(mission: Mission, plan: FlightPlan) -> None:
    assert nearest_m(plan, mission, 0) < 0.02
    waypoint = mission.waypoints[1]
    corner = plan.frame.from_geodetic(
        math.radians(waypoint.lat), math.radians(waypoint.lon), plan.frame.height_m + waypoint.alt
    )
    knot = int(np.argmin(np.linalg.norm(plan.path.knots - corner, axis=1)))
    legs = (
        np.diff(plan.path.knots[knot - 1 : knot + 2], axis=0) / np.diff(plan.path.times_s[knot - 1 : knot + 2])[:, None]
    )
    # At the time of the corner the averaged path is off it by Δv E[max(t, 0)] = Δv E|t| / 2, and that is nearest for
    # two legs of nearly equal speed
    expected = np.linalg.norm(legs[1] - legs[0]) * mean_absolute_deviation(plan.path.windows_s) / 2.0
    assert nearest_m(plan, mission, 1) == pytest.approx(expected, rel=0.03)
    assert expected > 1.0
    assert nearest_m(plan, mission, 2) < 1e-6


def test_vehicle_stands_still_while_it_holds(mission: Mission, plan: FlightPlan) -> None:
    time_s = np.arange(plan.events.takeoff_s + 10.0, plan.events.touchdown_s, 0.01)
    position = plan.path.evaluate(time_s)
    waypoint = mission.waypoints[2]
    target = plan.frame.from_geodetic(
        math.radians(waypoint.lat), math.radians(waypoint.lon), plan.frame.height_m + waypoint.alt
    )
    standing = np.linalg.norm(position - target, axis=1) < 1e-6
    assert waypoint.hold_s <= standing.sum() * 0.01 <= waypoint.hold_s + 0.1


def test_yaw_follows_the_course(mission: Mission, plan: FlightPlan) -> None:
    time_s = np.arange(plan.events.takeoff_s, plan.events.touchdown_s, 0.01)
    velocity, yaw = plan.path.evaluate(time_s, 1), plan.yaw.evaluate(time_s)[:, 0]
    straight = (np.linalg.norm(plan.path.evaluate(time_s, 2), axis=1) < 1e-9) & (np.hypot(*velocity.T[:2]) > 1.0)
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    error = np.angle(np.exp(1j * (yaw - course)))[straight]
    assert straight.sum() > 300
    assert np.median(np.abs(error)) < 1e-6


def test_the_survey_is_flown_as_it_always_was(project_root: Path, vehicle: Vehicle) -> None:
    """As the version planned it that knew neither shapes nor turns in place; logs of a seed stay the same bytes."""
    plan = plan_flight(load_mission(project_root / "config/missions/survey.yaml"), vehicle.limits)
    assert plan.path.windows_s == pytest.approx((3.204001404494074, 2.0 / 3.0, 0.3), rel=1e-12)
    times = [
        19.085334036, 25.085334036, 27.170668071, 30.507166878, 32.592500913, 35.51117214, 38.733170011, 45.441712446,
        47.527046482, 53.307396963, 58.385241981, 65.555910052, 74.980472057, 79.151140128, 89.150931315, 97.150931315,
    ]  # fmt: skip
    assert plan.path.times_s == pytest.approx(times, abs=1e-8)
    assert plan.path.knots[8] == pytest.approx((-2.28230006, 20.477869861, -16.621713711), abs=1e-8)
    assert plan.path.knots[10] == pytest.approx((39.805521274, 40.163736865, -15.999749424), abs=1e-8)
    yaw = [0.34906585, 0.022629229, 0.001077394, 1.547786468, 3.134086523, 1.044121011, -0.009918831, -2.351715104]
    assert plan.yaw.knots[1::2, 0] == pytest.approx(yaw, abs=1e-8)


def test_runs_turns_and_holds_are_flown_where_the_route_has_them(vehicle: Vehicle) -> None:
    shapes = [
        {"kind": "yaw_turns", "altitude_m": 8, "hold_s": 1.0},
        {"kind": "runs", "altitude_m": 8, "distance_m": 40, "climb_m": 6, "repeats": 1, "heading_deg": 60},
    ]
    document = {"name": "m", "home": {"lat": 47.0, "lon": 8.0, "alt": 400.0}, "takeoff": {"altitude_m": 8}}
    mission = mission_of({**document, "shapes": shapes, "landing": {"mode": "return"}}, "m.yaml")
    plan = plan_flight(mission, vehicle.limits)
    truth = simulate_truth(plan, with_calm_air(vehicle), 1)
    up = truth.time_s
    for leg in route_of(mission)[1:-1]:
        # the local map is a sphere: 0.3 % along the meridian
        distance = np.linalg.norm(truth.position - np.array(leg.end), axis=1)
        near = distance < 0.3
        assert near.any(), leg
        still = near & (np.linalg.norm(truth.velocity, axis=1) < 0.02)
        assert still.sum() * truth.step_s > leg.hold_s, leg
        if leg.heading_deg is not None:
            yaw = np.degrees(plan.yaw.evaluate(up[still])[:, 0])
            assert np.abs(np.mod(yaw - leg.heading_deg + 180.0, 360.0) - 180.0).min() < 1e-3, leg
    running = (up > plan.events.takeoff_s + 60.0) & (np.hypot(*truth.velocity[:, :2].T) > 3.0)
    heading = np.degrees(truth.attitude[running].as_euler("ZYX")[:, 0])
    assert heading[: len(heading) // 2] == pytest.approx(60.0, abs=3.0)


def with_calm_air(vehicle: Vehicle) -> Vehicle:
    calm = dataclasses.replace(vehicle.environment, wind_speed_m_s=0.0, turbulence_wind_m_s=0.0)
    return dataclasses.replace(vehicle, environment=calm)
