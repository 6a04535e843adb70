"""Why a run failed, in sentences: what its jobs wrote into their logs, and what Snakemake or the workflow said."""

from __future__ import annotations

import re
from pathlib import Path

from fusetune.running.workflow_events import Event, JobFailed, Told
from fusetune.storage.files import AnyPath

_NAME_OF_EXCEPTION = re.compile(r"^[A-Za-z]*(?:Error|Exception)(?: in (?:rule|file) .*?)?(?:, line \d+)?:\s*")
"""How Snakemake and Python begin what they say of an exception."""
_PLACE = re.compile(r'^\s*File ".*", line \d+')
_TRACEBACK = "Traceback (most recent call last)"

_TOLD_BY_SNAKEMAKE = (
    "At least one job did not complete successfully",
    "Exiting because a job execution failed",
    "Shutting down, this might take some time",
    "Removing output files of failed job",
    "Trying to restart job",
    "Terminating processes on user request",
    "Cancelling snakemake",
    "Complete log",
)
"""Beginnings of what adds nothing to a job's own words."""


class RunFailures:
    """Collects, while a run works, what says why it failed.

    Parameters
    ----------
    folder : that it works in; logs are named below it
    """

    def __init__(self, folder: AnyPath) -> None:
        self._folder = Path(folder)
        self._jobs: list[JobFailed] = []
        self._told: list[str] = []
        self._printed: list[str] = []

    def take(self, told: Event | str) -> None:
        """Know of an event, or of a line that something printed."""
        if isinstance(told, JobFailed):
            self._jobs.append(told)
        elif isinstance(told, Told) and told.is_error:
            self._told.append(told.text)
        elif isinstance(told, str) and told.strip():
            self._printed.append(told.strip())

    def sentences(self) -> list[str]:
        """Each reason once, in a line: those of jobs, or where none failed, what was said of the whole run."""
        of_jobs = [self._of_job(job) for job in self._jobs]
        if of_jobs:
            return list(dict.fromkeys(of_jobs))
        told = [_without_its_place(one) for one in self._told]
        told = [one for one in told if one and not one.startswith(_TOLD_BY_SNAKEMAKE)]
        # what ends the run by itself is printed, and then Snakemake has nothing to say
        return list(dict.fromkeys(told or self._printed[-1:] or ["Snakemake ended without a reason"]))

    def _of_job(self, job: JobFailed) -> str:
        log = self._folder / job.log
        try:
            lines = log.read_text(encoding="utf-8", errors="backslashreplace").split("\n") if job.log else []
        except OSError:
            lines = []
        lines = [line for line in lines if line.strip()]
        what = f"{job.rule} of {job.flight}" if job.flight else job.rule
        if not lines:
            return f"{what} failed and left no word of why. Run again; if it stays so, tell the developers."
        if any(line.startswith(_TRACEBACK) for line in lines):
            return (
                f"{what} failed by a fault of fusetune's own ({lines[-1].strip()}). "
                f"Tell the developers, with {job.log}; all else is as it was."
            )
        return lines[-1].strip()


def _without_its_place(told: str) -> str:
    """What Snakemake says of an exception, in a line, without the lines of code that it came from."""
    lines = told.strip().splitlines()
    if lines and lines[0].startswith(_TRACEBACK):
        lines = lines[-1:]
    kept = [_NAME_OF_EXCEPTION.sub("", line.strip()) for line in lines if not _PLACE.match(line)]
    return " ".join(filter(None, kept))
