"""Who is at work in a folder: one run at a time, and the jobs that a killed run left behind.

The operating system drops a lock when the process that holds it ends, however it ends. So a lock that can be had proves
that its former holder is gone, which no file with a process number in it can.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import IO

try:
    import fcntl
except ImportError:  # Windows has no such locks; there an interrupted run needs `snakemake --unlock`.
    fcntl = None  # type: ignore[assignment]

RUN_LOCK = "fusetune_run.lock"
JOBS_LOCK = "fusetune_jobs.lock"
POLL_INTERVAL_S = 0.2

_held: list[IO[bytes]] = []


def _open_and_lock(path: Path, exclusive: bool) -> IO[bytes] | None:
    if fcntl is None:
        return None
    path.parent.mkdir(parents=True, exist_ok=True)
    file = open(path, "ab")  # noqa: SIM115 - it stays open as long as the lock is held
    try:
        fcntl.flock(file, (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except OSError:
        file.close()
        return None
    return file


def claim_run(folder: str | os.PathLike[str]) -> bool:
    """Claim a folder for this process until it ends.

    Returns
    -------
    bool
        Whether the claim holds; ``False`` where another living run has the folder, or the file system has no locks.
    """
    file = _open_and_lock(Path(folder) / RUN_LOCK, exclusive=True)
    if file is None:
        return False
    _held.append(file)
    return True


def join_run(folder: str | os.PathLike[str]) -> None:
    """Mark this process as a job at work in the folder until it ends."""
    file = _open_and_lock(Path(folder) / JOBS_LOCK, exclusive=False)
    if file is not None:
        _held.append(file)


def wait_for_jobs(folder: str | os.PathLike[str], timeout_s: float) -> bool:
    """Wait until no job is at work in the folder.

    A run that is killed does not take its jobs with it: they go on to write what they were asked for. A new run must
    not start the same jobs beside them.

    Returns
    -------
    bool
        Whether the jobs have ended within the time.
    """
    if fcntl is None:
        return True
    end = time.monotonic() + timeout_s
    while True:
        file = _open_and_lock(Path(folder) / JOBS_LOCK, exclusive=True)
        if file is not None:
            file.close()
            return True
        if time.monotonic() >= end:
            return False
        time.sleep(POLL_INTERVAL_S)
