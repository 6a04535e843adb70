from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fusetune.run_lock import wait_for_jobs

pytest.importorskip("fcntl", reason="this system has no locks that end with their process")


@contextmanager
def process_that(action: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that has done something to a folder and lives on."""
    code = f"from fusetune.run_lock import *; print({action}({str(folder)!r}), flush=True); input()"
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream:
                stream.close()


def answer(process: subprocess.Popen[str]) -> str:
    assert process.stdout
    return process.stdout.readline().strip()


def test_a_folder_is_claimed_by_one_process_and_free_when_that_is_killed(tmp_path: Path) -> None:
    with process_that("claim_run", tmp_path) as first:
        assert answer(first) == "True"
        with process_that("claim_run", tmp_path) as second:
            assert answer(second) == "False"
        first.kill()
        first.wait()
        with process_that("claim_run", tmp_path) as third:
            assert answer(third) == "True"


def test_a_job_is_waited_for_until_it_ends(tmp_path: Path) -> None:
    assert wait_for_jobs(tmp_path, 0.0)
    with process_that("join_run", tmp_path) as job:
        answer(job)
        assert not wait_for_jobs(tmp_path, 0.0)
        with process_that("join_run", tmp_path) as other_job:
            assert answer(other_job) == "None"
        job.kill()
        job.wait()
        assert wait_for_jobs(tmp_path, 10.0)
