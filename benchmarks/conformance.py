"""Which waypoints a flight passed, and how far it was beside its legs, where both are known: docs/conformance.md.

python -m benchmarks.conformance [--flights N] [--receiver rtk|consumer|both]

Simulated flights of five shapes in gusts, two of them flown otherwise than they are asked about: of one a waypoint is
left out, of another two are swapped. Each waypoint must be decided right, and the cross-track error of each leg be that
of the vehicle's true path, which is computed here by other means from the simulator's ground truth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.design.missions.mission import Home, Landing, Mission, Takeoff, Turn, Waypoint
from fusetune.execute.vehicle import GnssError, Vehicle, load_vehicle
from fusetune.px4.local_map import LocalMap

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
VEHICLE = ROOT / "config" / "vehicles" / "quadrotor.yaml"
HOME = Home(47.397742, 8.545594, 488.0, 47.4, 20.0)
RECEIVERS = ("rtk", "consumer")


@dataclass(frozen=True)
class Corner:
    """A waypoint in metres north and east of home and above it."""

    north: float
    east: float
    up: float
    turn: Turn = "fly_by"
    hold_s: float = 0.0
    speed_m_s: float | None = None


def lanes() -> tuple[Corner, ...]:
    """Four survey lanes of 80 m, 20 m apart."""
    ends = ((10.0, 90.0), (90.0, 10.0))
    return tuple(Corner(north, 20.0 * lane, 20.0) for lane in range(4) for north in ends[lane % 2])


def box() -> tuple[Corner, ...]:
    """A square of 50 m, once cut and once crossed at its corners."""
    corners = ((50.0, 0.0), (50.0, 50.0), (0.0, 50.0), (0.0, 0.0))
    turns: tuple[Turn, ...] = ("fly_by", "fly_over")
    return tuple(Corner(north, east, 15.0, turn) for turn in turns for north, east in corners)


def figure_eight() -> tuple[Corner, ...]:
    """Two circles of 30 m in twelve chords each, flown in opposite senses through the same centre."""
    angles = np.arange(1, 13) * math.tau / 12
    radius = 30.0
    right = [(radius * math.sin(one), radius * (1.0 - math.cos(one))) for one in angles]
    left = [(radius * math.sin(one), -radius * (1.0 - math.cos(one))) for one in angles]
    return tuple(Corner(round(north, 6), round(east, 6), 18.0, speed_m_s=4.0) for north, east in (*right, *left))


def climb_steps() -> tuple[Corner, ...]:
    """Up a tower in steps of 8 m with a hold at each, aside, and down in steps of 12 m."""
    up = [Corner(20.0, 0.0, height, hold_s=4.0) for height in (10.0, 18.0, 26.0, 34.0)]
    down = [Corner(20.0, 25.0, height, hold_s=3.0) for height in (34.0, 22.0, 10.0)]
    return (*up, *down)


def runs() -> tuple[Corner, ...]:
    """To and fro along north and east, twice, the second time fast; stops at each end."""
    ends = ((60.0, 0.0), (0.0, 0.0), (0.0, 60.0), (0.0, 0.0))
    return tuple(
        Corner(north, east, 12.0, hold_s=2.0, speed_m_s=speed) for speed in (5.0, 10.0) for north, east in ends
    )


SHAPES = {"lanes": lanes, "box": box, "figure_eight": figure_eight, "climb_steps": climb_steps, "runs": runs}


def mission_of(name: str, corners: Sequence[Corner], speed_m_s: float = 6.0) -> Mission:
    """A mission around `HOME`, landing there."""
    local = LocalMap(HOME.lat, HOME.lon)
    waypoints = tuple(
        Waypoint(
            *local.to_global(one.north, one.east),
            one.up,
            speed_m_s if one.speed_m_s is None else one.speed_m_s,
            one.turn,
            one.hold_s,
        )
        for one in corners
    )
    return Mission(name, HOME, Takeoff(corners[0].up, 2.0), waypoints, Landing("return", 1.2), speed_m_s)


@dataclass(frozen=True)
class Flown:
    """A flight of the benchmark.

    Attributes
    ----------
    asked : the mission it is compared with
    order : waypoints of it, by index, in the order in which they were flown
    """

    name: str
    asked: Mission
    order: tuple[int, ...]
    seed: int

    @property
    def mission(self) -> Mission:
        """What was flown."""
        return replace(self.asked, waypoints=tuple(self.asked.waypoints[index] for index in self.order))

    @property
    def in_order(self) -> tuple[bool, ...]:
        """Of each waypoint of the mission whether it was passed in its turn; those swapped were not."""
        place = {index: number for number, index in enumerate(self.order)}
        return tuple(
            index in place
            and all((other < index) == (place[other] < place[index]) for other in self.order if other != index)
            for index in range(len(self.asked.waypoints))
        )


def flights(count: int = 20) -> Iterator[Flown]:
    """Each shape in turn; of the seventh flight a waypoint is left out, of the eleventh two are swapped."""
    for number in range(count):
        name = list(SHAPES)[number % len(SHAPES)]
        mission = mission_of(name, SHAPES[name]())
        order = list(range(len(mission.waypoints)))
        if number == 6:
            del order[2]
        if number == 10:
            order[3], order[4] = order[4], order[3]
        yield Flown(f"{number:02}_{name}", mission, tuple(order), 100 + number)


def vehicle_with(receiver: str) -> Vehicle:
    """The quadrotor in its gusts, with the receiver it has or one that takes corrections from a base station."""
    vehicle = load_vehicle(VEHICLE)
    if receiver == "consumer":
        return vehicle
    gnss = vehicle.gnss
    return replace(
        vehicle,
        gnss=replace(
            gnss,
            position=GnssError(0.01, 0.01, 60.0, 1.5),
            reported=replace(gnss.reported, eph_m=0.02, epv_m=0.03),
        ),
    )
