"""Missions of the study: a minute or so in the air, each with a motion of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.design.missions.mission import Home, Landing, Mission, Takeoff, Waypoint

LAT, LON, ALT = 47.397742, 8.545594, 488.0
METRES_PER_DEGREE = math.pi / 180.0 * 6_371_008.8
GROUND_S, GROUND_AFTER_S = 14.0, 4.0


@dataclass(frozen=True)
class Place:
    """A waypoint in metres from home: north, east, up; speed in m/s, heading in degrees (`None`: the course)."""

    north: float
    east: float
    up: float
    speed: float
    heading: float | None = None
    hold_s: float = 0.0


def _mission(name: str, heading_deg: float, climb_m: float, places: Sequence[Place]) -> Mission:
    return Mission(
        name=name,
        home=Home(LAT, LON, ALT, geoid_undulation_m=47.4, heading_deg=heading_deg),
        takeoff=Takeoff(climb_m, climb_speed_m_s=2.5, ground_s=GROUND_S),
        waypoints=tuple(_waypoint(one) for one in places),
        landing=Landing("land", descent_speed_m_s=1.5, ground_s=GROUND_AFTER_S),
        speed_m_s=5.0,
    )


def _waypoint(one: Place) -> Waypoint:
    lat = LAT + one.north / METRES_PER_DEGREE
    lon = LON + one.east / (METRES_PER_DEGREE * math.cos(math.radians(LAT)))
    return Waypoint(lat, lon, one.up, one.speed, hold_s=one.hold_s, heading_deg=one.heading)


def _turned(places: Sequence[Place], by_deg: float) -> list[Place]:
    """The same, turned about home."""
    cos, sin = math.cos(math.radians(by_deg)), math.sin(math.radians(by_deg))
    return [
        Place(
            cos * one.north - sin * one.east,
            sin * one.north + cos * one.east,
            one.up,
            one.speed,
            None if one.heading is None else (one.heading + by_deg + 180.0) % 360.0 - 180.0,
            one.hold_s,
        )
        for one in places
    ]


def hover(rng: np.random.Generator) -> list[Place]:
    """Stand in the air, and turn on the spot twice."""
    up = rng.uniform(5.0, 9.0)
    turns = rng.uniform(60.0, 170.0, 2)
    return [
        Place(0.6, 0.0, up, 1.0, 0.0, 12.0),
        Place(0.6, 0.6, up, 1.0, turns[0], 12.0),
        Place(0.0, 0.6, up, 1.0, turns[0] - turns[1], 10.0),
    ]


def survey(rng: np.random.Generator) -> list[Place]:
    """Lanes along the course, with corners."""
    up, speed, long, wide = rng.uniform(7.0, 10.0), rng.uniform(5.0, 8.0), rng.uniform(38.0, 50.0), 16.0
    return [
        Place(long, 0.0, up, speed),
        Place(long, wide, up + 1.0, speed),
        Place(0.0, wide, up, speed),
        Place(0.0, 2 * wide, up + 1.5, speed),
        Place(long, 2 * wide, up, speed),
        Place(long, 3 * wide, up, speed),
        Place(0.0, 3 * wide, up, speed),
        Place(0.0, 2 * wide, up, speed),
    ]


def stop_and_go(rng: np.random.Generator) -> list[Place]:
    """From rest to full speed and back along one line, nose one way, then across it, then nose half aside."""
    up, speed, far = rng.uniform(6.0, 9.0), rng.uniform(8.0, 10.0), rng.uniform(24.0, 30.0)
    nose = rng.choice([0.0, 90.0, 180.0])
    return [
        Place(far, 0.0, up, speed, nose, 0.1),
        Place(0.0, 0.0, up, speed, nose, 0.1),
        Place(0.0, far, up, speed, nose, 0.1),
        Place(0.0, 0.0, up, speed, nose, 0.1),
        Place(-far, 0.0, up, speed, 45.0, 0.1),
    ]


def sideways_box(rng: np.random.Generator) -> list[Place]:
    """A box flown with the nose held: forward, right, backward, left; nose a quarter aside, then aslant."""
    up, speed, side = rng.uniform(6.0, 9.0), rng.uniform(7.0, 9.0), rng.uniform(26.0, 32.0)
    corners = ((side, 0.0), (side, side), (0.0, side), (0.0, 0.0))
    first = [Place(north, east, up, speed, 0.0) for north, east in corners]
    return [
        *first,
        *(Place(north, east, up, speed, 90.0) for north, east in corners),
        *(Place(north, east, up, speed, -135.0) for north, east in corners[:2]),
    ]


def aggressive(rng: np.random.Generator) -> list[Place]:
    """A zigzag at speed with the nose swinging."""
    up, speed, wide = rng.uniform(8.0, 11.0), rng.uniform(9.0, 11.0), rng.uniform(22.0, 28.0)
    swing = rng.uniform(70.0, 130.0)
    return [
        Place(
            (step + 1) * 11.0 if step < 6 else (12 - step) * 11.0, wide * (step % 2), up, speed, swing * (step % 3 - 1)
        )
        for step in range(12)
    ]


def climbs(rng: np.random.Generator) -> list[Place]:
    """Up and down, and along."""
    low, high, speed = rng.uniform(4.0, 5.0), rng.uniform(11.0, 13.0), rng.uniform(5.0, 7.0)
    return [
        Place(12.0, 0.0, low, speed),
        Place(24.0, 10.0, high, speed),
        Place(40.0, 12.0, low, speed),
        Place(30.0, 30.0, high, speed),
        Place(8.0, 30.0, low, speed, 140.0),
        Place(4.0, 10.0, high, speed),
        Place(20.0, 4.0, low, speed),
        Place(30.0, -8.0, high, speed),
    ]


def drag_legs(rng: np.random.Generator) -> list[Place]:
    """The guide's flight for drag: from rest to full speed forward, backward, right and left, nose one way."""
    up, speed, far = rng.uniform(6.0, 8.0), rng.uniform(10.0, 12.0), rng.uniform(30.0, 36.0)
    ends = ((far, 0.0), (0.0, 0.0), (0.0, far), (0.0, 0.0), (-far, 0.0))
    return [Place(north, east, up, speed, 0.0, 0.1) for north, east in ends]


MOTIONS: dict[str, Callable[[np.random.Generator], list[Place]]] = {
    "hover": hover,
    "survey": survey,
    "stop_and_go": stop_and_go,
    "sideways_box": sideways_box,
    "aggressive": aggressive,
    "climbs": climbs,
}
RECIPES = {"drag_legs": drag_legs}
"""Flown where the guide asks for them."""
MOVING = tuple(name for name in MOTIONS if name != "hover")
FAST = ("stop_and_go", "sideways_box", "aggressive")
ALONG_THE_NOSE = ("hover", "survey", "climbs")
CLIMB_M = 6.0


def draw_mission(rng: np.random.Generator, names: Sequence[str]) -> Mission:
    """One of the named missions with sizes, speeds and course of its own."""
    name = str(rng.choice(list(names)))
    course = float(rng.uniform(-180.0, 180.0))
    return _mission(name, course, CLIMB_M, _turned((MOTIONS | RECIPES)[name](rng), course))
