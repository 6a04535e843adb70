"""A queue as Slurm 22.05 prints it, without Slurm; tests/workflow/test_cluster.py asks Slurm itself."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fusetune.errors import UserError
from fusetune.running import cluster_jobs
from fusetune.running.cluster_jobs import ClusterJob, cancel_queued_jobs, queued_jobs

SQUEUE = """#!/bin/sh
[ "$1" = --me ] && [ "$2" = --noheader ] && [ "$3" = --Format=JobID:20,State:20,STDOUT:4096 ] || exit 2
cat {queue}
"""
SCANCEL = """#!/bin/sh
echo "$@" >> {cancelled}
for job in "$@"; do sed -i "/^$job /d" {queue}; done
"""


@pytest.fixture
def state(tmp_path: Path) -> Path:
    """`.snakemake` of a folder whose name has a blank, in which runs have used Slurm."""
    folder = tmp_path / "my flights" / ".snakemake"
    (folder / "slurm_logs").mkdir(parents=True)
    return folder


@pytest.fixture
def queue(tmp_path: Path, state: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file that the commands take for Slurm's queue: three jobs, of which the second and third are the folder's."""
    commands, queue = tmp_path / "bin", tmp_path / "queue"
    commands.mkdir()
    outputs = {
        "4": ("RUNNING", tmp_path / "other" / ".snakemake" / "slurm_logs" / "rule_save_flight" / "4.log"),
        "15": ("RUNNING", state / "slurm_logs" / "rule_save_flight" / "a" / "%j.log"),
        "16": ("PENDING", state / "slurm_logs" / "group_flight_analyze_flight" / "%j.log"),
    }
    lines = [f"{number:<20}{state:<20}{path!s:<4096}" for number, (state, path) in outputs.items()]
    queue.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    for name, text in (("squeue", SQUEUE), ("scancel", SCANCEL)):
        (commands / name).write_text(text.format(queue=queue, cancelled=tmp_path / "cancelled"), encoding="utf-8")
        (commands / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{commands}{os.pathsep}{os.environ['PATH']}")
    return queue


@pytest.mark.usefixtures("queue")
def test_jobs_of_the_folder_are_told_from_others_by_where_they_print(state: Path) -> None:
    assert queued_jobs(state) == [ClusterJob("15", "RUNNING"), ClusterJob("16", "PENDING")]


def test_only_jobs_of_the_folder_are_cancelled(state: Path, queue: Path, tmp_path: Path) -> None:
    assert [job.number for job in cancel_queued_jobs(state)] == ["15", "16"]
    assert (tmp_path / "cancelled").read_text(encoding="utf-8") == "15 16\n"
    assert queue.read_text(encoding="utf-8").split()[0] == "4"
    assert cancel_queued_jobs(state) == []


@pytest.mark.usefixtures("queue")
def test_jobs_that_do_not_end_are_named(state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bin" / "scancel").write_text("#!/bin/sh\n", encoding="utf-8")
    monkeypatch.setattr(cluster_jobs, "GONE_WITHIN_S", 0.0)
    with pytest.raises(UserError, match="jobs 15 16 of an interrupted run do not end"):
        cancel_queued_jobs(state)


@pytest.mark.parametrize("squeue", [None, "#!/bin/sh\necho 'Unable to contact slurm controller' >&2; exit 1\n"])
def test_a_queue_that_cannot_be_asked_is_told_where_slurm_was_used(
    state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, squeue: str | None
) -> None:
    commands = tmp_path / "bin"
    commands.mkdir()
    monkeypatch.setenv("PATH", str(commands))
    if squeue is not None:
        (commands / "squeue").write_text(squeue, encoding="utf-8")
        (commands / "squeue").chmod(0o755)
    with pytest.raises(UserError, match="no squeue" if squeue is None else "Unable to contact slurm controller"):
        queued_jobs(state)
    (state / "slurm_logs").rmdir()
    assert queued_jobs(state) == []
