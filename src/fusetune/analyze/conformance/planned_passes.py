"""How near a flight has to come to each waypoint of a mission, by how it was asked to pass it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.design.missions.mission import NEAREST_WAYPOINTS_M
from fusetune.design.missions.route import RouteLeg

Array = npt.NDArray[np.float64]

MPC_ACC_HOR, MPC_JERK_AUTO = 3.0, 4.0
"""PX4's defaults, m/s² and m/s³, where a log does not hold these parameters."""


@dataclass(frozen=True)
class PlannedPass:
    """A waypoint as it is to be passed.

    Attributes
    ----------
    waypoint : its index in the mission
    leg : index of the leg of the route that ends there
    place : (3,) north, east, down of home, m
    hold_s : how long the vehicle is to wait there
    cut_m : by how much the corner is cut, at most
    reversal_cut_m : by how much one is cut that turns back, the sharpest that another order can ask for
    bends_m : how far before and after the waypoint the path is bent, or the vehicle comes and goes
    is_crossed : fly-over, or a stop
    is_stop : the vehicle holds there, or goes on straight down or to where it lands
    farthest_m : half-way to the waypoint before or after, whichever is nearer: beyond it would be that one's
    """

    waypoint: int
    leg: int
    place: Array
    hold_s: float
    cut_m: float
    reversal_cut_m: float
    bends_m: tuple[float, float]
    is_crossed: bool
    is_stop: bool
    farthest_m: float

    def radius_m(
        self, sigma_m: float, acceptance_m: float, settings: ConformanceSettings, *, any_corner: bool = False
    ) -> float:
        """Horizontal distance within which it is passed.

        Parameters
        ----------
        sigma_m : standard deviation of the vehicle's own place
        acceptance_m : its NAV_ACC_RAD, at which it turns to the next waypoint of those that it cuts
        any_corner : whatever the corner, as where the order is another
        """
        near = max(settings.crossing_m, settings.unknown_sigmas * sigma_m)
        if not self.is_crossed:
            near = max(near + (self.reversal_cut_m if any_corner else self.cut_m), acceptance_m)
        return min(near, self.farthest_m)

    def height_m(self, sigma_m: float, settings: ConformanceSettings) -> float:
        """Difference of height within which it is passed."""
        return min(max(settings.height_m, settings.unknown_sigmas * sigma_m), self.farthest_m)


def planned_passes(
    route: Sequence[RouteLeg], parameters: Mapping[str, float], settings: ConformanceSettings
) -> tuple[PlannedPass, ...]:
    """Of the legs of a mission, and of the parameters that the vehicle flew."""
    found = []
    for index, leg in enumerate(route):
        if leg.waypoint is None:
            continue
        after = route[index + 1]
        stops = leg.hold_s > 0.0 or after.kind in ("return", "descent")
        crossed = stops or leg.turn == "fly_over"
        cut, bend = corner(leg, after, parameters)
        # the turn at a fly-over waypoint begins there
        bends = (settings.crossing_m, settings.crossing_m) if stops else (0.0, 2.0 * bend) if crossed else (bend, bend)
        near = min((one.length_m for one in (leg, after) if one.length_m > NEAREST_WAYPOINTS_M), default=math.inf)
        found.append(
            PlannedPass(
                leg.waypoint,
                index,
                np.array(leg.end),
                leg.hold_s,
                0.0 if crossed else cut,
                0.0 if crossed else corner(leg, turned_back(leg), parameters)[0],
                bends,
                crossed,
                stops,
                0.5 * near,
            )
        )
    return tuple(found)


def sound_value(parameters: Mapping[str, float], name: str, default: float) -> float:
    """A parameter that is above 0; the default where a log lacks it, or holds what cannot be."""
    value = float(parameters.get(name, default))
    return value if math.isfinite(value) and value > 0.0 else default


def turned_back(leg: RouteLeg) -> RouteLeg:
    """The leg flown back."""
    return replace(leg, start=leg.end, end=leg.start)


def corner(leg: RouteLeg, after: RouteLeg, parameters: Mapping[str, float]) -> tuple[float, float]:
    """By how much a corner is cut (m), and from how far on (m).

    The velocity changes by Δv at the acceleration a, which itself comes and goes at the jerk j: within Δv/a + a/j. Over
    a corner that is passed so evenly the path leaves its waypoint by Δv T / 8 and the legs by v T / 2.
    """
    acceleration = sound_value(parameters, "MPC_ACC_HOR", MPC_ACC_HOR)
    jerk = sound_value(parameters, "MPC_JERK_AUTO", MPC_JERK_AUTO)
    before_m_s, after_m_s = _velocity(leg), _velocity(after)
    change = float(np.linalg.norm(after_m_s - before_m_s))
    lasts_s = change / acceleration + acceleration / jerk
    fastest = max(float(np.linalg.norm(one)) for one in (before_m_s, after_m_s))
    return change * lasts_s / 8.0, fastest * lasts_s / 2.0


def _velocity(leg: RouteLeg) -> Array:
    """(3,) m/s; `speed_m_s` is along the horizontal where there is one."""
    way = np.subtract(leg.end, leg.start)
    flat = float(np.hypot(way[0], way[1]))
    length = flat if flat > 0.0 else float(np.linalg.norm(way))
    return np.asarray(way / length * leg.speed_m_s if length > 0.0 else np.zeros(3))
