"""Every waypoint decided right: on planned paths, in whole, in part, in other orders, with loops and late logs."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.conformance import SHAPES, Corner, mission_of
from tests.analyze.conformance.made_track import compared, flown_in_order, planned_places

from fusetune.design.missions.mission import Mission

PASSED_ANYHOW = {("lanes", 0), ("box", 7), ("figure_eight", 11), ("figure_eight", 23), ("runs", 7)}
"""Waypoints that the way from the one before to the one after them, or home, leads through: none can tell."""
NOT_PASSED_OTHERWISE = {"lanes": {0, 6}, "box": {6}, "figure_eight": {10, 11, 22}, "climb_steps": set()}
"""Swapped with the next one, the flight passes as by the way what it should pass otherwise, or cuts the corner of a
waypoint to be crossed."""


def mission(name: str) -> Mission:
    return mission_of(name, SHAPES[name]())


def disturbed(place: np.ndarray) -> np.ndarray:
    """Beside its place by what a receiver is off, with gusts of a quarter of a metre."""
    step = np.arange(len(place))
    gusts = 0.25 * np.column_stack([np.sin(step / 17.0 + phase) for phase in range(3)])
    return place + np.array([0.3, -0.3, 0.3]) + gusts


@pytest.mark.parametrize("name", SHAPES)
def test_a_mission_flown_as_planned_has_all_waypoints_in_order_and_all_legs(name: str) -> None:
    found = compared(disturbed(planned_places(mission(name))), mission(name))
    assert (found.verdict, all(one.in_order for one in found.passes)) == ("flew", True)
    assert all(leg.is_flown for leg in found.legs if leg.planned.length_m > 1.0)
    times = [one.visit.time for one in found.passes if one.visit is not None]
    assert times == sorted(times)


@pytest.mark.parametrize("name", SHAPES)
def test_whichever_waypoint_is_left_out_it_alone_is_missed(name: str) -> None:
    asked = mission(name)
    for left_out in range(len(asked.waypoints)):
        if (name, left_out) in PASSED_ANYHOW:
            continue
        order = [index for index in range(len(asked.waypoints)) if index != left_out]
        found = compared(disturbed(flown_in_order(asked, order)), asked)
        assert [one.planned.waypoint for one in found.passes if not one.is_passed] == [left_out]
        assert [one.planned.waypoint for one in found.passes if not one.in_order] == [left_out]
        assert found.verdict == "flew in part"
        assert f"it missed waypoint {left_out + 1} of" in found.why


@pytest.mark.parametrize("name", NOT_PASSED_OTHERWISE)
def test_whichever_two_are_swapped_they_alone_are_passed_out_of_order(name: str) -> None:
    asked = mission(name)
    count = len(asked.waypoints)
    for first in sorted({*range(count - 1)} - NOT_PASSED_OTHERWISE[name]):
        order = [*range(first), first + 1, first, *range(first + 2, count)]
        found = compared(disturbed(flown_in_order(asked, order)), asked)
        assert [one.planned.waypoint for one in found.passes if not one.in_order] == [first, first + 1]
        assert all(one.is_passed for one in found.passes)
        assert found.verdict == "flew otherwise"


def test_loops_before_a_detour_and_a_hover_change_nothing() -> None:
    asked = mission("box")
    place = planned_places(asked)
    middle = len(place) // 2
    # once round the box by hand, a detour of 30 m and back with a hover there, between two waypoints
    loop = np.vstack([place[200:700], place[700:200:-1]])
    aside = place[middle] + np.linspace(0.0, 1.0, 200)[:, None] * np.array([15.0, 30.0, 0.0])
    detour = np.vstack([aside, np.repeat(aside[-1:], 400, axis=0), aside[::-1]])
    found = compared(np.vstack([place[:200], loop, place[200:middle], detour, place[middle:]]), asked)
    assert found.verdict == "flew"
    assert all(one.in_order for one in found.passes)
    assert found.on_route_share < 0.9


def test_of_a_log_that_begins_in_flight_the_start_is_missing() -> None:
    asked = mission("lanes")
    place = planned_places(asked)
    late = len(place) // 2
    found = compared(place[late:], asked)
    assert found.verdict == "flew in part"
    passed = [one.is_passed for one in found.passes]
    assert passed == sorted(passed)
    assert 0 < sum(passed) < len(passed)


def test_a_waypoint_to_hold_at_is_not_passed_by_flying_through() -> None:
    corners = [Corner(40.0, 0.0, 20.0), Corner(80.0, 0.0, 20.0, hold_s=6.0), Corner(120.0, 0.0, 20.0)]
    through = mission_of("through", [corners[0], Corner(80.0, 0.0, 20.0, "fly_over"), corners[2]])
    asked = mission_of("holds", corners)
    assert [one.is_passed for one in compared(planned_places(through), asked).passes] == [True, False, True]
    assert [one.is_passed for one in compared(planned_places(asked), asked).passes] == [True, True, True]


def test_the_same_way_at_another_height_is_not_this_mission() -> None:
    asked = mission("lanes")
    found = compared(planned_places(asked) + np.array([0.0, 0.0, -6.0]), asked)
    assert (found.verdict, found.why) == ("not this mission", "it passed 0 of its 8 waypoints")


def test_a_flight_elsewhere_says_how_far() -> None:
    asked = mission("lanes")
    found = compared(planned_places(asked) + np.array([5000.0, 0.0, 0.0]), asked)
    assert found.verdict == "not this mission"
    assert found.why == "it came no nearer to its home than 5.0 km"
