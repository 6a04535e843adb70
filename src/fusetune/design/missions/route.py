"""What a mission asks the vehicle to fly, leg by leg, in metres from home.

Everything that follows from a mission - its check, its duration, its map, the flight of the simulated vehicle, and the
question whether a flight flew it - starts from these legs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fusetune.design.missions.mission import Mission, Turn
from fusetune.px4.local_map import LocalMap

LegKind = Literal["takeoff", "travel", "return", "descent"]
Place = tuple[float, float, float]
"""North, east, down from home, m."""


@dataclass(frozen=True)
class RouteLeg:
    """A straight part of a mission.

    Attributes
    ----------
    kind : takeoff (the climb above home), travel (to a waypoint), return (to above home), descent (to the ground)
    start, end : north, east, down from home, m
    speed_m_s : along the horizontal; of a vertical leg along the vertical
    waypoint : index of the waypoint that a travel leg ends at
    turn : how the vehicle passes the end
    hold_s : how long it waits there
    heading_deg : where it looks on the way, from true north; None is along the course
    """

    kind: LegKind
    start: Place
    end: Place
    speed_m_s: float
    waypoint: int | None = None
    turn: Turn = "fly_by"
    hold_s: float = 0.0
    heading_deg: float | None = None

    @property
    def length_m(self) -> float:
        """From start to end."""
        return math.dist(self.start, self.end)


def route_of(mission: Mission) -> tuple[RouteLeg, ...]:
    """The legs of a mission, from the ground to the ground."""
    local = LocalMap(mission.home.lat, mission.home.lon)
    top: Place = (0.0, 0.0, -mission.takeoff.altitude_m)
    legs = [RouteLeg("takeoff", (0.0, 0.0, 0.0), top, mission.takeoff.climb_speed_m_s)]
    for index, waypoint in enumerate(mission.waypoints):
        end: Place = (*local.to_local(waypoint.lat, waypoint.lon), -waypoint.alt)
        legs.append(
            RouteLeg(
                "travel",
                legs[-1].end,
                end,
                waypoint.speed_m_s,
                waypoint=index,
                turn=waypoint.turn,
                hold_s=waypoint.hold_s,
                heading_deg=waypoint.heading_deg,
            )
        )
    if mission.landing.mode == "return":
        legs.append(RouteLeg("return", legs[-1].end, (0.0, 0.0, legs[-1].end[2]), mission.speed_m_s))
    north, east, _ = legs[-1].end
    legs.append(RouteLeg("descent", legs[-1].end, (north, east, 0.0), mission.landing.descent_speed_m_s))
    return tuple(legs)
