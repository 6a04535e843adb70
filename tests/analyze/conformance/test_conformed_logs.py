"""What logs tell, file by file and in the terminal: flown, not flown, without a place, unreadable."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusetune.analyze.conformance import conformed_logs as logs
from fusetune.analyze.conformance.conformance import best_of, conformance
from fusetune.analyze.conformance.conformance_files import NO_PLACE, write_conformance
from fusetune.analyze.conformance.flown_track import flown_track
from fusetune.analyze.conformance.own_evidence import own_evidence
from fusetune.analyze.conformance.track_file import read_track, write_track
from fusetune.cli import main
from fusetune.cli.command import DONE, REFUSED
from fusetune.design.missions.mission import load_mission
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save.flight_folder import write_flight
from fusetune.storage.documents import read_document

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def survey(project_root: Path) -> Path:
    return project_root / "config/missions/survey.yaml"


def test_the_command_tells_each_log_and_no_log_stops_the_next(
    survey: Path, survey_flight: Flight, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logs, "smoothed_track", lambda observed, track: track)
    (tmp_path / "rubbish.ulg").write_bytes(b"no log")
    write_ulog(tmp_path / "survey.ulg", survey_flight)
    assert main(["conformance", str(survey), str(tmp_path / "survey.ulg")]) == DONE
    told = capsys.readouterr().out.splitlines()
    assert told[0].endswith("survey.ulg: by the vehicle's own estimate")
    assert told[1] == "  survey: flew: it passed all 6 waypoints in order"
    assert sum("waypoint" in line and ": passed after" in line for line in told) == 6
    assert any("    to waypoint 3: beside the leg " in line and "of 6.0 m/s" in line for line in told)
    assert main(["conformance", str(survey), str(tmp_path), "--json"]) == REFUSED
    found = json.loads(capsys.readouterr().out)
    assert [one["error"] is None for one in found] == [False, True]
    assert found[1]["flown"] == "survey"


def test_of_two_missions_the_one_that_explains_more_was_flown(project_root: Path, survey_flight: Flight) -> None:
    """The short survey has the same first waypoints, at other heights."""
    track = flown_track(survey_flight)
    assert track is not None
    missions = [load_mission(project_root / f"config/missions/{name}.yaml") for name in ("short_survey", "survey")]
    found = [conformance(survey_flight, track, one) for one in missions]
    best = best_of(found)
    assert best is not None
    assert best.mission.name == "survey"
    assert found[0].verdict == "not this mission"


def test_the_log_itself_says_where_the_vehicle_meant_to_go(survey: Path, survey_flight: Flight) -> None:
    mission = load_mission(survey)
    track = flown_track(survey_flight)
    assert track is not None
    assert own_evidence(survey_flight, track, mission).asked is None
    count = 3
    time = np.arange(1, count + 1, dtype=np.int64) * 20_000_000
    triplet = {
        "timestamp": time,
        "current.valid": np.ones(count, bool),
        "current.lat": np.array([one.lat for one in mission.waypoints[:count]]),
        "current.lon": np.array([one.lon for one in mission.waypoints[:count]]),
    }
    result = {"timestamp": time, "seq_reached": np.array([-1, 0, 2]), "finished": np.zeros(count, bool)}
    more = {("position_setpoint_triplet", 0): triplet, ("mission_result", 0): result}
    found = own_evidence(survey_flight.with_topics(survey_flight.topics | more), track, mission)
    assert found.asked == (0, 1, 2)
    assert (found.reached, found.is_finished) == (3, False)
    # the simulated vehicle is in mission mode from take-off until it lands
    assert found.mission_mode_share is not None
    assert found.mission_mode_share > 0.9


def test_a_flight_without_a_place_on_earth_has_manoeuvres_and_no_mission(
    survey: Path, survey_flight: Flight, tmp_path: Path
) -> None:
    topics = {key: table for key, table in survey_flight.topics.items() if key[0] != "vehicle_gps_position"}
    local = topics["vehicle_local_position", 0]
    topics["vehicle_local_position", 0] = local | {"xy_global": np.zeros(local["timestamp"].size, bool)}
    track = flown_track(survey_flight.with_topics(topics))
    assert track is not None
    assert not track.has_place
    folder = tmp_path / "indoors"
    folder.mkdir()
    write_flight(folder, replace(survey_flight, name="indoors", topics={}))
    write_track(tmp_path / "track.parquet", track)
    write_conformance(folder, tmp_path / "track.parquet", [survey], tmp_path / "conformance.json")
    found = read_document(tmp_path / "conformance.json")
    assert (found["flown"], found["missions"], found["why_not_compared"]) == (None, [], NO_PLACE)
    assert {"takeoff", "turn", "straight"} <= {one["kind"] for one in found["manoeuvres"]}


def test_the_track_is_read_as_it_was_written(survey_flight: Flight, tmp_path: Path) -> None:
    track = flown_track(survey_flight)
    assert track is not None
    write_track(tmp_path / "track.parquet", track)
    read = read_track(tmp_path / "track.parquet")
    assert read is not None
    assert (read.source, read.airborne, read.is_above_takeoff) == (track.source, track.airborne, True)
    assert np.array_equal(read.time, track.time)
    assert np.array_equal(read.lat, track.lat)
    assert np.abs(read.height - track.height).max() < 1e-5
    write_track(tmp_path / "none.parquet", None)
    assert read_track(tmp_path / "none.parquet") is None


def test_no_real_flight_flew_a_mission_of_ours(project_root: Path, shared_logs: Path) -> None:
    missions = [load_mission(file) for file in sorted((project_root / "config/missions").glob("*.yaml"))]
    names = ("SkyRats__log_10_2021-8-12-15-55-52", "JAParedes__TestFlight1", "erdemarslan380__sitl_windy")
    files = [file for name in names for file in shared_logs.rglob(f"{name}.ulg")]
    assert len(files) == len(names)
    for file in files:
        flight = read_ulog(file)
        track = flown_track(flight)
        assert track is not None
        for mission in missions:
            assert conformance(flight, track, mission).verdict == "not this mission"
