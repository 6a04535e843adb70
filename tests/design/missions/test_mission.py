"""Missions: what is read, and what is said about broken ones."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from fusetune.design.missions.mission import distance_m, load_mission
from fusetune.design.missions.outlook import outlook
from fusetune.design.missions.plan_writing import plan_items, write_mission_plan
from fusetune.errors import UserError

DOCUMENT = {
    "name": "small",
    "home": {"lat": 47.0, "lon": 8.0, "alt": 400},
    "speed_m_s": 4,
    "takeoff": {"altitude_m": 10},
    "waypoints": [
        {"lat": 47.0003, "lon": 8.0, "alt": 10, "turn": "fly_over"},
        {"lat": 47.0003, "lon": 8.0004, "alt": 12, "speed_m_s": 2, "hold_s": 3, "heading_deg": 90},
    ],
    "landing": {"mode": "land"},
}


def write(folder: Path, document: object) -> Path:
    path = folder / "mission.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return path


def changed(**changes: object) -> dict[str, object]:
    return {**DOCUMENT, **changes}


def test_defaults_are_filled_in(tmp_path: Path) -> None:
    mission = load_mission(write(tmp_path, DOCUMENT))
    assert mission.waypoints[0].speed_m_s == 4.0
    assert mission.waypoints[0].turn == "fly_over"
    assert mission.waypoints[1].turn == "fly_by"
    assert mission.waypoints[1].speed_m_s == 2.0
    assert mission.takeoff.ground_s == 15.0


def test_distance_of_one_minute_of_latitude_is_a_nautical_mile() -> None:
    # 2 π R / 360 / 60 with the mean radius of 6371.0088 km
    assert distance_m(10.0, 20.0, 10.0 + 1.0 / 60.0, 20.0) == pytest.approx(1853.25, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"home": {"lat": 97, "lon": 8, "alt": 1}}, ("home.lat", "97", "between -89.0 and 89.0")),
        ({"home": {"lat": "47°N", "lon": 8, "alt": 1}}, ("home.lat", "47°N", "a number")),
        ({"home": {"lat": 47, "lon": 8}}, ("home", "'alt' is missing", "sea level")),
        ({"waypoints": []}, ("waypoints", "at least")),
        ({"waypoints": [{"lat": 47, "lon": 8.0, "alt": 10, "turn": "cut"}]}, ("waypoints[0].turn", "'fly_by'")),
        ({"waypoints": [{"lat": 47, "lon": 8.0, "alt": 10, "sped": 1}]}, ("waypoints[0]", "'sped'", "speed_m_s")),
        ({"waypoints": [{"lat": 48, "lon": 8.0, "alt": 10}]}, ("waypoints[0]", "111.2 km from home")),
        ({"waypoints": [DOCUMENT["waypoints"][0]] * 2}, ("waypoints[1]", "0.00 m", "hold_s")),
        ({"landing": {"mode": "crash"}}, ("landing.mode", "'return'")),
        ({"takeoff": {"altitude_m": 1}}, ("takeoff.altitude_m", "between 2 and 500")),
        ({"hme": 1}, ("'hme'", "did you mean 'home'")),
    ],
)
def test_broken_mission_is_told_with_key_and_expectation(
    tmp_path: Path, changes: dict[str, object], expected: tuple[str, ...]
) -> None:
    path = write(tmp_path, changed(**changes))
    with pytest.raises(UserError) as error:
        load_mission(path)
    for words in (str(path), *expected):
        assert words in str(error.value)


def test_plan_has_the_items_that_qgroundcontrol_flies(tmp_path: Path) -> None:
    mission = load_mission(write(tmp_path, DOCUMENT))
    write_mission_plan(mission, tmp_path / "small.plan")
    items = json.loads((tmp_path / "small.plan").read_text())["mission"]["items"]
    # MAV_CMD: 22 take-off, 178 change speed, 16 waypoint, 21 land
    assert [item["command"] for item in items] == [22, 178, 16, 178, 16, 21]
    assert items[0]["params"][4:] == [47.0, 8.0, 10.0]
    assert items[2]["params"][1] == 0.5
    assert items[4]["params"] == [3.0, 0.0, 0.0, 90.0, 47.0003, 8.0004, 12.0]


def test_return_ends_the_plan_with_return_to_launch(tmp_path: Path) -> None:
    mission = load_mission(write(tmp_path, changed(landing={"mode": "return"})))
    assert int(plan_items(mission)[-1].command) == 20


def test_shipped_missions_are_flown_within_their_fences(project_root: Path) -> None:
    files = sorted((project_root / "config/missions").glob("*.yaml"))
    assert len(files) >= 3
    for file in files:
        assert outlook(load_mission(file), file=file).duration_s > 40.0


def test_shipped_mission_loads(project_root: Path) -> None:
    turns = [waypoint.turn for waypoint in load_mission(project_root / "config/missions/survey.yaml").waypoints]
    assert {"fly_by", "fly_over"} == set(turns)


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("name: survey", "name: CON", "'CON' is a device"),
        ("name: survey", 'name: "survey\\n"', "name is 'survey\\n'"),
        ("alt: 488.0", "alt: .nan", "home.alt is nan"),
        ("alt: 488.0", "alt: .inf", "home.alt is inf"),
        ("alt: 488.0", "alt: true", "home.alt is true"),
        ("alt: 488.0", "alt: 0477", "base 8"),
        ("alt: 488.0", "alt: 4:48", "base 60"),
    ],
)
def test_what_cannot_be_meant_is_told_with_its_place(
    tmp_path: Path, project_root: Path, old: str, new: str, part: str
) -> None:
    text = (project_root / "config/missions/survey.yaml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "mission.yaml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(UserError) as error:
        load_mission(path)
    assert str(path) in str(error.value)
    assert part in str(error.value)
    assert "\n" not in str(error.value)
