"""The path in time by which a vehicle flies a mission: corners cut, limits kept.

It is what the simulated vehicle means to fly, and what a mission is checked by: the corners that a fly-by cuts and the
way on behind a fly-over lie elsewhere than the straight legs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.design.missions.filtered_path import FilteredPath, window_lengths
from fusetune.design.missions.limits import Limits
from fusetune.design.missions.mission import NEAREST_WAYPOINTS_M, Mission
from fusetune.design.missions.route import RouteLeg, route_of

YAW_WINDOW_S = 0.3
LANDING_SLOW_HEIGHT_M = 4.0
"""Below this height the last part of the descent is flown at `LANDING_SLOW_SPEED_M_S`, as PX4 lands."""
LANDING_SLOW_SPEED_M_S = 0.5


@dataclass(frozen=True)
class FlownPath:
    """Where the vehicle means to be, and which way it means to point.

    Attributes
    ----------
    path : north, east, down from home, m
    yaw : continuous, rad
    takeoff_s, touchdown_s : when it leaves the ground and is back on it
    leg_ends_s : when the straight part of each leg of the route ends, rest at its end included
    """

    path: FilteredPath
    yaw: FilteredPath
    takeoff_s: float
    touchdown_s: float
    leg_ends_s: tuple[float, ...]

    @property
    def duration_s(self) -> float:
        """In the air."""
        return self.touchdown_s - self.takeoff_s


@dataclass
class _Part:
    """A straight part of the path, or a rest."""

    leg: int
    end: np.ndarray
    duration_s: float
    yaw: float | None


def flown_path(
    mission: Mission,
    limits: Limits,
    takeoff_s: float = 0.0,
    place_of: Callable[[RouteLeg], np.ndarray] | None = None,
) -> FlownPath:
    """Plan how a mission is flown within the limits of a vehicle.

    Fly-by waypoints are corners of the unfiltered path, which the filter cuts. A fly-over waypoint is crossed: its
    leg goes on straight for half the filter's window and the turn follows after it. Where the vehicle is to hold, it
    stops at the waypoint; where it is to look elsewhere without moving, it stays until it does.

    Parameters
    ----------
    takeoff_s : time at which the vehicle leaves the ground
    place_of : where the end of a leg to a waypoint lies, (3,) m; without it where `route_of` has it
    """
    windows = _windows(mission, limits)
    half_window_s = 0.5 * sum(windows)
    parts = _parts(mission, limits, half_window_s, place_of or (lambda leg: np.array(leg.end)))
    times, knots = [takeoff_s + half_window_s], [np.zeros(3)]
    ends = [times[0]] * len(route_of(mission))
    for part in parts:
        times.append(times[-1] + part.duration_s)
        knots.append(part.end)
        ends[part.leg :] = [times[-1]] * (len(ends) - part.leg)
    path = FilteredPath(np.array(times), np.array(knots), windows)
    yaw = _yaw_path(math.radians(mission.home.heading_deg), times, [part.yaw for part in parts], limits)
    return FlownPath(path, yaw, takeoff_s, float(times[-1] + half_window_s), tuple(ends))


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


def _parts(
    mission: Mission, limits: Limits, half_window_s: float, place_of: Callable[[RouteLeg], np.ndarray]
) -> list[_Part]:
    route = route_of(mission)
    place, looking = np.zeros(3), math.radians(mission.home.heading_deg)
    parts: list[_Part] = []
    for index, leg in enumerate(route):
        if leg.kind == "takeoff":
            climb = min(leg.speed_m_s, limits.climb_speed_m_s)
            top = np.array(leg.end)
            # A rest after the climb and at every stop lets the filter settle, so that the vehicle really stands there.
            parts += [_Part(index, top, leg.length_m / climb, None), _Part(index, top, half_window_s, None)]
        elif leg.kind == "descent":
            speed = min(leg.speed_m_s, limits.descent_speed_m_s)
            parts += _descent(index, place, speed, half_window_s)
        elif leg.kind == "return":
            above_home = np.array([0.0, 0.0, place[2]])
            if np.linalg.norm(above_home - place) > 1e-3:
                parts += _travel(index, place, above_home, leg, limits, half_window_s, looking, stops=True)
        else:
            follower = route[index + 1]
            stays = follower.kind == "travel" and follower.length_m < NEAREST_WAYPOINTS_M
            stops = leg.hold_s > 0.0 or follower.kind != "travel" or stays
            parts += _travel(
                index, place, place_of(leg), leg, limits, half_window_s, looking, stops=stops, leaves=not stays
            )
        place = parts[-1].end
        looking = parts[-1].yaw if parts[-1].yaw is not None else looking
    return parts


def _travel(
    index: int,
    start: np.ndarray,
    target: np.ndarray,
    leg: RouteLeg,
    limits: Limits,
    half_window_s: float,
    looking: float,
    *,
    stops: bool,
    leaves: bool = True,
) -> list[_Part]:
    distance = float(np.linalg.norm(target - start))
    direction = (target - start) / max(distance, 1e-9)
    yaw = _leg_yaw(direction, leg)
    if leg.kind == "travel" and distance < NEAREST_WAYPOINTS_M:
        turn_s = 0.0 if yaw is None else _turn_s(math.remainder(yaw - looking, math.tau), limits)
        # the filter sets out half its window before the next leg
        return [_Part(index, target, leg.hold_s + turn_s + (half_window_s if leaves else 1e-3), yaw)]
    speed = leg_speed(direction, leg.speed_m_s, limits)
    parts = [_Part(index, target, max(distance, 1e-3) / speed, yaw)]
    if stops:
        parts.append(_Part(index, target, leg.hold_s + 2.0 * half_window_s, yaw))
    elif leg.turn == "fly_over":
        parts.append(_Part(index, target + direction * speed * half_window_s, half_window_s, yaw))
    return parts


def _leg_yaw(direction: np.ndarray, leg: RouteLeg) -> float | None:
    if leg.heading_deg is not None:
        return math.radians(leg.heading_deg)
    if math.hypot(direction[0], direction[1]) < 0.1:
        return None
    return math.atan2(direction[1], direction[0])


def _descent(index: int, place: np.ndarray, speed_m_s: float, half_window_s: float) -> list[_Part]:
    ground, slow_from = np.array([place[0], place[1], 0.0]), np.array([place[0], place[1], -LANDING_SLOW_HEIGHT_M])
    slow = min(LANDING_SLOW_SPEED_M_S, speed_m_s)
    if -place[2] <= LANDING_SLOW_HEIGHT_M:
        return [_Part(index, ground, -place[2] / slow, None)]
    fast_part = _Part(index, slow_from, (-place[2] - LANDING_SLOW_HEIGHT_M) / speed_m_s, None)
    return [fast_part, _Part(index, ground, LANDING_SLOW_HEIGHT_M / slow, None)]


def _yaw_windows(limits: Limits) -> tuple[float, float, float]:
    # The rate changes by twice its limit at most, and that over the first window.
    return 2.0 * limits.yaw_rate_deg_s / limits.yaw_acceleration_deg_s2, YAW_WINDOW_S, YAW_WINDOW_S


def _turn_s(angle: float, limits: Limits) -> float:
    """How long the vehicle turns by an angle (rad), standing."""
    return abs(angle) / math.radians(limits.yaw_rate_deg_s) + 0.5 * sum(_yaw_windows(limits))


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
    return FilteredPath(np.array(knot_times), np.array(knots)[:, None], _yaw_windows(limits))
