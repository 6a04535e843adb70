"""Jobs that a killed run left in Slurm's queue.

A run that is killed cannot take its jobs with it. Those that still wait would start later, beside a new run's jobs for
the same files. Slurm knows for every job where its output goes, and that is below the folder of the run, so a run's
jobs are told from all others by that, whatever they are called.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from fusetune.errors import UserError

LOG_FOLDER = "slurm_logs"
"""Where Snakemake's executor lets Slurm write what jobs print, below `.snakemake`."""

ANSWER_WITHIN_S = 30.0
GONE_WITHIN_S = 120.0
POLL_INTERVAL_S = 0.5
_LONGEST_PATH = 4096


@dataclass(frozen=True)
class ClusterJob:
    """A job in the queue: its number, and its state in Slurm's words."""

    number: str
    state: str


def queued_jobs(state_folder: str | os.PathLike[str]) -> list[ClusterJob]:
    """This user's jobs in Slurm's queue, waiting or at work, that were submitted for the folder.

    Parameters
    ----------
    state_folder
        `.snakemake` of the folder.

    Raises
    ------
    UserError
        Runs of the folder have used Slurm, but its queue cannot be asked.
    """
    logs = Path(state_folder).resolve() / LOG_FOLDER
    if not logs.is_dir():
        return []
    columns = f"JobID:20,State:20,STDOUT:{_LONGEST_PATH}"
    jobs = []
    for line in _ask(logs, "squeue", "--me", "--noheader", f"--Format={columns}").splitlines():
        number, state, output = line.split(maxsplit=2)
        if Path(output.strip()).is_relative_to(logs):
            jobs.append(ClusterJob(number, state))
    return jobs


def cancel_queued_jobs(state_folder: str | os.PathLike[str]) -> list[ClusterJob]:
    """Cancel the jobs that `queued_jobs` finds and wait until they have ended; call it only where no run is alive.

    Nothing is lost but time: what a job had made whose run is gone would be made again in any case.

    Returns
    -------
    list[ClusterJob]
        The jobs as they were found.

    Raises
    ------
    UserError
        As `queued_jobs`, or jobs do not end.
    """
    found = queued_jobs(state_folder)
    if not found:
        return []
    logs = Path(state_folder).resolve() / LOG_FOLDER
    _ask(logs, "scancel", *(job.number for job in found))
    end = time.monotonic() + GONE_WITHIN_S
    while left := queued_jobs(state_folder):
        if time.monotonic() >= end:
            numbers = " ".join(job.number for job in left)
            raise UserError(logs, f"jobs {numbers} of an interrupted run do not end", f"Try scancel {numbers}")
        time.sleep(POLL_INTERVAL_S)
    return found


def _ask(logs: Path, *command: str) -> str:
    """What a command of Slurm prints."""
    try:
        if shutil.which(command[0]) is None:
            raise FileNotFoundError(f"there is no {command[0]} on this machine")
        answer = subprocess.run(command, capture_output=True, text=True, timeout=ANSWER_WITHIN_S, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        printed = (getattr(error, "stderr", None) or "").strip()
        raise UserError(
            logs,
            f"runs of this folder have used Slurm, and it cannot be asked for jobs that wait ({printed or error})",
            "Start again where squeue answers; if you know that no job is left, delete this folder",
        ) from error
    return answer.stdout
