"""From a mission to the path in time that the vehicle means to fly, and the events of the flight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.design.missions.mission import Mission, Waypoint
from fusetune.execute.vehicle import Limits
from fusetune.execute.world.earth import TangentFrame
from fusetune.execute.world.filtered_path import FilteredPath, window_lengths

ARMED_BEFORE_TAKEOFF_S = 3.0
DISARMED_AFTER_TOUCHDOWN_S = 2.0
YAW_WINDOW_S = 0.3
LANDING_SLOW_HEIGHT_M = 4.0
"""Below this height the last part of the descent is flown at `LANDING_SLOW_SPEED_M_S`, as PX4 lands."""
LANDING_SLOW_SPEED_M_S = 0.5


@dataclass(frozen=True)
class FlightEvents:
    """Times of the flight, s since boot."""

    log_start_s: float
    armed_s: float
    takeoff_s: float
    """The vehicle leaves the ground."""
    touchdown_s: float
    disarmed_s: float
    end_s: float


@dataclass(frozen=True)
class FlightPlan:
    """Where the vehicle means to be, and which way it means to point, at every time."""

    frame: TangentFrame
    path: FilteredPath
    """North, east, down from home, m."""
    yaw: FilteredPath
    """Continuous, rad."""
    events: FlightEvents


@dataclass
class _Leg:
    """A straight part of the path; `speed_m_s` 0 marks a rest of `duration_s`."""

    end: np.ndarray
    duration_s: float
    yaw: float | None


def home_frame(mission: Mission) -> TangentFrame:
    """Tangent frame at home."""
    home = mission.home
    return TangentFrame(math.radians(home.lat), math.radians(home.lon), home.alt + home.geoid_undulation_m)


def plan_flight(mission: Mission, limits: Limits, log_start_s: float = 2.0) -> FlightPlan:
    """Plan the flight of a mission within the limits of a vehicle.

    Fly-by waypoints are corners of the unfiltered path, which the filter cuts. A fly-over waypoint is crossed: its
    leg goes on straight for half the filter's window and the turn follows after it. Where the vehicle is to hold, it
    stops at the waypoint.
    """
    frame = home_frame(mission)
    windows = _windows(mission, limits)
    half_window_s = 0.5 * sum(windows)
    legs = _legs(mission, frame, limits, half_window_s)
    takeoff_s = log_start_s + mission.takeoff.ground_s
    times, knots = [takeoff_s + half_window_s], [np.zeros(3)]
    for leg in legs:
        times.append(times[-1] + leg.duration_s)
        knots.append(leg.end)
    path = FilteredPath(np.array(times), np.array(knots), windows)
    touchdown_s = float(times[-1] + half_window_s)
    events = FlightEvents(
        log_start_s=log_start_s,
        armed_s=takeoff_s - ARMED_BEFORE_TAKEOFF_S,
        takeoff_s=takeoff_s,
        touchdown_s=touchdown_s,
        disarmed_s=touchdown_s + DISARMED_AFTER_TOUCHDOWN_S,
        end_s=touchdown_s + mission.landing.ground_s,
    )
    yaw = _yaw_path(math.radians(mission.home.heading_deg), times, [leg.yaw for leg in legs], limits)
    return FlightPlan(frame, path, yaw, events)


def leg_speed(direction: np.ndarray, horizontal_m_s: float, limits: Limits) -> float:
    """Speed along a leg (m/s) that keeps the wanted horizontal speed and the limits of climb and descent.

    Parameters
    ----------
    direction
        (3,) unit vector north, east, down.
    """
    horizontal, down = float(np.hypot(direction[0], direction[1])), float(direction[2])
    speeds = [limits.horizontal_speed_m_s]
    if horizontal > 1e-9:
        speeds.append(min(horizontal_m_s, limits.horizontal_speed_m_s) / horizontal)
    if down < -1e-9:
        speeds.append(limits.climb_speed_m_s / -down)
    elif down > 1e-9:
        speeds.append(limits.descent_speed_m_s / down)
    return min(speeds)


def _windows(mission: Mission, limits: Limits) -> tuple[float, float, float]:
    """Windows of the filter from the largest change of velocity that this mission can ask for."""
    fastest = max(waypoint.speed_m_s for waypoint in mission.waypoints)
    horizontal = min(max(fastest, mission.speed_m_s), limits.horizontal_speed_m_s)
    vertical = limits.climb_speed_m_s + limits.descent_speed_m_s
    return window_lengths(math.hypot(2.0 * horizontal, vertical), limits.acceleration_m_s2, limits.jerk_m_s3)


def _legs(mission: Mission, frame: TangentFrame, limits: Limits, half_window_s: float) -> list[_Leg]:
    climb = min(mission.takeoff.climb_speed_m_s, limits.climb_speed_m_s)
    top = np.array([0.0, 0.0, -mission.takeoff.altitude_m])
    # A rest after the climb and at every stop lets the filter settle, so that the vehicle really stands there.
    legs = [_Leg(top, mission.takeoff.altitude_m / climb, None), _Leg(top, half_window_s, None)]
    place = top
    for index, waypoint in enumerate(mission.waypoints):
        target = _place(waypoint, mission, frame)
        is_last = index + 1 == len(mission.waypoints)
        legs += _legs_to(place, target, waypoint, limits, half_window_s, stops=is_last or waypoint.hold_s > 0.0)
        place = legs[-1].end
    if mission.landing.mode == "return":
        above_home = np.array([0.0, 0.0, place[2]])
        if np.linalg.norm(above_home - place) > 1e-3:
            back = Waypoint(mission.home.lat, mission.home.lon, -place[2], mission.speed_m_s)
            legs += _legs_to(place, above_home, back, limits, half_window_s, stops=True)
        place = above_home
    return legs + _descent(place, min(mission.landing.descent_speed_m_s, limits.descent_speed_m_s), half_window_s)


def _place(waypoint: Waypoint, mission: Mission, frame: TangentFrame) -> np.ndarray:
    height = frame.height_m + waypoint.alt
    return frame.from_geodetic(math.radians(waypoint.lat), math.radians(waypoint.lon), height)


def _legs_to(
    start: np.ndarray, target: np.ndarray, waypoint: Waypoint, limits: Limits, half_window_s: float, *, stops: bool
) -> list[_Leg]:
    distance = float(np.linalg.norm(target - start))
    direction = (target - start) / max(distance, 1e-9)
    speed = leg_speed(direction, waypoint.speed_m_s, limits)
    yaw = _leg_yaw(direction, waypoint)
    legs = [_Leg(target, max(distance, 1e-3) / speed, yaw)]
    if stops:
        legs.append(_Leg(target, waypoint.hold_s + 2.0 * half_window_s, yaw))
    elif waypoint.turn == "fly_over":
        legs.append(_Leg(target + direction * speed * half_window_s, half_window_s, yaw))
    return legs


def _leg_yaw(direction: np.ndarray, waypoint: Waypoint) -> float | None:
    if waypoint.heading_deg is not None:
        return math.radians(waypoint.heading_deg)
    if math.hypot(direction[0], direction[1]) < 0.1:
        return None
    return math.atan2(direction[1], direction[0])


def _descent(place: np.ndarray, speed_m_s: float, half_window_s: float) -> list[_Leg]:
    ground, slow_from = np.array([place[0], place[1], 0.0]), np.array([place[0], place[1], -LANDING_SLOW_HEIGHT_M])
    slow = min(LANDING_SLOW_SPEED_M_S, speed_m_s)
    if -place[2] <= LANDING_SLOW_HEIGHT_M:
        return [_Leg(ground, -place[2] / slow, None)]
    fast_part = _Leg(slow_from, (-place[2] - LANDING_SLOW_HEIGHT_M) / speed_m_s, None)
    return [fast_part, _Leg(ground, LANDING_SLOW_HEIGHT_M / slow, None)]


def _yaw_path(initial: float, times: Sequence[float], targets: Sequence[float | None], limits: Limits) -> FilteredPath:
    """Turn to each leg's yaw the short way at the limited rate, beginning where the leg begins."""
    rate = math.radians(limits.yaw_rate_deg_s)
    yaw, free_from = initial, times[0]
    knot_times, knots = [times[0] - 1.0, times[0]], [initial, initial]
    for begin, target in zip(times, targets, strict=False):
        if target is None:
            continue
        turn = math.remainder(target - yaw, math.tau)
        if abs(turn) < 1e-6:
            continue
        begin = max(begin, free_from) + 1e-6
        yaw, free_from = yaw + turn, begin + abs(turn) / rate
        knot_times += [begin, free_from]
        knots += [yaw - turn, yaw]
    # The rate changes by twice its limit at most, and that over the first window.
    windows = (2.0 * limits.yaw_rate_deg_s / limits.yaw_acceleration_deg_s2, YAW_WINDOW_S, YAW_WINDOW_S)
    return FilteredPath(np.array(knot_times), np.array(knots)[:, None], windows)
