from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fusetune.errors import UserError
from fusetune.running import run_lock
from fusetune.running.run_lock import RUN_LOCK, RUN_VARIABLE, Claim, claim_run, join_run, wait_for_jobs

pytest.importorskip("fcntl", reason="this system has no locks that end with their process")


@contextmanager
def process_that(call: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that has done something to a folder, said how it went, and lives on until its input ends."""
    code = (
        "from fusetune.running.run_lock import *; from fusetune.errors import UserError\n"
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
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def answer(process: subprocess.Popen[str]) -> str:
    assert process.stdout
    return process.stdout.readline().strip()


def end(process: subprocess.Popen[str]) -> None:
    assert process.stdin
    process.stdin.write("\n")
    process.stdin.flush()
    process.wait()


def test_a_folder_is_claimed_by_one_process_and_others_are_told_by_which(tmp_path: Path) -> None:
    with process_that("claim_run(folder, 'first').former", tmp_path) as first:
        assert answer(first) == "None"
        with process_that("claim_run(folder, 'second')", tmp_path) as second:
            refusal = answer(second)
        assert f"another run is at work here (process {first.pid} on " in refusal
        assert "since 20" in refusal
        assert "start again" in refusal


def test_a_process_that_has_a_folder_can_begin_another_run_there(tmp_path: Path) -> None:
    for run in ("first", "second"):
        assert claim_run(tmp_path, run) == Claim(locked=True, former=None)
        assert json.loads((tmp_path / RUN_LOCK).read_text(encoding="utf-8"))["run"] == run
    with process_that("claim_run(folder, 'third')", tmp_path) as third:
        assert "another run is at work here" in answer(third)


def test_after_a_run_that_was_killed_the_next_one_knows_of_it_and_after_one_that_ended_does_not(tmp_path: Path) -> None:
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


def test_a_job_is_waited_for_until_it_ends(tmp_path: Path) -> None:
    assert wait_for_jobs(tmp_path, 0.0)
    with process_that("join_run(folder)", tmp_path) as job:
        assert answer(job) == "None"
        assert not wait_for_jobs(tmp_path, 0.0)
        with process_that("join_run(folder)", tmp_path) as other_job:
            assert answer(other_job) == "None"
        job.kill()
        job.wait()
        assert wait_for_jobs(tmp_path, 10.0)


def test_a_job_whose_run_has_ended_does_nothing(tmp_path: Path) -> None:
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


def test_a_job_of_a_killed_run_goes_on_while_there_is_no_other(tmp_path: Path) -> None:
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

    monkeypatch.setattr(run_lock.fcntl, "flock", refuse)
    assert claim_run(tmp_path, "mine") == Claim(locked=False, former=None)
    assert (tmp_path / RUN_LOCK).read_bytes() == b""
    monkeypatch.setenv(RUN_VARIABLE, "mine")
    join_run(tmp_path)
    assert wait_for_jobs(tmp_path, 0.0)


def test_a_folder_that_cannot_be_written_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(UserError, match="cannot be written"):
        claim_run(tmp_path / "file" / "state", "mine")
