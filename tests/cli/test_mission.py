"""`fusetune mission`: what it prints, what it writes, and what it says of words that make no mission."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from fusetune.cli import main
from fusetune.design.missions.mission import load_mission
from fusetune.design.missions.route import route_of

Captured = pytest.CaptureFixture[str]
HOME = "47.4,8.5,400"


def told(arguments: list[str], capsys: Captured) -> list[str]:
    assert main(["mission", *arguments]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_mission_is_told_leg_by_leg_and_written_as_plan_and_map(
    project_root: Path, tmp_path: Path, capsys: Captured
) -> None:
    survey, vehicle = project_root / "config/missions/survey.yaml", project_root / "config/vehicles/quadrotor.yaml"
    out, picture = tmp_path / "survey.plan", tmp_path / "survey.png"
    lines = told([str(survey), "--vehicle", str(vehicle), "--out", str(out), "--map", str(picture)], capsys)
    # longest: 22 s up and down, 250 m at 6 m/s and less, six corners and rests
    assert lines[0].startswith("Mission survey: 1 min 22 s in the air, 246 m, up to 16 m high and 56 m away, 6.0 m/s")
    assert "9 % of the battery in still air (quadrotor)." in lines[0]
    legs = [line.split()[0:2] for line in lines[2:11]]
    assert [one[0] for one in legs] == ["take-off", *["waypoint"] * 6, "return", "landing"]
    assert lines[3].endswith("fly over")
    assert lines[8].endswith("hold 3 s")
    assert lines[-2:] == [f"Plan, for QGroundControl: {out}", f"Map: {picture}"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    # the plan is a mission in its turn; speeds of take-off and landing are no part of it
    assert route_of(load_mission(out))[1:-1] == route_of(load_mission(survey))[1:-1]
    assert told([str(out)], capsys)[0].startswith("Mission survey: 1 min 38 s in the air, 250 m")


def test_a_mission_of_shapes_and_one_for_a_purpose(tmp_path: Path, capsys: Captured) -> None:
    shape = "kind: hover, altitude_m: 12, duration_s: 20"
    lines = told(["--shape", shape, "--shape", "{kind: yaw_turns, altitude_m: 12}", "--home", HOME], capsys)
    assert sum(line.startswith(" waypoint") for line in lines) == 1 + 7
    out = tmp_path / "a.plan"
    lines = told(
        ["--for", "EKF2_GPS_DELAY,EKF2_ACC_NOISE", "--home", HOME, "--out", str(out), "--name", "both"], capsys
    )
    assert lines[0].startswith("Mission both: ")
    assert any(line.startswith("For EKF2_GPS_DELAY, EKF2_ACC_NOISE: shuttle; ") for line in lines)
    assert any(line.startswith("Moves: 1.") and "% of the time hovering." in line for line in lines)
    commands = [item["command"] for item in json.loads(out.read_text(encoding="utf-8"))["mission"]["items"]]
    assert (commands[0], commands[-1]) == (22, 20)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.yaml"], "missing.yaml: cannot be read"),
        (["missing.plan"], "missing.plan: cannot be read"),
        (["--for", "EKF2_GPS_DELAY"], "says no home"),
        (["--for", "EKF2_GPS_DELAI", "--home", HOME], "did you mean 'EKF2_GPS_DELAY'?"),
        (["--shape", "kind: [", "--home", HOME], "is no list of keys and values"),
        (["--shape", "hover", "--home", HOME], "the key 'kind' is missing"),
        (["--shape", "kind: hoover", "--home", HOME], "shapes[0].kind is 'hoover'"),
        (["--home", HOME], "nowhere to fly to"),
        (["--home", "97,8,0", "--shape", "kind: hover, altitude_m: 9, duration_s: 9"], "home.lat is 97.0"),
        (["--shape", "kind: hover, altitude_m: 9, duration_s: 9", "--home", HOME, "--out", "a.yaml"], "is no plan"),
        (["--shape", "kind: hover, altitude_m: 9, duration_s: 9", "--home", HOME, "--map", "a.pdf"], "is no picture"),
        (["--shape", "kind: hover, altitude_m: 9, duration_s: 9", "--home", HOME, "--name", "a b"], "name is 'a b'"),
    ],
)
def test_words_that_make_no_mission_end_in_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["mission", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.startswith("fusetune: ")
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_plan_stays_as_it_is_and_a_file_has_its_home(project_root: Path, tmp_path: Path, capsys: Captured) -> None:
    survey, shape = str(project_root / "config/missions/survey.yaml"), "kind: hover, altitude_m: 9, duration_s: 9"
    assert sum(line.startswith(" waypoint") for line in told([survey, "--shape", shape], capsys)) == 7
    assert main(["mission", survey, "--home", HOME, "--shape", shape]) == 2
    assert "home stands in the file already" in capsys.readouterr().err
    told([survey, "--out", str(tmp_path / "a.plan")], capsys)
    assert main(["mission", str(tmp_path / "a.plan"), "--shape", shape]) == 2
    assert "is a plan, which stays as it is" in capsys.readouterr().err


def test_a_path_that_leaves_the_fence_is_refused_and_nothing_written(
    project_root: Path, tmp_path: Path, capsys: Captured
) -> None:
    document = yaml.safe_load((project_root / "config/missions/survey.yaml").read_text(encoding="utf-8"))
    # the vehicle crosses waypoint 4 southwards and turns behind it, 4 m south of home
    corners = [[-1, -10], [-1, 60], [70, 60], [70, -10]]
    (tmp_path / "a.yaml").write_text(
        yaml.safe_dump(document | {"fence": {"polygons": [{"points_m": corners}]}}), encoding="utf-8"
    )
    assert main(["mission", str(tmp_path / "a.yaml"), "--out", str(tmp_path / "a.plan")]) == 2
    error = capsys.readouterr().err
    assert "the flown path leaves fence.polygons[0] (within it) by" in error
    assert "on the way to waypoint 5" in error
    assert not (tmp_path / "a.plan").exists()
