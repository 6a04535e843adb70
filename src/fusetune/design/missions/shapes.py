"""Shapes that excite the filter, sized in metres about home: each becomes waypoints of a mission.

What each is for stands in docs/missions.md. Runs with a heading that stays are those that PX4's guides ask for to tune
multicopter drag (EKF2_BCOEF_X, EKF2_BCOEF_Y, EKF2_MCOEF) and static pressure (EKF2_PCOEF_*).
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, ClassVar, Literal

from fusetune.settings.checking import raise_problems, validate
from fusetune.settings.declaration import required, setting
from fusetune.settings.kinds import built_of_kind, schema_of_kinds

MOST_POINTS = 2000
"""Of all shapes of a mission; PX4 stores hardly more items."""
HARDEST_TURN_M_S2 = 3.0
"""MPC_ACC_HOR of PX4: a circle that asks for more is not flown as planned."""

_METRES: dict[str, Any] = {"unit": "m", "low": -20_000, "high": 20_000}


@dataclass(frozen=True)
class Point:
    """A place of a shape: metres north and east of home, height above it, and what the vehicle does there."""

    north_m: float
    east_m: float
    height_m: float
    speed_m_s: float
    turn: Literal["fly_by", "fly_over"] = "fly_by"
    hold_s: float = 0.0
    heading_deg: float | None = None


@dataclass(frozen=True, kw_only=True)
class Shape:
    """What all shapes have."""

    altitude_m: float = required("height above home", unit="m", low=1, high=500)
    north_m: float = setting(0.0, "centre, north of home", **_METRES)
    east_m: float = setting(0.0, "centre, east of home", **_METRES)
    speed_m_s: float | None = setting(
        None, "horizontal speed; without it that of the mission", unit="m/s", above=0, high=30
    )

    def points(self, speed_m_s: float) -> Iterator[Point]:
        """The places, in order.

        Parameters
        ----------
        speed_m_s : of the mission, where the shape has none of its own
        """
        raise NotImplementedError

    def problem(self, speed_m_s: float) -> str | None:
        """Why it cannot be flown with this speed, after the key at fault; None where it can."""
        return None


def _turned(bearing_deg: float, along: float, across: float) -> tuple[float, float]:
    """North and east of a place so far along a bearing and to the right of it."""
    cos, sin = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    return along * cos - across * sin, along * sin + across * cos


@dataclass(frozen=True, kw_only=True)
class Hover(Shape):
    """Hovers at a place: the noises of the sensors alone."""

    duration_s: float = required("how long", unit="s", above=0, high=600)
    heading_deg: float | None = setting(None, "heading; without it as it came", unit="degrees", low=-360, high=360)

    def points(self, speed_m_s: float) -> Iterator[Point]:
        yield Point(
            self.north_m, self.east_m, self.altitude_m, speed_m_s, hold_s=self.duration_s, heading_deg=self.heading_deg
        )


@dataclass(frozen=True, kw_only=True)
class YawTurns(Shape):
    """Turns about its own axis, all the way round one way and then the other: compass, and lever arms in the plane."""

    turns: int = setting(1, "full turns each way", low=1, high=20)
    step_deg: float = setting(
        120.0, "turn from one heading to the next; PX4 goes the short way", unit="degrees", low=10, high=150
    )
    hold_s: float = setting(0.5, "rest at each heading", unit="s", low=0, high=60)
    heading_deg: float = setting(0.0, "heading that it begins and ends with", unit="degrees", low=-360, high=360)

    def points(self, speed_m_s: float) -> Iterator[Point]:
        steps = math.ceil(360.0 * self.turns / self.step_deg)
        each = 360.0 * self.turns / steps
        for step in (*range(steps + 1), *range(steps - 1, -1, -1)):
            heading = math.remainder(self.heading_deg + each * step, 360.0)
            yield Point(self.north_m, self.east_m, self.altitude_m, speed_m_s, hold_s=self.hold_s, heading_deg=heading)


@dataclass(frozen=True, kw_only=True)
class ClimbSteps(Shape):
    """Climbs in steps and comes down in steps, standing on each: barometer, its delay, and height noises."""

    step_m: float = required("height of a step", unit="m", above=0.5, high=100)
    steps: int = required("number of steps", low=1, high=50)
    hold_s: float = setting(3.0, "rest on each", unit="s", low=0, high=600)
    down: bool = setting(True, "whether it comes down in steps as well")

    def points(self, speed_m_s: float) -> Iterator[Point]:
        for step in (*range(self.steps + 1), *(range(self.steps - 1, -1, -1) if self.down else ())):
            height = self.altitude_m + step * self.step_m
            yield Point(self.north_m, self.east_m, height, speed_m_s, hold_s=max(self.hold_s, 0.1))

    def problem(self, speed_m_s: float) -> str | None:
        top = self.altitude_m + self.steps * self.step_m
        return f"steps end {top:g} m above home; expected at most 500" if top > 500.0 else None


@dataclass(frozen=True, kw_only=True)
class SurveyLanes(Shape):
    """Flies parallel lanes to and fro, as over a field that is mapped."""

    length_m: float = required("length of a lane", unit="m", above=1, high=5000)
    spacing_m: float = required("from lane to lane", unit="m", above=0.5, high=1000)
    lanes: int = required("number of lanes", low=1, high=200)
    bearing_deg: float = setting(0.0, "direction of the first lane", unit="degrees", low=-360, high=360)
    turn: Literal["fly_by", "fly_over"] = setting("fly_by", "how the ends of the lanes are passed")

    def points(self, speed_m_s: float) -> Iterator[Point]:
        for lane in range(self.lanes):
            across = (lane - 0.5 * (self.lanes - 1)) * self.spacing_m
            ends = (-0.5, 0.5) if lane % 2 == 0 else (0.5, -0.5)
            for end in ends:
                north, east = _turned(self.bearing_deg, end * self.length_m, across)
                yield Point(self.north_m + north, self.east_m + east, self.altitude_m, speed_m_s, self.turn)


@dataclass(frozen=True, kw_only=True)
class BoxTurns(Shape):
    """Flies round a square one way and then the other: turns of a quarter both ways, accelerations along both axes."""

    side_m: float = required("side of the square", unit="m", above=1, high=5000)
    laps: int = setting(1, "rounds each way", low=1, high=50)
    both_ways: bool = setting(True, "whether it goes round the other way, too")
    hold_s: float = setting(0.0, "rest at each corner; without it corners are cut", unit="s", low=0, high=60)
    bearing_deg: float = setting(0.0, "direction of the first side", unit="degrees", low=-360, high=360)

    def points(self, speed_m_s: float) -> Iterator[Point]:
        half = 0.5 * self.side_m
        corners = ((-half, -half), (half, -half), (half, half), (-half, half))
        order = [*range(4)] * self.laps + [0]
        if self.both_ways:
            order += [3, 2, 1, 0] * self.laps
        for index in order:
            north, east = _turned(self.bearing_deg, *corners[index])
            yield Point(self.north_m + north, self.east_m + east, self.altitude_m, speed_m_s, hold_s=self.hold_s)


@dataclass(frozen=True, kw_only=True)
class FigureEight(Shape):
    """Flies two circles that touch, one to each side: turning and sideways acceleration without rest, both ways."""

    radius_m: float = required("radius of a circle", unit="m", above=1, high=1000)
    laps: int = setting(2, "how often", low=1, high=50)
    bearing_deg: float = setting(
        0.0, "direction from the centre of one circle to that of the other", unit="degrees", low=-360, high=360
    )
    deviation_m: float = setting(
        0.3, "how far the straight way between two points is from the circle at most", unit="m", low=0.01, high=10
    )

    def points(self, speed_m_s: float) -> Iterator[Point]:
        # a chord of n to the circle is off it by the sagitta r (1 − cos(π/n))
        share = max(1.0 - self.deviation_m / self.radius_m, -1.0)
        around = max(math.ceil(math.pi / math.acos(share)), 8)
        angles = [math.tau * step / around for step in range(around)]
        # from the touching point, with the same direction of flight into the second circle, turning the other way
        first = [(self.radius_m * (1.0 - math.cos(angle)), self.radius_m * math.sin(angle)) for angle in angles]
        second = [(-along, across) for along, across in first]
        for along, across in [*(first + second) * self.laps, (0.0, 0.0)]:
            north, east = _turned(self.bearing_deg, along, across)
            yield Point(self.north_m + north, self.east_m + east, self.altitude_m, speed_m_s)

    def problem(self, speed_m_s: float) -> str | None:
        asked = speed_m_s**2 / self.radius_m
        if asked <= HARDEST_TURN_M_S2:
            return None
        least = speed_m_s**2 / HARDEST_TURN_M_S2
        return (
            f"radius_m is {self.radius_m:g}, which asks for {asked:.1f} m/s² sideways at {speed_m_s:g} m/s; expected "
            f"at least {least:.0f} m, or a smaller speed_m_s"
        )


@dataclass(frozen=True, kw_only=True)
class Shuttle(Shape):
    """Flies to and fro along a line, turning back hard or resting at each end: the delay of GNSS."""

    length_m: float = required("length of the line", unit="m", above=2, high=2000)
    legs: int = setting(6, "how often along it", low=1, high=100)
    hold_s: float = setting(
        0.0, "rest at each end; without it the vehicle turns back at once", unit="s", low=0, high=60
    )
    bearing_deg: float = setting(0.0, "direction of the first leg", unit="degrees", low=-360, high=360)
    heading_deg: float | None = setting(
        None, "heading that stays; without it the course", unit="degrees", low=-360, high=360
    )

    def points(self, speed_m_s: float) -> Iterator[Point]:
        for leg in range(self.legs + 1):
            north, east = _turned(self.bearing_deg, (leg % 2 - 0.5) * self.length_m, 0.0)
            yield Point(
                self.north_m + north,
                self.east_m + east,
                self.altitude_m,
                speed_m_s,
                hold_s=self.hold_s,
                heading_deg=self.heading_deg,
            )


@dataclass(frozen=True, kw_only=True)
class Runs(Shape):
    """Flies forward and backward, left and right, up and down, with a heading that stays, resting between: drag,
    static pressure.
    """

    distance_m: float = required("length of a run in the plane", unit="m", above=2, high=2000)
    climb_m: float = setting(10.0, "height of a run up and down", unit="m", above=1, high=200)
    axes: tuple[str, ...] = setting(
        ("forward_backward", "left_right", "up_down"),
        "along which axes of the vehicle",
        choices=("forward_backward", "left_right", "up_down"),
        at_least=1,
    )
    repeats: int = setting(2, "how often each", low=1, high=50)
    heading_deg: float = setting(0.0, "heading that stays", unit="degrees", low=-360, high=360)
    hold_s: float = setting(2.0, "rest between the runs", unit="s", above=0, high=60)

    _BEARINGS: ClassVar[Mapping[str, float]] = {"forward_backward": 0.0, "left_right": 90.0}

    def points(self, speed_m_s: float) -> Iterator[Point]:
        for axis in self.axes:
            for share in (-0.5, *(0.5, -0.5) * self.repeats):
                if axis == "up_down":
                    yield self._point(0.0, 0.0, self.altitude_m + (share + 0.5) * self.climb_m, speed_m_s)
                else:
                    bearing = self.heading_deg + self._BEARINGS[axis]
                    north, east = _turned(bearing, share * self.distance_m, 0.0)
                    yield self._point(north, east, self.altitude_m, speed_m_s)

    def _point(self, north: float, east: float, height: float, speed_m_s: float) -> Point:
        return Point(
            self.north_m + north,
            self.east_m + east,
            height,
            speed_m_s,
            hold_s=self.hold_s,
            heading_deg=self.heading_deg,
        )


KINDS: dict[str, type[Shape]] = {
    "survey_lanes": SurveyLanes,
    "box_turns": BoxTurns,
    "figure_eight": FigureEight,
    "climb_steps": ClimbSteps,
    "hover": Hover,
    "yaw_turns": YawTurns,
    "shuttle": Shuttle,
    "runs": Runs,
}
"""Name in a file → shape."""


def shape_points(
    entries: Sequence[Mapping[str, Any]], speed_m_s: float, file: str | os.PathLike[str]
) -> list[tuple[str, Point]]:
    """Points of shapes, one shape after the other, each with its place in the file for messages.

    Parameters
    ----------
    entries : each with `kind`, a name of `KINDS`, and the settings of that class
    speed_m_s : of the mission
    file : named in messages

    Raises
    ------
    UserError
        An entry is broken or cannot be flown; the message names entry, key and what was expected.
    """
    validate({"shapes": list(entries)}, _SCHEMA, file)
    found: list[tuple[str, Point]] = []
    problems: list[str] = []
    for number, entry in enumerate(entries):
        shape = built_of_kind(KINDS, entry)
        speed = shape.speed_m_s or speed_m_s
        if problem := shape.problem(speed):
            problems.append(f"shapes[{number}].{problem}")
            continue
        place = f"shapes[{number}] ({entry['kind']}), point"
        room = MOST_POINTS - len(found)
        points = list(islice(shape.points(speed), room + 1))
        if len(points) > room:
            problems.append(f"shapes[{number}] ends beyond the {MOST_POINTS} points that a mission may have")
            break
        found += [(f"{place} {index}", point) for index, point in enumerate(points, 1)]
    raise_problems(file, problems, "Mend the named keys")
    return found


_SCHEMA = schema_of_kinds("shapes", KINDS, "list of shapes", "which shape")
