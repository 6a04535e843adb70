"""`fusetune diagnose`: what it prints, how it ends, and that no log stops the next."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from fusetune.analyze.diagnosis import diagnosed_logs as logs
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign, how_sure
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.cli import main
from fusetune.cli.command import DONE, FOUND_FAILURE, USER_ERROR
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save.verdict import Verdict

Captured = pytest.CaptureFixture[str]
WARNS = 1
BY_NAME = {"sound": None, "noted": "note", "shaken": "warning", "broken": "fail"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Logs of which each is diagnosed by its name, one in a folder below, and one that is no log."""
    below = tmp_path / "logs" / "day"
    below.mkdir(parents=True)
    for name in BY_NAME:
        time = np.arange(0, 2_000_000, 10_000, dtype=np.int64) + 1_000_000
        topics = {("vehicle_land_detected", 0): {"timestamp": time, "landed": np.zeros(time.size, np.bool_)}}
        flight = Flight(name, topics, start_timestamp=1_000_000, last_timestamp=int(time[-1]))
        write_ulog((below if name == "broken" else below.parent) / f"{name}.ulg", flight)
    (below / "rubbish.ulg").write_bytes(b"no log")

    def found(observed: object, experiments: int) -> tuple[Diagnosis, ...]:
        # the reader names a flight by its file
        severity = BY_NAME[observed.logged.name]  # type: ignore[attr-defined]
        signs = (Sign("it was seen", 2.0, 1.0, "m"), Sign("and again", float("nan"), 1.0))
        one = Diagnosis(
            "vibration",
            "It shakes",
            severity or "note",
            0.93,
            1.0,
            1_500_000,
            2_500_000,
            signs,
            "Mend it",
            "made",
            {"imu_shaking_m_s2": 12.0},
        )
        return (one,) if severity else ()

    monkeypatch.setattr(logs, "diagnose", found)
    return tmp_path / "logs"


@pytest.mark.parametrize(
    ("name", "status", "refused"),
    [
        ("sound", DONE, USER_ERROR),
        ("noted", DONE, USER_ERROR),
        ("shaken", WARNS, WARNS),
        ("day/broken", FOUND_FAILURE, FOUND_FAILURE),
    ],
)
def test_the_status_is_that_of_the_worst_finding_and_a_log_without_replay_is_not_said_to_be_sound(
    folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, status: int, refused: int
) -> None:
    log = folder / f"{name}.ulg"
    assert main(["diagnose", str(log)]) == refused
    monkeypatch.setattr(ObservedFlight, "verdict", Verdict("as if whole", ()))
    assert main(["diagnose", str(log)]) == status


def test_a_log_that_cannot_be_read_ends_with_2_unless_there_is_a_failure(folder: Path, capsys: Captured) -> None:
    rubbish, shaken = folder / "day" / "rubbish.ulg", folder / "shaken.ulg"
    assert main(["diagnose", str(rubbish), str(shaken)]) == USER_ERROR
    told = capsys.readouterr().out
    assert "rubbish.ulg: " in told
    assert "It shakes" in told
    assert main(["diagnose", str(rubbish), str(folder / "day" / "broken.ulg")]) == FOUND_FAILURE


def test_the_same_percentage_has_the_same_word() -> None:
    """Both are printed as 90 %."""
    assert how_sure(0.896) == how_sure(0.904) == "sure"
    assert how_sure(0.894) == "likely"


def test_where_nothing_is_found_on_a_log_without_replay_it_is_not_said_to_be_sound(
    folder: Path, capsys: Captured
) -> None:
    main(["diagnose", str(folder / "sound.ulg")])
    told = capsys.readouterr().out
    assert "nothing found, and too little known to say that nothing is wrong" in told
    assert "not replayed, so less can be told" in told


def test_a_log_that_breaks_the_rules_is_refused_for_the_reason_of_its_verdict(
    folder: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ValueError("negative elements")

    monkeypatch.setattr(logs, "diagnose", broken)
    assert main(["diagnose", str(folder / "sound.ulg")]) == USER_ERROR
    told = capsys.readouterr().out
    assert "tells nothing of what is wrong: " in told
    assert "sensor_combined" in told
    assert "negative" not in told


def test_folders_are_searched_and_every_log_is_told_of(folder: Path, capsys: Captured) -> None:
    assert main(["diagnose", str(folder)]) == FOUND_FAILURE
    told = capsys.readouterr().out
    for name in (*BY_NAME, "rubbish"):
        assert f"{name}.ulg" in told
    assert main(["diagnose", str(folder / "day" / "nothing")]) == USER_ERROR
    shutil.rmtree(folder / "day")
    for name in ("sound", "noted", "shaken"):
        (folder / f"{name}.ulg").unlink()
    capsys.readouterr()
    assert main(["diagnose", str(folder)]) == USER_ERROR
    assert "holds no log" in capsys.readouterr().out


def test_words_say_what_since_when_how_sure_why_and_what_to_do(folder: Path, capsys: Captured) -> None:
    main(["diagnose", str(folder / "shaken.ulg")])
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert lines[1].startswith("not replayed, so less can be told: ")
    assert lines[2:] == [
        "warning: It shakes [vibration]",
        "when: from 0 s to 2 s of the log; sure (93%)",
        "why: it was seen",
        "why: and again",
        "do: Mend it",
    ]


def test_json_is_a_list_of_logs_with_their_findings(folder: Path, capsys: Captured) -> None:
    main(
        [
            "diagnose",
            "--json",
            str(folder / "sound.ulg"),
            str(folder / "day" / "rubbish.ulg"),
            str(folder / "shaken.ulg"),
        ]
    )
    sound, rubbish, shaken = json.loads(capsys.readouterr().out)
    assert sound["findings"] == []
    assert sound["error"] is None
    assert set(rubbish["error"]) == {"reason", "remedy"}
    (one,) = shaken["findings"]
    wanted = {"id", "cause", "severity", "confidence", "since_s", "until_s", "evidence", "remedy", "values"}
    assert wanted <= set(one)
    assert (one["since_s"], one["until_s"], one["values"]) == (0.5, 1.5, {"imu_shaking_m_s2": 12.0})
    # JSON has no such number
    assert one["evidence"][1]["figure"] is None


def test_the_number_of_experiments_is_a_number(folder: Path, capsys: Captured) -> None:
    with pytest.raises(SystemExit):
        main(["diagnose", "--experiments", "-1", str(folder / "sound.ulg")])
    assert "whole number" in capsys.readouterr().err


def test_a_real_log_is_diagnosed_from_end_to_end(shared_logs: Path, capsys: Captured) -> None:
    assert main(["diagnose", "--json", str(shared_logs / "PX4__ekf_failure.ulg")]) == FOUND_FAILURE
    (one,) = json.loads(capsys.readouterr().out)
    assert one["findings"][0]["id"] == "accelerometer_clipping"
