"""What a mission will be: its legs in time, how long and how far, what it takes of the battery, whether it keeps within
its fence.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.design.missions.endurance import GRAVITY_M_S2, NO_DRAG, Drag, Endurance
from fusetune.design.missions.fence import Fence, breaches
from fusetune.design.missions.flown_path import FlownPath, flown_path
from fusetune.design.missions.limits import PX4_LIMITS, Limits
from fusetune.design.missions.mission import Mission
from fusetune.design.missions.power_use import battery_share, power_over_hover
from fusetune.design.missions.route import RouteLeg, route_of
from fusetune.px4.local_map import LocalMap
from fusetune.quaternions import multiply
from fusetune.settings.checking import raise_problems

Array = npt.NDArray[np.float64]

STEP_S = 0.1
MEND = "Move waypoints, fly slower, or widen the fence"


@dataclass(frozen=True)
class PlannedVehicle:
    """The vehicle that a mission is planned for.

    Attributes
    ----------
    name : as its file has it
    limits : of its path
    endurance : None where its file does not say how long it flies
    """

    name: str = "PX4's defaults"
    limits: Limits = PX4_LIMITS
    endurance: Endurance | None = None
    drag: Drag = NO_DRAG


@dataclass(frozen=True)
class PlannedMotion:
    """The flown path, sampled.

    Attributes
    ----------
    time_s : (N,) from leaving the ground
    position, velocity, acceleration : (N, 3) north, east, down from home
    yaw : (N,) rad, continuous
    """

    time_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    yaw: Array


@dataclass(frozen=True)
class LegOutlook:
    """A leg of the route as it will be flown.

    Attributes
    ----------
    name : take-off, waypoint 1 …, return, landing
    start_s, end_s : from leaving the ground, rest at its end included
    length_m, height_m : of the straight leg, and of its end
    speed_m_s : highest along it
    """

    name: str
    start_s: float
    end_s: float
    length_m: float
    height_m: float
    speed_m_s: float
    turn: str
    hold_s: float
    heading_deg: float | None


@dataclass(frozen=True)
class Outlook:
    """What a mission will be.

    Attributes
    ----------
    mission, description, vehicle : names and words
    duration_s, distance_m : in the air, along the flown path
    highest_m, farthest_m : above and from home
    fastest_m_s : horizontally
    battery : share of a full battery; None where the vehicle's endurance is not known
    reserve : share that is to be left
    legs : in order
    notes : what a pilot should know besides
    """

    mission: str
    description: str
    vehicle: str
    duration_s: float
    distance_m: float
    highest_m: float
    farthest_m: float
    fastest_m_s: float
    battery: float | None
    reserve: float
    legs: tuple[LegOutlook, ...]
    notes: tuple[str, ...]

    @property
    def answer(self) -> str:
        """What a pilot asks first."""
        minutes, seconds = divmod(round(self.duration_s), 60)
        duration = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
        battery = "" if self.battery is None else f", {100.0 * self.battery:.0f} % of the battery in still air"
        return (
            f"Mission {self.mission}: {duration} in the air, {self.distance_m:.0f} m, up to {self.highest_m:.0f} m "
            f"high and {self.farthest_m:.0f} m away, {self.fastest_m_s:.1f} m/s{battery} ({self.vehicle})."
        )

    def document(self) -> dict[str, Any]:
        """As a result file holds it."""
        return {"answer": self.answer} | asdict(self)


def motion_of(flown: FlownPath, step_s: float = STEP_S) -> PlannedMotion:
    """Sample a flown path, from leaving the ground to being back on it."""
    time_s = np.append(np.arange(flown.takeoff_s, flown.touchdown_s, step_s), flown.touchdown_s)
    position, velocity, acceleration = (flown.path.evaluate(time_s, order) for order in range(3))
    return PlannedMotion(time_s - flown.takeoff_s, position, velocity, acceleration, flown.yaw.evaluate(time_s)[:, 0])


def outlook(
    mission: Mission, vehicle: PlannedVehicle | None = None, *, file: str | os.PathLike[str] = "mission"
) -> Outlook:
    """Plan the flight of a mission.

    Parameters
    ----------
    vehicle : that flies it; without it one of PX4's defaults
    file : named in messages

    Raises
    ------
    UserError
        The flown path leaves the fence.
    """
    vehicle = vehicle or PlannedVehicle()
    flown = flown_path(mission, vehicle.limits)
    motion, route = motion_of(flown), route_of(mission)
    raise_problems(file, _fence_problems(mission, flown, motion, route), MEND)
    battery = None
    if vehicle.endurance is not None:
        power = power_over_hover(motion.velocity, motion.acceleration, vehicle.endurance, vehicle.drag)
        battery = battery_share(motion.time_s, power, vehicle.endurance)
    reserve = vehicle.endurance.reserve if vehicle.endurance is not None else 0.0
    return Outlook(
        mission=mission.name,
        description=mission.description,
        vehicle=vehicle.name,
        duration_s=flown.duration_s,
        distance_m=float(np.linalg.norm(np.diff(motion.position, axis=0), axis=1).sum()),
        highest_m=float(-motion.position[:, 2].min()),
        farthest_m=float(np.hypot(*motion.position[:, :2].T).max()),
        fastest_m_s=float(np.hypot(*motion.velocity[:, :2].T).max()),
        battery=battery,
        reserve=reserve,
        legs=tuple(_legs(flown, motion, route)),
        notes=tuple(_notes(mission, battery, reserve)),
    )


def attitude_of(motion: PlannedMotion) -> Array:
    """(N, 4) quaternion body → NED: the rotors push along what the motion asks for, the nose along the yaw."""
    up = np.array([0.0, 0.0, GRAVITY_M_S2]) - motion.acceleration
    down = up / np.linalg.norm(up, axis=1, keepdims=True)
    # the shortest turn from the vertical to the body's axis, after the turn about the vertical
    tilt = np.column_stack([1.0 + down[:, 2], -down[:, 1], down[:, 0], np.zeros(len(down))])
    tilt /= np.linalg.norm(tilt, axis=1, keepdims=True)
    half, zero = 0.5 * motion.yaw, np.zeros(len(down))
    return multiply(tilt, np.column_stack([np.cos(half), zero, zero, np.sin(half)]))


def leg_names(route: Sequence[RouteLeg]) -> list[str]:
    """What a pilot calls the legs."""
    fixed = {"takeoff": "take-off", "return": "return", "descent": "landing"}
    return [fixed.get(leg.kind, f"waypoint {(leg.waypoint or 0) + 1}") for leg in route]


def _legs(flown: FlownPath, motion: PlannedMotion, route: Sequence[RouteLeg]) -> Iterator[LegOutlook]:
    begin = 0.0
    for name, leg, end_s in zip(leg_names(route), route, flown.leg_ends_s, strict=True):
        end = end_s - flown.takeoff_s
        during = (motion.time_s >= begin) & (motion.time_s <= end)
        speeds = np.linalg.norm(motion.velocity[during], axis=1)
        yield LegOutlook(
            name=name,
            start_s=begin,
            end_s=float(end),
            length_m=leg.length_m,
            height_m=0.0 - leg.end[2],
            speed_m_s=float(speeds.max(initial=0.0)),
            turn=leg.turn if leg.kind == "travel" and not leg.hold_s else "",
            hold_s=leg.hold_s,
            heading_deg=leg.heading_deg,
        )
        begin = end


def _fence_problems(
    mission: Mission, flown: FlownPath, motion: PlannedMotion, route: Sequence[RouteLeg]
) -> Iterator[str]:
    if mission.fence is None:
        return
    local = LocalMap(mission.home.lat, mission.home.lon)
    places = [(north, east, down) for north, east, down in motion.position.tolist()]
    names = leg_names(route)
    for breach in breaches(mission.fence, local, places):
        at_s = motion.time_s[breach.index] + flown.takeoff_s
        leg = min(int(np.searchsorted(flown.leg_ends_s, at_s)), len(names) - 1)
        yield (
            f"the flown path leaves {breach.limit} by {breach.by_m:.1f} m, {at_s - flown.takeoff_s:.0f} s after "
            f"take-off, on the way to {names[leg]}"
        )


def _notes(mission: Mission, battery: float | None, reserve: float) -> Iterator[str]:
    if battery is not None and battery > 1.0 - reserve:
        yield (
            f"takes {100.0 * battery:.0f} % of the battery, and {100.0 * reserve:.0f} % are to be left: split the "
            "mission or take a larger battery"
        )
    if mission.landing.mode == "return":
        yield (
            "a return climbs to RTL_RETURN_ALT first where that is higher (PX4's default 60 m): planned here at the "
            "height of the last waypoint"
        )
    if mission.fence is not None and mission.fence != Fence(
        circles=mission.fence.circles, polygons=mission.fence.polygons
    ):
        yield "largest distance and height are no part of a plan: set GF_MAX_HOR_DIST and GF_MAX_VER_DIST"
    yield from mission.notes
