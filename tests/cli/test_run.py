"""`fusetune run` and `fusetune init`: what they make, how they fail, how they are interrupted.

The whole way from logs to the parameter file is in tests/workflow/test_installed.py.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fusetune.cli import main
from fusetune.cli.output.run_display import run_display
from fusetune.cli.output.run_outcome import run_outcome
from fusetune.running.workflow_events import Counted, JobBegun, JobDone, Planned, Told

Captured = pytest.CaptureFixture[str]


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "fusetune.cli", "run", "--cores", "1", *arguments]
    source = Path(__file__).resolve().parents[2] / "src"
    return subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(source)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # a test that runs in the background of a shell would pass on that interrupts are ignored there
        preexec_fn=_heed_interrupts,
    )


def _heed_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_init_says_what_to_do_next_and_writes_over_nothing(tmp_path: Path, capsys: Captured) -> None:
    folder = str(tmp_path / "tuning")
    assert main(["init", folder]) == 0
    assert f"cd {folder} && fusetune run" in capsys.readouterr().out
    assert main(["init", folder]) == 2
    assert "is there already, and nothing is written over" in capsys.readouterr().err


def test_an_interrupted_run_ends_itself_its_jobs_and_says_so_in_a_line(tmp_path: Path) -> None:
    run = started(tmp_path, "-v")
    assert run.stderr is not None
    # a simulated flight takes long enough
    told = next(line for line in run.stderr if line.startswith("Execute: simulate"))
    assert told
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 130
    assert out == ""
    assert err.splitlines()[-2:] == ["What is finished stays, and the next run goes on.", "fusetune: interrupted"]
    assert "Traceback" not in err
    # the lock of the run is free, and nothing is at work there any more
    from fusetune.running.run_lock import claim_run, wait_for_jobs

    assert wait_for_jobs(tmp_path / ".snakemake", 5.0)
    assert claim_run(tmp_path / ".snakemake", "test").locked


def test_a_wrong_setting_is_one_sentence(tmp_path: Path) -> None:
    run = started(tmp_path, "--config", "decision.confidence=2", "--json")
    out, err = run.communicate(timeout=60)
    assert (run.returncode, out) == (2, "")
    assert err.startswith("fusetune: --config: decision.confidence is 2; expected a number between 0.5 and 0.999")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.ulg"], "does not exist"),
        (["--study", "none.yaml"], "none.yaml: is no file"),
        (["--config", "seed=1", "one.ulg"], "'one.ulg' is not KEY=VALUE"),
        (["--snakemake", "'"], "cannot be taken apart"),
        (["one.ulg", "-n"], "only tells, and links would have to be made"),
        (["--results", "elsewhere"], "is there already"),
        (["one.ulg", "--config", "flights_dir=/tmp"], "no links are put there"),
    ],
)
def test_what_cannot_be_meant_ends_before_anything_is_begun(
    arguments: list[str], said: str, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.ulg").write_bytes(b"x")
    (tmp_path / "results").mkdir()
    assert main(["run", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert not (tmp_path / ".snakemake").exists()


EVENTS = [
    Planned({"save_flight": 2, "analyze_flight": 2}),
    "Waiting for the jobs that an interrupted run left at work ...",
    "said by a job, and told at the end",
    JobBegun(1, "save_flight", "Save: read one", "one"),
    JobDone(1),
    JobBegun(2, "analyze_flight", "Analyze: replay and score one", "one"),
    Told("Select jobs to execute...", is_error=False),
    Counted(1, 4),
]


def shown(capsys: Captured, *, quiet: bool = False, verbose: bool = False) -> str:
    display = run_display(quiet=quiet, verbose=verbose)
    for event in EVENTS:
        display.take(event)
    display.end()
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err


def test_piped_it_is_quiet_and_by_lines(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(capsys, quiet=True) == ""
    assert shown(capsys) == "Waiting for the jobs that an interrupted run left at work ...\n"
    monkeypatch.setattr("fusetune.cli.output.run_display.EVERY_S", 0.0)
    assert shown(capsys).splitlines()[1:] == [
        "Save: read one (0 %, 0 of 2 flights)",
        "Analyze: replay and score one (6 %, 0 of 2 flights)",
    ]
    every = shown(capsys, verbose=True).splitlines()
    assert every[2:4] == ["Save: read one", "Save: read one: done after 0.0 s"]
    assert every[-1] == "Select jobs to execute..."


def test_on_a_terminal_a_bar_says_what_is_done_and_goes_at_the_end(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bar itself is rich's; the control sequences of a terminal show that it is drawn and taken away."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    display = run_display(quiet=False, verbose=False)
    for event in EVENTS:
        display.take(event)
    time.sleep(0.3)
    display.end()
    drawn = capsys.readouterr().err
    assert "Analyze: replay and score one" in drawn
    assert "0 of 2 flights" in drawn
    assert drawn.rstrip("\n").endswith("\x1b[2K") or "\x1b[?25h" in drawn


def test_a_folder_in_which_nothing_was_decided_has_an_end_too(tmp_path: Path) -> None:
    outcome = run_outcome(tmp_path)
    assert [*outcome.lines()] == ["0 flights, 0 refused"]
    assert json.loads(json.dumps({**outcome.document(), "files": None})) == {
        "flights": 0,
        "refused": 0,
        "simulated": False,
        "files": None,
    }
