"""Missions become plans that keep the rules, that others read, and that fly the same when they are read again."""

from __future__ import annotations

import math
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import mavutil, mavwp
from tests.design.missions.made_plans import SCHEMA

from fusetune.design.missions.fence import Fence, FenceCircle, FencePolygon
from fusetune.design.missions.mission import Home, Landing, Mission, Takeoff, Waypoint, load_mission, mission_of_plan
from fusetune.design.missions.plan_reading import followed_plan
from fusetune.design.missions.plan_writing import document_of, write_mission_plan
from fusetune.design.missions.route import route_of
from fusetune.px4.local_map import LocalMap
from fusetune.px4.plan_rules import plan_problems

VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Missions anywhere on earth: places within 300 m of home, apart from each other, or turns at one place."""
    home = Home(draw(st.floats(-80.0, 80.0)), draw(st.floats(-179.9, 179.9)), draw(st.floats(-100.0, 3000.0)))
    local = LocalMap(home.lat, home.lon)
    number = st.floats(-300.0, 300.0)
    points: list[Waypoint] = []
    for index in range(draw(st.integers(1, 6))):
        stays = bool(points) and draw(st.booleans())
        lat, lon = (
            (points[-1].lat, points[-1].lon) if stays else local.to_global(draw(number), 700.0 * index + draw(number))
        )
        points.append(
            Waypoint(
                lat,
                lon,
                points[-1].alt if stays else draw(st.floats(1.0, 400.0)),
                draw(st.floats(0.5, 25.0)),
                draw(st.sampled_from(("fly_by", "fly_over"))),
                draw(st.floats(0.5, 60.0)) if stays else draw(st.sampled_from((0.0, 3.5))),
                draw(st.none() | st.floats(-360.0, 360.0)),
            )
        )
    corners = tuple(local.to_global(north, east) for north, east in ((-900, -900), (900, -900), (0, 9000)))
    fence = Fence(
        circles=(FenceCircle(home.lat, home.lon, draw(st.floats(5000.0, 9000.0))),) * draw(st.integers(0, 2)),
        polygons=(FencePolygon(corners, False),) * draw(st.integers(0, 1)) if draw(st.booleans()) else (),
    )
    return Mission(
        "m",
        home,
        Takeoff(draw(st.floats(2.0, 100.0))),
        tuple(points),
        Landing(draw(st.sampled_from(("land", "return", "pilot")))),
        draw(st.floats(0.5, 20.0)),
        fence=fence if fence != Fence() else None,
    )


@settings(max_examples=500, deadline=None)
@given(missions())
def test_500_missions_become_plans_by_the_rules_and_fly_the_same_when_read_again(mission: Mission) -> None:
    document = document_of(mission)
    assert list(plan_problems(document)) == []
    VALIDATOR.validate(document)
    # an exclusion about home would refuse the mission itself; only what is flown is compared
    document["geoFence"]["polygons"] = []
    again = mission_of_plan(followed_plan(document, "m.plan"), "m.plan")
    assert route_of(again) == route_of(mission)
    if mission.fence is not None:
        kept = again.fence.circles if again.fence is not None else ()
        assert kept == mission.fence.circles


def test_pymavlink_reads_the_items_and_the_waypoint_file_that_it_writes_of_them(
    project_root: Path, tmp_path: Path
) -> None:
    mission = load_mission(project_root / "config/missions/survey.yaml")
    mavlink = mavutil.mavlink
    loader = mavwp.MAVWPLoader()
    for number, item in enumerate(document_of(mission)["mission"]["items"]):
        assert item["command"] in mavlink.enums["MAV_CMD"]
        assert item["frame"] in mavlink.enums["MAV_FRAME"]
        p1, p2, p3, p4, x, y, z = (math.nan if one is None else float(one) for one in item["params"])
        loader.add(
            mavlink.MAVLink_mission_item_message(
                1, 1, number, item["frame"], item["command"], 0, int(item["autoContinue"]), p1, p2, p3, p4, x, y, z
            )
        )
    loader.save(str(tmp_path / "survey.txt"))
    again = mavwp.MAVWPLoader()
    assert again.load(str(tmp_path / "survey.txt")) == loader.count() == 11
    places = [(again.wp(i).x, again.wp(i).y, again.wp(i).z) for i in range(11) if again.wp(i).command == 16]
    # the file has 7 decimals, 1 cm
    for place, waypoint in zip(places, mission.waypoints, strict=True):
        assert place == pytest.approx((waypoint.lat, waypoint.lon, waypoint.alt), abs=1e-6)
    assert [again.wp(i).param2 for i in range(11) if again.wp(i).command == 178] == [6.0, 4.0, 6.0]


def test_a_mission_that_flies_otherwise_than_its_plan_is_not_written_as_that_plan(
    project_root: Path, tmp_path: Path
) -> None:
    from dataclasses import replace

    write_mission_plan(load_mission(project_root / "config/missions/survey.yaml"), tmp_path / "a.plan")
    read = load_mission(tmp_path / "a.plan")
    with pytest.raises(ValueError, match="waypoints"):
        write_mission_plan(replace(read, waypoints=read.waypoints[:-1]), tmp_path / "b.plan")
    assert not (tmp_path / "b.plan").exists()
