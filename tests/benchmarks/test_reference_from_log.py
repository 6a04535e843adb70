"""A log in which an estimator wrote down what it computed becomes a reference of that flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.reference_from_log import main

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.trust.fidelity import compare_folders
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog
from fusetune.storage.documents import read_document


@pytest.fixture(scope="module")
def log(survey_flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The simulated flight, with what the estimator on board of it published at every update."""
    path = tmp_path_factory.mktemp("survey") / "survey.ulg"
    write_ulog(path, survey_flight)
    return path


def test_replay_agrees_with_what_the_estimator_on_board_wrote(log: Path, tmp_path: Path) -> None:
    """The vehicle's estimator is the one that replays, so nothing but the log's single precision may differ."""
    assert main([str(log), str(log), str(tmp_path / "reference"), "asflown"]) == 0
    reference = tmp_path / "reference/survey"
    assert replay_log(log, reference, tmp_path / "replays") == ["asflown"]
    (found,) = compare_folders(reference, tmp_path / "replays")
    assert {axis.source for axis in found.axes} == {"gnss_vel", "gnss_pos", "gnss_hgt", "baro_hgt", "mag"}
    assert found.missing == 0
    assert found.resets_equal
    assert found.flags_equal == 1.0
    assert max(axis.relative_rms for axis in found.axes) < 1e-6
    assert min(min(axis.fused_equal, axis.rejected_equal) for axis in found.axes) == 1.0
    assert found.velocity_rms < 1e-6
    summary = read_document(reference / "asflown.json")
    assert summary["overrides"] == {}
    assert sum(summary["resets"].values()) > 0


def test_set_is_told_from_what_was_flown(log: Path, survey_flight: Flight, tmp_path: Path) -> None:
    other = tmp_path / "survey_replayed.ulg"
    noise = 2.0 * survey_flight.parameters.initial.get("EKF2_GPS_V_NOISE", 0.3)
    initial = survey_flight.parameters.initial | {"EKF2_GPS_V_NOISE": noise}
    write_ulog(other, replace(survey_flight, parameters=replace(survey_flight.parameters, initial=initial)))
    main([str(log), str(other), str(tmp_path / "reference"), "noise"])
    overrides = read_document(tmp_path / "reference/survey/noise.json")["overrides"]
    assert overrides == {"EKF2_GPS_V_NOISE": pytest.approx(noise)}


def test_log_without_an_estimator_is_a_clear_error(
    golden_logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(golden_logs / "mc_drag.ulg")
    with pytest.raises(SystemExit, match="2"):
        main([log, log, str(tmp_path), "asflown"])
    assert "mc_drag" in (told := capsys.readouterr().err)
    assert "no innovations" in told
    assert "EKF2_LOG_VERBOSE" in told
