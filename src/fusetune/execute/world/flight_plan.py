"""The flight of a mission in time: the path that the vehicle means to fly, and the events of the flight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusetune.design.missions.filtered_path import FilteredPath
from fusetune.design.missions.flown_path import flown_path
from fusetune.design.missions.limits import Limits
from fusetune.design.missions.mission import Mission
from fusetune.design.missions.route import RouteLeg
from fusetune.execute.world.earth import TangentFrame

ARMED_BEFORE_TAKEOFF_S = 3.0
DISARMED_AFTER_TOUCHDOWN_S = 2.0


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


def home_frame(mission: Mission) -> TangentFrame:
    """Tangent frame at home."""
    home = mission.home
    return TangentFrame(math.radians(home.lat), math.radians(home.lon), home.alt + home.geoid_undulation_m)


def plan_flight(mission: Mission, limits: Limits, log_start_s: float = 2.0) -> FlightPlan:
    """Plan the flight of a mission within the limits of a vehicle: `flown_path`, on the ellipsoid."""
    frame = home_frame(mission)

    def place_of(leg: RouteLeg) -> np.ndarray:
        assert leg.waypoint is not None
        waypoint = mission.waypoints[leg.waypoint]
        height = frame.height_m + waypoint.alt
        return frame.from_geodetic(math.radians(waypoint.lat), math.radians(waypoint.lon), height)

    flown = flown_path(mission, limits, log_start_s + mission.takeoff.ground_s, place_of)
    events = FlightEvents(
        log_start_s=log_start_s,
        armed_s=flown.takeoff_s - ARMED_BEFORE_TAKEOFF_S,
        takeoff_s=flown.takeoff_s,
        touchdown_s=flown.touchdown_s,
        disarmed_s=flown.touchdown_s + DISARMED_AFTER_TOUCHDOWN_S,
        end_s=flown.touchdown_s + mission.landing.ground_s,
    )
    return FlightPlan(frame, flown.path, flown.yaw, events)
