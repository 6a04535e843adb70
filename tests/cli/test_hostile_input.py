"""The command line with input that cannot be used: a sentence and a status, never a traceback."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fusetune.cli import main
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.ulog.writer import write_ulog

Captured = pytest.CaptureFixture[str]

SETS = {
    "unknown.json": ({"overrides": {"EKF2_ACC_NOIS": 0.3}}, "EKF2_ACC_NOIS"),
    "unknown_param.json": ({"params": {"EKF2_NONE": 0.3}, "overrides": {}}, "EKF2_NONE"),
    "not_a_number.json": ({"overrides": {"EKF2_ACC_NOISE": "x"}}, "not_a_number.json"),
    "nan.json": ({"overrides": {"EKF2_ACC_NOISE": float("nan")}}, "EKF2_ACC_NOISE"),
    "boolean.json": ({"overrides": {"EKF2_ACC_NOISE": True}}, "EKF2_ACC_NOISE"),
    "list.json": ([], "list.json"),
    "list_inside.json": ({"overrides": []}, "list_inside.json"),
}


@pytest.fixture
def still(tmp_path: Path) -> Path:
    """A log of a vehicle that lies still for a quarter of a minute: it can be read, and holds one sensor only."""
    time_us = np.arange(3000, dtype=np.int64) * 5000 + 1_000_000
    imu = {"timestamp": time_us, "gyro_integral_dt": np.full(3000, 5000, np.uint32)}
    imu["accelerometer_integral_dt"] = imu["gyro_integral_dt"]
    for axis in range(3):
        imu |= {f"gyro_rad[{axis}]": np.zeros(3000, np.float32)}
        imu |= {f"accelerometer_m_s2[{axis}]": np.full(3000, -9.81 * (axis == 2), np.float32)}
    write_ulog(tmp_path / "still.ulg", Flight("still", {("sensor_combined", 0): imu}, ParameterHistory({}, [], {}, {})))
    return tmp_path / "still.ulg"


def status_and_error(capsys: Captured, *arguments: str | Path) -> tuple[int, str]:
    status = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err + captured.out
    return status, captured.err


def test_a_refused_log_is_told_with_its_remedy_and_a_status(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "broken.ulg").write_bytes(b"this is no ULog")
    missing = tmp_path / "nope.ulg"
    assert main(["save", str(missing), str(tmp_path / "broken.ulg"), "--out", str(tmp_path / "saved")]) == 1
    printed = capsys.readouterr().out
    assert (
        "nope: refused\n  the log cannot be opened: No such file or directory. Check that the file is there" in printed
    )
    assert "broken: refused\n  the log is not a ULog file. Take the .ulg file that PX4 wrote" in printed


def test_a_folder_in_place_of_a_log_is_refused(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "folder.ulg").mkdir()
    assert main(["save", str(tmp_path / "folder.ulg"), "--out", str(tmp_path / "saved")]) == 1
    assert "folder: refused" in capsys.readouterr().out


def test_two_logs_of_one_name_do_not_replace_each_other(tmp_path: Path, capsys: Captured) -> None:
    logs = [tmp_path / "monday" / "a.ulg", tmp_path / "tuesday" / "A.ulg"]
    status, error = status_and_error(capsys, "save", *logs, "--out", tmp_path / "saved")
    assert status == 2
    assert f"{logs[1]}: would be saved into the same folder as {logs[0]}" in error
    assert not (tmp_path / "saved").exists()


def test_saving_never_takes_a_folder_away_that_is_no_saved_flight(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "one.png").write_bytes(b"dear")
    status, error = status_and_error(capsys, "save", tmp_path / "pictures.ulg", "--out", tmp_path)
    assert status == 2
    assert "pictures: is there already and holds no saved flight" in error
    assert (tmp_path / "pictures" / "one.png").read_bytes() == b"dear"
    status, error = status_and_error(capsys, "save", tmp_path / "..ulg", "--out", tmp_path)
    assert status == 2
    assert "gives no name" in error


@pytest.mark.parametrize("command", ["save", "replay", "design", "simulate"])
def test_an_output_that_is_a_file_is_named(
    command: str, tmp_path: Path, project_root: Path, still: Path, capsys: Captured
) -> None:
    blocked = tmp_path / "taken"
    blocked.write_text("a file")
    config = project_root / "config"
    mission, study = config / "missions/survey.yaml", config / "studies/paper_table11.yaml"
    (tmp_path / "sets").mkdir()
    (tmp_path / "sets" / "a.json").write_text("{}")
    arguments: dict[str, list[str | Path]] = {
        "save": [still],
        "replay": [still, "--sets", tmp_path / "sets"],
        "design": ["--mission", mission, "--study", study],
        "simulate": ["--mission", mission, "--vehicle", tmp_path / "none.yaml"],
    }
    out = blocked / "below" if command != "simulate" else blocked
    status, error = status_and_error(capsys, command, *arguments[command], "--out", out)
    assert status == 2
    assert len(error.splitlines()) == 1
    assert str(tmp_path) in error


def test_studies_and_logs_that_do_not_fit_are_told(tmp_path: Path, project_root: Path, capsys: Captured) -> None:
    studies, broken = project_root / "config/studies", tmp_path / "broken.ulg"
    broken.write_bytes(b"this is no ULog")
    tries: dict[str, list[str | Path]] = {
        "names neither a study nor a log": [],
        "Name its log with --around": [studies / "around_present.yaml"],
        "Leave --around out": [studies / "imu_noise_grid.yaml", "--around", broken],
        "broken.ulg: the log is not a ULog file": ["--around", broken],
    }
    for said, arguments in tries.items():
        status, error = status_and_error(capsys, "study", *arguments, "--out", tmp_path / "out")
        assert (status, said in error, len(error.splitlines())) == (2, True, 1), error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", SETS)
def test_a_set_that_cannot_be_replayed_is_named_before_the_log_is_read(
    name: str, tmp_path: Path, capsys: Captured
) -> None:
    content, part = SETS[name]
    folder = tmp_path / "sets"
    folder.mkdir()
    (folder / name).write_text(json.dumps(content))
    status, error = status_and_error(
        capsys, "replay", tmp_path / "none.ulg", "--sets", folder, "--out", tmp_path / "out"
    )
    assert status == 2
    assert str(folder / name) in error
    assert part in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe", b"[" * 100_000, b"{", b'{"overrides": {"EKF2_ACC_NOISE": 1e999}}']
)
def test_a_set_file_of_any_bytes_ends_in_one_line(content: bytes, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "a.json").write_bytes(content)
    status, error = status_and_error(capsys, "replay", tmp_path / "x.ulg", "--sets", tmp_path, "--out", tmp_path / "o")
    assert status == 2
    assert str(tmp_path / "a.json") in error
    assert len(error.splitlines()) == 1


def test_no_folder_and_a_folder_without_sets_are_told_apart(tmp_path: Path, still: Path, capsys: Captured) -> None:
    errors = []
    (tmp_path / "empty").mkdir()
    for folder in (tmp_path / "nope", tmp_path / "empty", still):
        status, error = status_and_error(capsys, "replay", still, "--sets", folder, "--out", tmp_path / "out")
        assert status == 2
        assert str(folder) in error
        errors.append(error)
    assert "does not exist" in errors[0]
    assert "holds no parameter set" in errors[1]
    assert "is no folder" in errors[2]


def test_a_log_that_cannot_be_replayed_is_refused_with_the_remedy(tmp_path: Path, capsys: Captured) -> None:
    time_us = np.arange(100, dtype=np.int64) * 5000
    flight = Flight("x", {("vehicle_status", 0): {"timestamp": time_us}}, ParameterHistory({}, [], {}, {}))
    write_ulog(tmp_path / "x.ulg", flight)
    (tmp_path / "a.json").write_text("{}")
    status, error = status_and_error(capsys, "replay", tmp_path / "x.ulg", "--sets", tmp_path, "--out", tmp_path / "o")
    assert status == 2
    assert str(tmp_path / "x.ulg") in error
    assert "sensor_combined" in error


@pytest.mark.parametrize("seed", ["-1", "1.5", "x", "", "9" * 400])
def test_a_seed_that_is_none_is_a_matter_of_usage(seed: str, capsys: Captured) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "--mission", "m", "--vehicle", "v", "--out", "o", "--seed", seed])
    assert ended.value.code == 2
    assert "no whole number" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "part"),
    [
        ("", "empty"),
        ("faults: 3", "faults"),
        ("fault: []", "faults"),
        ("faults: [{kind: x}]", "gnss_outage"),
        ("[]", "list"),
    ],
)
def test_faults_that_cannot_be_used_are_told(
    content: str, part: str, tmp_path: Path, project_root: Path, capsys: Captured
) -> None:
    (tmp_path / "faults.yaml").write_text(content)
    config = project_root / "config"
    files = ["--mission", config / "missions/survey.yaml", "--vehicle", config / "vehicles/quadrotor.yaml"]
    status, error = status_and_error(
        capsys, "simulate", *files, "--faults", tmp_path / "faults.yaml", "--out", tmp_path / "x.ulg"
    )
    assert status == 2
    assert str(tmp_path / "faults.yaml") in error
    assert part in error


def test_fidelity_names_the_folder_that_lacks_something(tmp_path: Path, capsys: Captured) -> None:
    for name in ("nope", "empty"):
        if name == "empty":
            (tmp_path / name).mkdir()
        status, error = status_and_error(capsys, "fidelity", tmp_path / name, tmp_path)
        assert status == 2
        assert str(tmp_path / name) in error
    pq.write_table(pa.table({"source": ["mag"]}), tmp_path / "empty" / "a.innovations.parquet")
    status, error = status_and_error(capsys, "fidelity", tmp_path / "empty", tmp_path / "empty")
    assert status == 2
    assert "set a" in error
    (tmp_path / "empty" / "a.innovations.parquet").write_bytes(b"PAR1")
    status, error = status_and_error(capsys, "fidelity", tmp_path / "empty", tmp_path / "empty")
    assert status == 2
    assert "a.innovations.parquet" in error


def run(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fusetune.cli", *map(str, arguments)]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.run(command, text=True, check=False, **(streams | options))


def test_a_reader_that_has_gone_ends_the_command_quietly(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    ended = run("save", tmp_path / "a.ulg", "--out", tmp_path, stdout=write)
    os.close(write)
    assert ended.returncode == 141
    assert ended.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_an_output_that_is_full_is_told(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        ended = run("save", tmp_path / "a.ulg", "--out", tmp_path, stdout=full)
    assert ended.returncode == 2
    assert ended.stderr == "fusetune: the output: No space left on device. Mend the path or make room.\n"


def test_an_interrupted_command_says_so() -> None:
    script = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in the background
from fusetune.cli import design
from fusetune.cli import main
design.run = lambda options: print("at work", flush=True) or time.sleep(60)
sys.exit(main(["design", "--mission", "m", "--study", "s", "--out", "o"]))
"""
    at_work = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert at_work.stdout is not None
    assert at_work.stdout.readline() == "at work\n"
    at_work.send_signal(signal.SIGINT)
    _, error = at_work.communicate(timeout=60)
    assert at_work.returncode == 130
    assert error == "fusetune: interrupted\n"


def test_a_name_that_the_terminal_cannot_show_is_printed_all_the_same(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    ended = run("save", tmp_path / "höhe.ulg", "--out", tmp_path, env=environment)
    assert ended.returncode == 1
    assert ended.stdout.startswith("h\\xf6he: refused")
