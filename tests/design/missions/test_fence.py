"""Fences: inside and outside by hand, and of the path that is flown."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.design.missions.fence import Fence, FenceCircle, FencePolygon, breaches, is_within, polygon_distance_m
from fusetune.design.missions.mission import mission_of
from fusetune.design.missions.outlook import outlook
from fusetune.errors import UserError
from fusetune.px4.local_map import LocalMap

HOME = LocalMap(47.0, 8.0)
# an arrow head that points north, notched from below
ARROW = ((0.0, -10.0), (20.0, 0.0), (0.0, 10.0), (8.0, 0.0))


@pytest.mark.parametrize(
    ("place", "inside", "from_edge"),
    [
        ((14.0, 0.0), True, 6.0 / math.sqrt(5.0)),  # between tip and notch: nearer to the long edges, slope 2 to 1
        ((4.0, 0.0), False, 4.0 * 10.0 / math.hypot(8.0, 10.0)),  # within the notch
        ((25.0, 0.0), False, 5.0),
    ],
)
def test_a_notched_polygon(place: tuple[float, float], inside: bool, from_edge: float) -> None:
    assert is_within(ARROW, place) is inside
    assert polygon_distance_m(ARROW, place) == pytest.approx(from_edge)


@given(st.integers(3, 12), st.floats(1.0, 500.0), st.floats(0.0, 1.5), st.floats(0.0, math.tau))
def test_a_regular_polygon_holds_its_inner_circle_and_nothing_beyond_the_outer(
    corners: int, radius: float, share: float, bearing: float
) -> None:
    polygon = [
        (radius * math.cos(math.tau * k / corners), radius * math.sin(math.tau * k / corners)) for k in range(corners)
    ]
    inner = math.cos(math.pi / corners)
    place = (share * radius * math.cos(bearing), share * radius * math.sin(bearing))
    if share < inner - 1e-9:
        assert is_within(polygon, place)
        assert polygon_distance_m(polygon, place) >= (inner - share) * radius - 1e-6
    elif share > 1.0 + 1e-9:
        assert not is_within(polygon, place)
        assert polygon_distance_m(polygon, place) >= (share - 1.0) * inner * radius - 1e-6


def test_each_limit_that_is_broken_is_told_with_its_worst_place() -> None:
    lat, lon = HOME.to_global(0.0, 50.0)
    corners = tuple(HOME.to_global(north, east) for north, east in ((-5, 20), (5, 20), (5, 30), (-5, 30)))
    fence = Fence(45.0, 15.0, (FenceCircle(lat, lon, 10.0, inside=False),), (FencePolygon(corners, inside=False),))
    way = [(0.0, float(east), -10.0 - 0.1 * east) for east in range(0, 61, 5)]
    told = {one.limit: (one.index, pytest.approx(one.by_m, abs=1e-3)) for one in breaches(fence, HOME, way)}
    assert told == {
        "45 m from home": (12, 15.0),
        "15 m above home": (12, 1.0),
        "fence.circles[0] (out of 10 m)": (10, 10.0),
        "fence.polygons[0] (out of it)": (5, 5.0),
    }
    assert breaches(fence, HOME, way[:4]) == ()


def mission_with(fence: dict[str, Any], turn: str) -> dict[str, Any]:
    return {
        "name": "corner",
        "home": {"lat": 47.0, "lon": 8.0, "alt": 400},
        "takeoff": {"altitude_m": 10},
        "landing": {"mode": "return"},
        "speed_m_s": 8,
        "waypoints": [
            {"north_m": 60, "east_m": 0, "alt": 10, "turn": turn},
            {"north_m": 0, "east_m": 40, "alt": 10},
        ],
        "fence": fence,
    }


def test_the_flown_path_is_what_counts_not_the_straight_legs() -> None:
    # crossing the first waypoint at 8 m/s the vehicle cannot turn on the spot; cutting the corner it stays within
    outlook(mission_of(mission_with({"max_distance_m": 63}, "fly_by"), "a.yaml"))
    with pytest.raises(UserError) as error:
        outlook(mission_of(mission_with({"max_distance_m": 63}, "fly_over"), "a.yaml"), file="a.yaml")
    assert "a.yaml: the flown path leaves 63 m from home by" in str(error.value)
    assert "on the way to waypoint" in str(error.value)
    # and cutting it, it enters what lies within the corner
    inner = {"circles": [{"north_m": 49, "east_m": 4.5, "radius_m": 2, "inside": False}]}
    outlook(mission_of(mission_with(inner, "fly_over"), "a.yaml"))
    with pytest.raises(UserError, match=r"out of 2 m"):
        outlook(mission_of(mission_with(inner, "fly_by"), "a.yaml"))


@pytest.mark.parametrize(
    ("fence", "words"),
    [
        ({"circles": [{"north_m": 0, "radius_m": 5}]}, "fence.circles[0] gives north_m"),
        ({"polygons": [{"points_m": [[0, 0], [9, 0]]}]}, "fence.polygons[0].points_m has 2 corners"),
        ({"polygons": [{"inside": True}]}, "expected either points or points_m"),
        ({"circles": [{"radius_m": 50}]}, "waypoints[0] lies 10.0 m outside of fence.circles[0] (within 50 m)"),
    ],
)
def test_fences_that_cannot_be_meant_or_leave_waypoints_out(fence: dict[str, Any], words: str) -> None:
    with pytest.raises(UserError) as error:
        mission_of(mission_with(fence, "fly_by"), "a.yaml")
    assert words in str(error.value)
