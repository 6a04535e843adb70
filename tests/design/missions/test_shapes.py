"""Shapes: where they lead, by hand; and what cannot be flown."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusetune.design.missions.mission import Mission, load_mission
from fusetune.design.missions.route import RouteLeg, route_of
from fusetune.design.missions.shapes import KINDS, Point, shape_points
from fusetune.errors import UserError

DOCUMENT: dict[str, Any] = {
    "name": "shapes",
    "home": {"lat": 47.0, "lon": 8.0, "alt": 400},
    "speed_m_s": 4,
    "takeoff": {"altitude_m": 10},
    "landing": {"mode": "return"},
}


def points_of(speed_m_s: float = 4.0, **entry: Any) -> list[Point]:
    return [point for _, point in shape_points([{"altitude_m": 10, **entry}], speed_m_s, "a.yaml")]


def places(points: list[Point]) -> list[tuple[float, float, float]]:
    return [(round(one.north_m, 6), round(one.east_m, 6), one.height_m) for one in points]


def load(folder: Path, **changes: Any) -> Mission:
    path = folder / "mission.yaml"
    path.write_text(yaml.safe_dump({**DOCUMENT, **changes}), encoding="utf-8")
    return load_mission(path)


def test_survey_lanes_go_to_and_fro_about_their_centre() -> None:
    points = points_of(kind="survey_lanes", length_m=40, spacing_m=10, lanes=3, north_m=5, bearing_deg=90)
    # along the bearing east, to its right south
    assert places(points) == [
        (15.0, -20.0, 10), (15.0, 20.0, 10), (5.0, 20.0, 10), (5.0, -20.0, 10), (-5.0, -20.0, 10), (-5.0, 20.0, 10),
    ]  # fmt: skip


def test_a_box_is_flown_both_ways() -> None:
    corners = places(points_of(kind="box_turns", side_m=20))
    assert corners[:5] == [(-10, -10, 10), (10, -10, 10), (10, 10, 10), (-10, 10, 10), (-10, -10, 10)]
    assert corners[5:] == corners[3::-1]


def test_a_figure_eight_lies_on_its_circles_and_turns_both_ways() -> None:
    radius = 15.0
    points = points_of(kind="figure_eight", radius_m=radius, laps=1, bearing_deg=0, deviation_m=0.2)
    way = [(one.north_m, one.east_m) for one in points]
    assert way[0] == way[-1] == (0.0, 0.0)
    half = len(way) // 2
    for part, centre in ((way[: half + 1], (radius, 0.0)), (way[half:], (-radius, 0.0))):
        assert [math.dist(one, centre) for one in part] == pytest.approx([radius] * len(part))
        middles = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in pairwise(part)]
        assert all(radius - math.dist(one, centre) <= 0.2 + 1e-9 for one in middles)
    turns = [
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        for a, b, c in zip(way, way[1:], way[2:], strict=False)
    ]
    assert all(one < 0.0 for one in turns[: half - 1])
    assert all(one > 0.0 for one in turns[half:])


def test_climb_steps_go_up_and_down_over_one_place() -> None:
    points = points_of(kind="climb_steps", step_m=5, steps=2, hold_s=4)
    assert [one.height_m for one in points] == [10, 15, 20, 15, 10]
    assert {one.hold_s for one in points} == {4.0}


def test_yaw_turns_go_all_the_way_round_the_short_way_each_step() -> None:
    headings = [one.heading_deg for one in points_of(kind="yaw_turns", turns=2, step_deg=100, heading_deg=30)]
    steps = [math.remainder(b - a, 360.0) for a, b in pairwise(headings)]
    # 720 degrees in 8 steps of 90, and back
    assert steps == pytest.approx([90.0] * 8 + [-90.0] * 8)
    assert headings[0] == headings[-1] == 30.0


def test_runs_keep_their_heading_and_rest_between() -> None:
    points = points_of(kind="runs", distance_m=40, climb_m=8, heading_deg=90, repeats=1)
    assert {one.heading_deg for one in points} == {90.0}
    assert all(one.hold_s == 2.0 for one in points)
    # forward is east and right south
    assert places(points) == [
        (0, -20, 10), (0, 20, 10), (0, -20, 10), (20, 0, 10), (-20, 0, 10), (20, 0, 10), (0, 0, 10), (0, 0, 18),
        (0, 0, 10),
    ]  # fmt: skip


def test_a_shuttle_and_a_hover() -> None:
    assert places(points_of(kind="shuttle", length_m=30, legs=2)) == [(-15, 0, 10), (15, 0, 10), (-15, 0, 10)]
    (hover,) = points_of(kind="hover", duration_s=30, north_m=3, east_m=4, speed_m_s=2)
    assert (hover.north_m, hover.east_m, hover.hold_s, hover.speed_m_s) == (3.0, 4.0, 30.0, 2.0)


def test_waypoints_in_metres_and_shapes_one_after_the_other(tmp_path: Path) -> None:
    mission = load(
        tmp_path,
        waypoints=[{"north_m": 30, "east_m": -40, "alt": 12}],
        shapes=[
            {"kind": "hover", "altitude_m": 9, "duration_s": 20, "north_m": 7},
            {"kind": "yaw_turns", "altitude_m": 9, "north_m": 7},
            {"kind": "climb_steps", "altitude_m": 15, "step_m": 2, "steps": 1, "speed_m_s": 3},
        ],
    )
    legs = [leg for leg in route_of(mission) if leg.kind == "travel"]
    assert legs[0].end == pytest.approx((30.0, -40.0, -12.0), abs=1e-6)
    assert legs[1].end == pytest.approx((7.0, 0.0, -9.0), abs=1e-6)
    assert (legs[0].speed_m_s, legs[1].hold_s, legs[-1].speed_m_s) == (4.0, 20.0, 3.0)
    assert len(legs) == 1 + 1 + 7 + 3
    assert _stays(legs[2:9])


def _stays(legs: list[RouteLeg]) -> bool:
    return all(leg.length_m < 1e-6 for leg in legs) and len({leg.heading_deg for leg in legs}) == 3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"shapes": [{"kind": "circle", "altitude_m": 9}]}, ("shapes[0].kind is 'circle'", "'hover'")),
        ({"shapes": [{"kind": "hover", "altitude_m": 9}]}, ("shapes[0]", "'duration_s' is missing")),
        ({"shapes": [{"kind": "hover", "altitude_m": 9, "duration": 3}]}, ("unknown key 'duration'", "duration_s")),
        (
            {"shapes": [{"kind": "figure_eight", "altitude_m": 9, "radius_m": 2}]},
            ("shapes[0].radius_m is 2", "8.0 m/s² sideways at 4 m/s", "at least 5 m"),
        ),
        (
            {"shapes": [{"kind": "climb_steps", "altitude_m": 400, "step_m": 60, "steps": 3}]},
            ("shapes[0].steps end 580 m",),
        ),
        (
            {"shapes": [{"kind": "figure_eight", "altitude_m": 9, "radius_m": 900, "deviation_m": 0.01, "laps": 50}]},
            ("shapes[0] ends beyond the 2000 points",),
        ),
        ({}, ("nowhere to fly to", "Give waypoints, shapes or a purpose")),
        (
            {"waypoints": [{"north_m": 3, "alt": 9}]},
            ("waypoints[0] gives north_m", "lat and lon, or north_m and east_m"),
        ),
        ({"waypoints": [{"north_m": 3, "east_m": 3, "lat": 47.0, "alt": 9}]}, ("waypoints[0] gives lat and north_m",)),
        ({"waypoints": [{"alt": 9}]}, ("waypoints[0] gives no place",)),
        (
            {"shapes": [{"kind": "hover", "altitude_m": 9, "duration_s": 9, "north_m": 30}],
             "fence": {"max_distance_m": 20}},
            ("shapes[0] (hover), point 1 lies 10.0 m outside of 20 m from home",),
        ),
        ({"purpose": ["EKF2_GPS_DELAI"]}, ("no motion is known that tells 'EKF2_GPS_DELAI'", "'EKF2_GPS_DELAY'")),
    ],
)  # fmt: skip
def test_what_cannot_be_flown_is_told(tmp_path: Path, changes: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(UserError) as error:
        load(tmp_path, **changes)
    for one in words:
        assert one in str(error.value)


def test_every_kind_is_flown_somewhere_in_these_tests() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert [kind for kind in KINDS if f'kind="{kind}"' not in text] == []
