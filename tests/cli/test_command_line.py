from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from fusetune import __version__
from fusetune.cli import main
from fusetune.cli.command_line import COMMANDS, parser


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.split() == ["fusetune", __version__]


def test_save_lists_a_file_that_is_no_log_with_its_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "broken.ulg"
    log.write_bytes(b"this is no ULog")
    assert main(["save", str(log), "--out", str(tmp_path / "saved")]) == 1
    assert capsys.readouterr().out.startswith("broken: refused\n  ")
    assert (tmp_path / "saved" / "broken" / "verdict.json").exists()


def test_design_writes_what_the_vehicle_loads(tmp_path: Path, project_root: Path) -> None:
    config = project_root / "config"
    study, mission = config / "studies" / "paper_table11.yaml", config / "missions" / "survey.yaml"
    assert main(["design", "--mission", str(mission), "--study", str(study), "--out", str(tmp_path)]) == 0
    assert (tmp_path / "survey.plan").exists()
    assert (tmp_path / "paper4.params").exists()


def test_study_writes_and_prints_the_sets_of_a_file(
    tmp_path: Path, project_root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", str(project_root / "config/studies/paper_table11.yaml"), "--out", str(tmp_path)]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[:2] == ["set", "EKF2_BARO_NOISE"]
    assert [line.split()[0] for line in rows] == [f"paper{number}" for number in range(1, 7)]
    assert {"paper4.params", "sets.parquet"} <= {file.name for file in tmp_path.iterdir()}


def test_study_around_a_log_tells_what_is_varied_and_why_the_rest_is_not(
    golden_logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", "--around", str(golden_logs / "mc_vision.ulg"), "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "evp_noise_up" in printed
    assert "no EKF2_GPS_POS_X: EKF2_GPS_CTRL is 0" in printed
    written = {file.stem for file in tmp_path.glob("*.params")}
    assert written == {line.split()[0] for line in printed.splitlines()[1:] if not line.startswith("no ")}


def test_a_mistake_of_the_user_is_one_line_and_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "no_study.yaml"
    assert main(["design", "--mission", "config/missions/survey.yaml", "--study", str(missing), "--out", "x"]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("fusetune: ")
    assert len(printed.splitlines()) == 1


def test_simulate_names_the_sets_that_a_study_has(
    tmp_path: Path, project_root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = project_root / "config"
    files = {
        "mission": "missions/survey.yaml",
        "vehicle": "vehicles/quadrotor.yaml",
        "study": "studies/paper_table11.yaml",
    }
    options = [part for name, file in files.items() for part in (f"--{name}", str(config / file))]
    assert main(["simulate", *options, "--set", "paper9", "--out", str(tmp_path / "x.ulg")]) == 2
    assert "paper1, paper2" in capsys.readouterr().err


def test_the_manual_names_every_command_and_the_help_lists_it(
    project_root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    manual = (project_root / "docs" / "command.md").read_text(encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = capsys.readouterr().out
    for name, command in COMMANDS.items():
        assert f"`fusetune {name}" in manual, name
        assert f"  {name:<16} {command.HELP}\n" in listed


def test_every_file_of_the_folder_is_a_command_under_its_name(project_root: Path) -> None:
    files = {file.stem for file in (project_root / "src" / "fusetune" / "cli").glob("*.py")}
    assert files - {"__init__", "__main__", "command_line", "command", "lines"} == {
        name.replace("-", "_") for name in COMMANDS
    }


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_of_a_command_are_command_lines_that_it_takes(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    for line, words in COMMANDS[name].EXAMPLES:
        assert f"  {line}\n      {words}\n" in printed
        for one in (part for part in re.split(r"&&|\||;", line) if part.strip().startswith("fusetune ")):
            command, *arguments = shlex.split(one.partition(">")[0])[1:]
            assert parser().parse_args([command, *arguments]).command == command


def test_without_a_command_a_terminal_is_told_where_to_begin(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 2
    assert "required: COMMAND" in capsys.readouterr().err
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert main([]) == 0
    assert "fusetune run LOG…" in capsys.readouterr().out


def test_a_command_that_is_not_run_loads_no_room(project_root: Path) -> None:
    """So `fusetune --version` answers at once; rooms are what loads NumPy, pyarrow, Numba."""
    code = "import sys, fusetune.cli; print(*sys.modules)"
    environment = os.environ | {"PYTHONPATH": str(project_root / "src")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True)
    loaded = done.stdout.split()
    assert "numpy" not in loaded
    assert {name.split(".")[1] for name in loaded if name.startswith("fusetune.")} == {"cli", "errors"}


def test_cards_are_written_and_told(tmp_path: Path, project_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = project_root / "config" / "studies" / "paper_table11.yaml"
    out = tmp_path / "cards.html"
    assert main(["cards", str(study), "--flights", "10", "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}: 12 flights in blocks of 6\n"
    assert "paper6.params" in out.read_text(encoding="utf-8")
