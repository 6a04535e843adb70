"""What is told of a saved flight before sets are compared: four documents, whatever the log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fusetune.analyze.diagnose_flight import diagnose_flight
from fusetune.analyze.flight_files import DIAGNOSED_FILES
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog
from fusetune.report.flight_page.effects_section import EFFECT_WORDS
from fusetune.save.log_folder import save_log
from fusetune.storage.documents import read_document


def told(log: Path, folder: Path) -> dict[str, dict[str, Any]]:
    save_log(log, folder / "save" / log.stem)
    diagnose_flight(folder / "save" / log.stem, folder / "analyze")
    return {file.partition(".")[0]: read_document(folder / "analyze" / file) for file in DIAGNOSED_FILES}


def test_a_healthy_flight_has_figures_effects_and_sensors_and_nothing_is_wrong(
    survey_flight: Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "survey.ulg"
    write_ulog(log, survey_flight)
    found = told(log, tmp_path)
    assert {document["flight"] for document in found.values()} == {"survey"}
    assert found["diagnosis"]["replayable"]
    assert not [one for one in found["diagnosis"]["diagnoses"] if one["severity"] != "note"]
    assert {row["id"] for row in found["health"]["rows"]} >= {"gnss_vel_horizontal.raised_share", "filter.faults"}
    assert not [row for row in found["health"]["rows"] if row["severity"] == "fail"]
    effects = {one["id"]: one for one in found["effects"]["effects"]}
    assert effects.keys() == EFFECT_WORDS.keys()
    # config/vehicles/quadrotor.yaml has the antenna 0.04 m behind and 0.09 m above the IMU
    true = {"EKF2_GPS_POS_X": -0.04, "EKF2_GPS_POS_Y": 0.0, "EKF2_GPS_POS_Z": -0.09}
    for one in effects["gnss_antenna"]["estimates"]:
        assert abs(one["value"] - true[one["name"]]) < 3.0 * one["standard_error"] < 0.2
    assert {"gyro", "accel", "mag", "baro"} <= found["sensor_noise"]["sensors"].keys()
    # of a long flight the replay is read from the disk: the files are the same, and nothing else is left there
    monkeypatch.setattr("fusetune.analyze.replaying.prepared_flight.MOST_IN_MEMORY", 0)
    diagnose_flight(tmp_path / "save" / "survey", tmp_path / "long")
    of_both = [{file.name: file.read_bytes() for file in (tmp_path / one).iterdir()} for one in ("analyze", "long")]
    assert of_both[0] == of_both[1]


@pytest.mark.parametrize("content", [b"", b"no log at all", b"ULog\x01\x12\x35\x01" + bytes(100)])
def test_of_a_log_that_cannot_be_read_nothing_is_told_and_nothing_fails(content: bytes, tmp_path: Path) -> None:
    log = tmp_path / "broken.ulg"
    log.write_bytes(content)
    found = told(log, tmp_path)
    assert not found["diagnosis"]["replayable"]
    assert not found["diagnosis"]["readable"]
    assert all(one["found"] and one["remedy"] for one in found["diagnosis"]["refused"])
    assert len(found["diagnosis"]["refused"]) == 1
    assert found["effects"]["effects"] == []
    assert found["sensor_noise"]["sensors"] == {}


def test_a_flight_that_cannot_be_replayed_is_told_of_as_far_as_it_goes(survey_flight: Flight, tmp_path: Path) -> None:
    """Without GNSS, magnetometer and barometer there is nothing to replay; the IMU still has figures."""
    log = tmp_path / "bare.ulg"
    topics = {key: table for key, table in survey_flight.topics.items() if key[0] in ("sensor_combined", "vehicle_imu")}
    write_ulog(log, survey_flight.with_topics(topics))
    found = told(log, tmp_path)
    assert not found["diagnosis"]["replayable"]
    assert found["health"]["rows"]
    assert "gyro" in found["sensor_noise"]["sensors"]
