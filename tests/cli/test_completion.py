"""What a shell completes: asked as argcomplete's scripts ask, by environment variables."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fusetune.cli import main
from fusetune.cli.command_line import COMMANDS
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS


def completed(line: str, folder: Path) -> set[str]:
    """Completions of the last word of a command line."""
    answer = folder / "answer"
    environment = os.environ | {
        "PYTHONPATH": str(Path(__file__).resolve().parents[2] / "src"),
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_SHELL": "fish",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
    }
    command = [sys.executable, "-c", "from fusetune.cli import main; main()"]
    subprocess.run(command, cwd=folder, env=environment, check=False, capture_output=True)
    return {one.strip() for one in answer.read_text(encoding="utf-8").splitlines()}


@pytest.mark.parametrize(
    ("line", "there", "absent"),
    [
        ("fusetune ", COMMANDS.keys(), ()),
        ("fusetune run --c", {"--cores", "--config", "--configfile"}, {"--study"}),
        ("fusetune run ", {"one.ulg", "folder/"}, {"sets.yaml", "notes.txt"}),
        ("fusetune run --study ", {"sets.yaml"}, {"one.ulg"}),
        ("fusetune decide ", {"folder/"}, {"one.ulg"}),
        ("fusetune score one.ulg --set a:EKF2_GPS_D", {"a:EKF2_GPS_DELAY="}, {"a:EKF2_GPS_CTRL="}),
        ("fusetune score one.ulg --set a:EKF2_GPS_DELAY=1,EKF2_ACC_N", {"a:EKF2_GPS_DELAY=1,EKF2_ACC_NOISE="}, ()),
        ("fusetune run --config decision.conf", {"decision.confidence="}, {"decision.draws="}),
        ("fusetune completion ", {"bash", "zsh", "fish"}, ()),
    ],
)
def test_a_shell_is_told(line: str, there: set[str], absent: set[str], tmp_path: Path) -> None:
    for name in ("one.ulg", "sets.yaml", "notes.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "folder").mkdir()
    found = completed(line, tmp_path)
    # a description may follow
    assert {*there} <= {one.split("\v")[0].split("\t")[0] for one in found}
    assert not {*absent} & found


def test_every_parameter_can_be_named(tmp_path: Path) -> None:
    assert {f"a:{name}=" for name in PARAMETERS} == completed("fusetune score one.ulg --set a:", tmp_path)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_gets_its_script(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert "fusetune" in capsys.readouterr().out
