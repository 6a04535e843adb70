"""Who may change what lies in a folder: a run that will run jobs and holds it, and nobody else."""

from __future__ import annotations

import base64
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.workflow.conftest import ROOT, Workspace, make_workspace

from fusetune.running.run_lock import RUN_VARIABLE

TABLE = "results/save/flights.csv"


@contextmanager
def process_in(workspace: Workspace, call: str) -> Iterator[subprocess.Popen[str]]:
    """A process that has called a function of the lock in a folder, and lives on."""
    code = f"import sys; from fusetune.running.run_lock import *; {call}; print(flush=True); sys.stdin.readline()"
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=workspace.folder,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout
    process.stdout.readline()
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A finished run over one file that is no log; tests work in copies of it."""
    workspace = make_workspace(tmp_path_factory.mktemp("listed") / "work")
    (workspace.folder / "flights" / "first.ulg").write_bytes(b"no log")
    workspace.run_ok("--cores", "1", TABLE)
    return workspace


@pytest.fixture
def unfinished(listed: Workspace, tmp_path: Path) -> Workspace:
    """A folder in which a job never ended: its output lies there, marked as Snakemake marks it."""
    workspace = Workspace(tmp_path / "work")
    shutil.copytree(listed.folder, workspace.folder)
    name = base64.urlsafe_b64encode(b"results/save/first").decode()
    (workspace.folder / ".snakemake" / "incomplete" / name).write_text('{"external_jobid": null}', encoding="ascii")
    (workspace.folder / "results" / "save" / "first" / "half").write_bytes(b"half of a table")
    return workspace


def contents(workspace: Workspace) -> dict[Path, bytes]:
    """Results, and what Snakemake notes of jobs that have not ended."""
    folders = (workspace.folder / "results", workspace.folder / ".snakemake" / "incomplete")
    return {file: file.read_bytes() for folder in folders for file in folder.rglob("*") if file.is_file()}


def half(workspace: Workspace) -> Path:
    return workspace.folder / "results" / "save" / "first" / "half"


def test_who_only_looks_changes_nothing(unfinished: Workspace) -> None:
    before = contents(unfinished)
    for look in (["--dry-run"], ["--lint"], ["--summary"], ["--unlock"], ["--report", "page.zip", TABLE]):
        unfinished.run(*look)
        assert contents(unfinished) == before, look
    assert half(unfinished).exists()


def test_a_dry_run_says_what_is_unfinished_and_a_run_makes_it_again(unfinished: Workspace) -> None:
    printed = unfinished.run_ok("--dry-run", TABLE)
    assert "Some files are unfinished" in printed
    unfinished.run_ok("--cores", "1", TABLE)
    assert not half(unfinished).exists()
    assert unfinished.planned_jobs(TABLE) == {}


def test_a_living_run_is_not_taken_for_dead(unfinished: Workspace) -> None:
    before = contents(unfinished)
    with process_in(unfinished, "claim_run('.snakemake', 'other')") as other_run:
        unfinished.run_ok("--dry-run")  # neither holds the folder nor lets go of it for others
        refused = unfinished.run("--cores", "1", TABLE)
    assert refused.returncode == 1
    assert f"another run is at work here (process {other_run.pid} on" in refused.stdout
    assert "Traceback" not in refused.stdout
    assert contents(unfinished) == before
    unfinished.run_ok("--cores", "1", TABLE)
    assert not half(unfinished).exists()


def test_a_job_that_starts_after_its_run_has_ended_changes_nothing(
    unfinished: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a cluster may start it, which had it in its queue."""
    before = contents(unfinished)
    monkeypatch.setenv(RUN_VARIABLE, "the run before")
    with process_in(unfinished, "claim_run('.snakemake', 'other')"):
        late = unfinished.run("--mode", "remote", "--nolock", "--force", "--cores", "1", "results/save/first")
    assert late.returncode == 1
    assert "the run that asked for this job has ended" in late.stdout
    assert contents(unfinished) == before


def test_of_two_runs_at_once_one_works_and_the_other_says_so(workspace: Workspace) -> None:
    (workspace.folder / "flights" / "first.ulg").write_bytes(b"no log")
    runs = [
        subprocess.Popen(workspace.command("--cores", "1", TABLE), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for _ in range(2)
    ]
    printed = [run.communicate()[0].decode() for run in runs]
    outcomes = sorted(
        (run.returncode, "another run is at work here" in text) for run, text in zip(runs, printed, strict=True)
    )
    assert outcomes in ([(0, False), (1, True)], [(0, False), (0, False)]), printed
    assert workspace.planned_jobs(TABLE) == {}


def test_an_interrupt_before_the_first_job_shows_no_traceback(workspace: Workspace) -> None:
    pipe = subprocess.PIPE
    with process_in(workspace, "join_run('.snakemake')"):
        run = subprocess.Popen(
            workspace.command("--cores", "1"),
            stdout=pipe,
            stderr=subprocess.STDOUT,
            text=True,
            # ignored where tests run in the background, and what is ignored is inherited
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        assert run.stdout
        printed = []
        for line in run.stdout:
            printed.append(line)
            if "Waiting for the jobs that an interrupted run left" in line:
                run.send_signal(signal.SIGINT)
        run.wait()
    assert run.returncode == 128 + signal.SIGINT, printed
    assert "Traceback" not in "".join(printed)


def test_a_disk_without_room_ends_in_one_sentence(workspace: Workspace, demonstration: Workspace) -> None:
    resource = pytest.importorskip("resource")
    log = next(iter(sorted((demonstration.folder / "results" / "execute").glob("*.ulg"))))
    (workspace.folder / "flights" / "first.ulg").symlink_to(log)
    # files of at most 50 kB: enough for Snakemake's notes, too little for the tables of a flight
    run = subprocess.run(
        workspace.command("--cores", "1", TABLE),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000)),
    )
    assert run.returncode == 1
    assert "Traceback" not in run.stdout
    assert "results/save/first: cannot be written: File too large. Make room or mend its permissions." in run.stdout
    assert not list((workspace.folder / "results" / "save").glob(".*.partial"))
    workspace.run_ok("--cores", "1", TABLE)
