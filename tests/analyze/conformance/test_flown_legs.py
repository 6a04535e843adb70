"""Distances from a leg by hand; corners by the formula; what a whole flight made of its legs."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.conformance import SHAPES, flights, flown_and_judged, mission_of
from tests.analyze.conformance.made_track import compared, planned_places

from fusetune.analyze.conformance.flown_legs import leg_figures
from fusetune.analyze.conformance.planned_passes import corner
from fusetune.analyze.conformance.settings import DEFAULTS
from fusetune.design.missions.route import RouteLeg

NO_BENDS = (0.0, 0.0)


def test_distances_from_a_level_leg_are_those_of_geometry() -> None:
    """North-east by 3 : 4, 100 m long, climbing by 10 m; 0.5 m to the right and 0.2 m too high on the second half."""
    leg = RouteLeg("travel", (0.0, 0.0, -20.0), (60.0, 80.0, -30.0), 5.0, waypoint=0)
    share = np.linspace(0.0, 1.0, 201)[:, None]
    on_it = np.array(leg.start) + share * np.subtract(leg.end, leg.start)
    right = np.array([-0.8, 0.6, 0.0])
    late = share > 0.5
    place = on_it + late * (0.5 * right + np.array([0.0, 0.0, -0.2]))
    velocity = np.tile([3.0, 4.0, -0.5], (201, 1))
    found = leg_figures(leg, place, velocity, NO_BENDS, DEFAULTS)
    assert found is not None
    assert (found.cross_track_mean, found.cross_track_bias) == pytest.approx((0.5 * 100 / 201,) * 2)
    assert (found.cross_track_95, found.cross_track_max) == pytest.approx((0.5, 0.5))
    assert found.height_error_mean == pytest.approx(0.2 * 100 / 201)
    assert found.height_error_max == pytest.approx(0.2)
    assert found.speed == pytest.approx(5.0)
    # without its second half nothing is beside it
    first = leg_figures(leg, place, velocity, (0.0, 60.0), DEFAULTS)
    assert first is not None
    assert first.cross_track_max == pytest.approx(0.5)
    assert first.cross_track_mean == pytest.approx(0.5 * 20 / 121)


def test_a_vertical_leg_has_distances_and_no_sides() -> None:
    leg = RouteLeg("travel", (5.0, 5.0, -10.0), (5.0, 5.0, -18.0), 2.0, waypoint=1)
    down = np.linspace(-10.0, -18.0, 81)
    place = np.column_stack([np.full(81, 5.3), np.full(81, 4.6), down])
    found = leg_figures(leg, place, np.tile([0.0, 0.0, -2.0], (81, 1)), NO_BENDS, DEFAULTS)
    assert found is not None
    assert (found.cross_track_mean, found.cross_track_bias) == pytest.approx((0.5, 0.5))
    assert found.speed == pytest.approx(2.0)


def test_a_corner_is_cut_by_the_parabola_of_its_acceleration() -> None:
    """90° at 6 m/s with 3 m/s² and jerk so high that it does not count: Δv = 8.49 m/s lasts 2.83 s, Δv T / 8 = 3 m."""
    north = RouteLeg("travel", (0.0, 0.0, -20.0), (50.0, 0.0, -20.0), 6.0)
    east = RouteLeg("travel", (50.0, 0.0, -20.0), (50.0, 50.0, -20.0), 6.0)
    cut, bend = corner(north, east, {"MPC_ACC_HOR": 3.0, "MPC_JERK_AUTO": 1e9})
    assert cut == pytest.approx(3.0)
    assert bend == pytest.approx(6.0 * 2.0**0.5)
    straight = RouteLeg("travel", (50.0, 0.0, -20.0), (90.0, 0.0, -20.0), 6.0)
    assert corner(north, straight, {"MPC_ACC_HOR": 3.0, "MPC_JERK_AUTO": 1e9}) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_what_is_flown_on_the_legs_is_beside_them_by_nothing_and_as_fast_as_planned() -> None:
    mission = mission_of("lanes", SHAPES["lanes"]())
    found = compared(planned_places(mission), mission)
    straight = [leg for leg in found.legs if leg.planned.kind == "travel" and leg.planned.length_m > 50.0]
    assert len(straight) == 4
    # at the end of the last one the vehicle stops
    for leg in straight[:-1]:
        assert leg.figures is not None
        # the simulator's map is that of the ellipsoid, PX4's a sphere: 0.3 % of 80 m
        assert leg.figures.cross_track_max < 0.3
        assert leg.figures.speed == pytest.approx(6.0, abs=0.05)


@pytest.mark.parametrize(("number", "verdict"), [(6, "flew in part"), (10, "flew otherwise")])
def test_a_simulated_flight_in_gusts_is_beside_its_legs_as_the_truth_says(number: int, verdict: str) -> None:
    """Of the benchmark's flights the two that are flown wrongly, with an RTK receiver."""
    flown = list(flights())[number]
    for found in flown_and_judged(flown, "rtk").values():
        assert found.wrong == ()
        assert found.verdict == verdict
        assert len(found.errors) > 3
        assert found.errors[:, 0].max() < 0.1
    assert found.errors.max() < 0.1
