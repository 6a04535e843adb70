from __future__ import annotations

import builtins
import io
import sys
from pathlib import Path
from typing import Any

import grimp
import pytest
from benchmarks.upload_trials.made_decision import made_values, write_decision
from benchmarks.upload_trials.running import free_port, vehicle_running

from fusetune.apply.upload import needs, pace
from fusetune.cli import main
from fusetune.cli.upload import TAKEN_BACK, UNFINISHED


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times twenty times as fast, as the vehicle's."""
    unhurried = pace.Pace
    monkeypatch.setattr(pace, "Pace", lambda: unhurried().times(0.05))


@pytest.mark.parametrize(
    ("options", "typed", "status", "printed", "sets"),
    [
        (["--yes"], None, 0, "Done: 8 values written", 8),
        ([], None, 1, "Give --yes if you mean it", 0),
        ([], "y\n", 0, "Nothing was written now.", 0),
        ([], "yes\n", 0, "Done: 8 values written", 8),
    ],
)
def test_nothing_is_written_without_a_yes(
    quick: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    typed: str | None,
    status: int,
    printed: str,
    sets: int,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO() if typed is None else Terminal(typed))
    file = write_decision(tmp_path / "apply")
    with vehicle_running({"values": made_values(150)}) as running:
        assert main(["upload", str(file), "--to", running.address, "--patience", "1", *options]) == status
        [report] = running.reports()
    out = capsys.readouterr()
    assert printed in out.out + out.err
    assert len(report["sets"]) == sets


def test_how_it_ends_is_told_by_its_status(quick: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, uploads = write_decision(tmp_path / "apply"), tmp_path / "uploads"
    to = ["upload", str(file), "--yes", "--patience", "1", "--folder", str(uploads), "--to"]
    refusing = {"values": made_values(150), "faults": {"refused": 0.01, "refused_name": "EKF2_MAG_NOISE"}}
    with vehicle_running(refusing) as running:
        assert main([*to, running.address]) == TAKEN_BACK == 3
    silent = {"values": made_values(150), "faults": {"silent_after_sets": 2, "silent_s": 1e6}}
    with vehicle_running(silent) as running:
        assert main([*to, running.address]) == UNFINISHED == 4
        [folder] = sorted(uploads.iterdir())[1:]
        again = ["upload", "--to", running.address, "--patience", "0", "--resume", "--folder", str(folder)]
        assert main(again) == UNFINISHED
    assert "no heartbeat came" in capsys.readouterr().err
    nobody = f"udp:{free_port()}"
    assert main(["upload", str(file), "--to", nobody, "--patience", "0"]) == 1
    assert main(["upload", str(file), "--to", "udp:none"]) == 2
    assert "Give udp:14550, udp:host:port, tcp:host:port, or a serial port" in capsys.readouterr().err


def test_a_missing_library_is_told_with_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(needs, "find_spec", lambda name: None)
    assert main(["upload", "--to", "udp:14550"]) == 2
    assert "needs pymavlink, which is not installed. Install it: pip install pymavlink" in capsys.readouterr().err
    real = builtins.__import__

    def without_serial(name: str, *others: Any) -> Any:
        if name == "serial":
            raise ImportError(name)
        return real(name, *others)

    monkeypatch.undo()
    monkeypatch.setattr(builtins, "__import__", without_serial)
    file = write_decision(tmp_path)
    assert main(["upload", str(file), "--to", "/dev/ttyACM0,57600"]) == 2
    assert "needs pyserial" in capsys.readouterr().err


def test_nothing_but_the_command_uploads(project_root: Path) -> None:
    """No rule, no script and no other module reaches it, by whatever chain of imports."""
    graph = grimp.build_graph("fusetune")
    inside = {name for name in graph.modules if name.startswith("fusetune.apply.upload")}
    assert "fusetune.apply.upload.uploading" in inside
    importers = {one for name in inside for one in graph.find_modules_that_directly_import(name)} - inside
    assert importers == {"fusetune.cli.upload"}
    assert graph.find_modules_that_directly_import("fusetune.cli.upload") == {"fusetune.cli.command_line"}
    workflow = project_root / "workflow"
    rules = [workflow / "Snakefile", *workflow.rglob("*.smk"), *workflow.rglob("*.py")]
    assert len(rules) > 10
    texts = [file.read_text(encoding="utf-8") for file in rules]
    assert not [text for text in texts if "upload" in text or "fusetune.cli" in text]
