from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from fusetune.errors import UserError
from fusetune.running.run_lock import RUN_LOCK, RUN_VARIABLE, Claim, claim_run, join_run, wait_for_jobs
from fusetune.storage import file_lock

fcntl = pytest.importorskip("fcntl", reason="where Windows is, it cannot be made up")

ProcessThat = Callable[[str, Path], AbstractContextManager[subprocess.Popen[str]]]

here = pytest.param("", id="here")
as_on_windows = pytest.param(
    "import tests.as_on_windows\n",
    marks=pytest.mark.skipif(not hasattr(fcntl, "F_OFD_SETLK"), reason="no locks of open files here"),
    id="as on Windows",
)


@pytest.fixture(params=[here, as_on_windows])
def process_that(request: pytest.FixtureRequest, project_root: Path) -> ProcessThat:
    """A process that has done something to a folder, said how it went, and lives on until its input ends."""

    @contextmanager
    def process_that(call: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
        code = (
            f"{request.param}from fusetune.running.run_lock import *; from fusetune.errors import UserError\n"
            "import sys; folder = sys.argv[1]\n"
            f"try: print({call}, flush=True)\n"
            "except UserError as error: print(error, flush=True)\n"
            "sys.stdin.readline()"
        )
        process = subprocess.Popen(
            [sys.executable, "-c", code, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, RUN_VARIABLE: "first"},
            cwd=project_root,
        )
        try:
            yield process
        finally:
            process.kill()
            process.communicate()

    return process_that


def answer(process: subprocess.Popen[str]) -> str:
    assert process.stdout
    return process.stdout.readline().strip()


def end(process: subprocess.Popen[str]) -> None:
    assert process.stdin
    process.stdin.write("\n")
    process.stdin.flush()
    process.wait()


def test_a_folder_is_claimed_by_one_process_and_others_are_told_by_which(
    process_that: ProcessThat, tmp_path: Path
) -> None:
    with process_that("claim_run(folder, 'first').former", tmp_path) as first:
        assert answer(first) == "None"
        with process_that("claim_run(folder, 'second')", tmp_path) as second:
            refusal = answer(second)
        assert f"another run is at work here (process {first.pid} on " in refusal
        assert "since 20" in refusal
        assert "start again" in refusal


def test_a_process_that_has_a_folder_can_begin_another_run_there(process_that: ProcessThat, tmp_path: Path) -> None:
    with process_that("[claim_run(folder, 'first'), claim_run(folder, 'second')]", tmp_path) as holder:
        claim = Claim(locked=True, former=None)
        assert answer(holder) == str([claim, claim])
        assert json.loads((tmp_path / RUN_LOCK).read_text(encoding="utf-8"))["run"] == "second"
        with process_that("claim_run(folder, 'third')", tmp_path) as third:
            assert "another run is at work here" in answer(third)


def test_after_a_run_that_was_killed_the_next_one_knows_of_it_and_after_one_that_ended_does_not(
    process_that: ProcessThat, tmp_path: Path
) -> None:
    with process_that("claim_run(folder, 'first').former", tmp_path) as first:
        answer(first)
        first.kill()
        first.wait()
        with process_that("claim_run(folder, 'second').former.pid", tmp_path) as second:
            assert answer(second) == str(first.pid)
            end(second)
    with process_that("claim_run(folder, 'third').former", tmp_path) as third:
        assert answer(third) == "None"


def test_a_run_of_another_machine_that_never_ended_is_not_taken_for_dead(tmp_path: Path) -> None:
    lock = tmp_path / RUN_LOCK
    holder = {"run": "x", "pid": 7, "host": "login-1", "boot": "another", "since": "2026-01-01 10:00:00+00:00"}
    lock.write_text(json.dumps(holder), encoding="utf-8")
    with pytest.raises(UserError, match="process 7 on login-1, since 2026-01-01 10:00:00") as caught:
        claim_run(tmp_path, "mine")
    assert "delete this file" in caught.value.remedy
    assert json.loads(lock.read_text(encoding="utf-8")) == holder
    lock.unlink()
    assert claim_run(tmp_path, "mine") == Claim(locked=True, former=None)


def test_jobs_are_waited_for_until_they_end(process_that: ProcessThat, tmp_path: Path) -> None:
    def ended(within_s: float) -> bool:
        with process_that(f"wait_for_jobs(folder, {within_s})", tmp_path) as run:
            return answer(run) == "True"

    assert ended(0.0)
    with process_that("join_run(folder)", tmp_path) as job, process_that("join_run(folder)", tmp_path) as other_job:
        assert (answer(job), answer(other_job)) == ("None", "None")
        assert not ended(0.0)
        job.kill()
        job.wait()
        assert not ended(0.0)
        other_job.kill()
        other_job.wait()
        assert ended(10.0)


def test_a_job_whose_run_has_ended_does_nothing(process_that: ProcessThat, tmp_path: Path) -> None:
    with process_that("claim_run(folder, 'first')", tmp_path) as first:
        answer(first)
        with process_that("join_run(folder)", tmp_path) as job:
            assert answer(job) == "None"
        end(first)
        with process_that("join_run(folder)", tmp_path) as late_job:
            assert "the run that asked for this job has ended" in answer(late_job)
    with process_that("claim_run(folder, 'second')", tmp_path) as second:
        answer(second)
        with process_that("join_run(folder)", tmp_path) as late_job:
            assert "the run that asked for this job has ended" in answer(late_job)


def test_a_job_of_a_killed_run_goes_on_while_there_is_no_other(process_that: ProcessThat, tmp_path: Path) -> None:
    with process_that("claim_run(folder, 'first')", tmp_path) as first:
        answer(first)
        first.kill()
        first.wait()
        with process_that("join_run(folder)", tmp_path) as job:
            assert answer(job) == "None"


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_without_locks_nothing_is_claimed_and_no_job_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(file_lock.fcntl, "flock", refuse)
    assert claim_run(tmp_path, "mine") == Claim(locked=False, former=None)
    assert (tmp_path / RUN_LOCK).read_bytes() == b""
    monkeypatch.setenv(RUN_VARIABLE, "mine")
    join_run(tmp_path)
    assert wait_for_jobs(tmp_path, 0.0)


def test_a_folder_that_cannot_be_written_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(UserError, match="cannot be written"):
        claim_run(tmp_path / "file" / "state", "mine")
