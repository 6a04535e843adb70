"""Who is at work in a folder: one run at a time, and the jobs that a killed run left behind.

The operating system drops a lock when the process that holds it ends, however it ends. So a lock that can be had proves
that its former holder is gone, which no file with a process number in it can. What the lock's file says is only for
people, and for jobs: they work for the run that is named there, and for no other.
"""

from __future__ import annotations

import atexit
import json
import os
import socket
import time
import uuid
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import IO

from fusetune.errors import UserError
from fusetune.storage.file_lock import POLL_INTERVAL_S, LocksUnavailableError, lock

RUN_LOCK = "fusetune_run.lock"
JOBS_LOCK = "fusetune_jobs.lock"
RUN_VARIABLE = "FUSETUNE_RUN"
"""Environment variable that tells a job which run it works for."""

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")

_held: list[IO[bytes]] = []
_claimed: dict[Path, IO[bytes]] = {}


@dataclass(frozen=True)
class Holder:
    """A run as the file of its lock names it."""

    run: str
    pid: int
    host: str
    boot: str
    """Identifier of the host's kernel since it started; empty where the system has none."""
    since: str

    @classmethod
    def here(cls, run: str) -> Holder:
        """This process."""
        since = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        return cls(run, os.getpid(), socket.gethostname(), _boot_id(), since)

    def was_on_this_machine(self) -> bool:
        """Whether a lock of it would be seen from here, whatever the file system."""
        return self.host == socket.gethostname() or (self.boot != "" and self.boot == _boot_id())

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host}, since {self.since}"


@dataclass(frozen=True)
class Claim:
    """What this process has got of a folder."""

    locked: bool
    """Whether the folder is this process's own until it ends; not so where the file system has no locks."""
    former: Holder | None
    """The run that had the folder before, where it was ended before it could say so."""


def new_run() -> str:
    """Name for a run, and for the jobs that this process will start."""
    os.environ[RUN_VARIABLE] = uuid.uuid4().hex
    return os.environ[RUN_VARIABLE]


def claim_run(folder: str | os.PathLike[str], run: str) -> Claim:
    """Claim a folder for this process until it ends.

    Parameters
    ----------
    folder
        Holds the file of the lock; made where it does not exist.
    run
        Name of the run, as its jobs know it.

    Raises
    ------
    UserError
        Another run is at work there, or one on another machine that may still be; or the folder cannot be written.
    """
    path = Path(folder).absolute() / RUN_LOCK
    if path in _claimed:
        _write(_claimed[path], _record(run))
        return Claim(locked=True, former=None)
    try:
        file = _open_and_lock(path, exclusive=True)
    except LocksUnavailableError:
        return Claim(locked=False, former=None)
    if file is None:
        holder = _holder_in(path)
        who = "" if holder is None else f" ({holder})"
        raise UserError(
            os.getcwd(), f"another run is at work here{who}", "Wait for its end, or end it; then start again"
        )
    former = _holder_in(path)
    if former is not None and not former.was_on_this_machine():
        file.close()
        reason = f"a run on another machine ({former}) never said that it ended, and from here that cannot be seen"
        raise UserError(path, reason, "Make sure that it has ended, delete this file, and start again")
    _write(file, _record(run))
    _claimed[path] = file
    atexit.register(_leave, file, os.getpid())
    return Claim(locked=True, former=former)


def join_run(folder: str | os.PathLike[str]) -> None:
    """Mark this process as a job at work in the folder until it ends.

    Raises
    ------
    UserError
        The run that started this job has ended, and another one may have begun to do the same.
    """
    try:
        file = _open_and_lock(Path(folder) / JOBS_LOCK, exclusive=False, wait=True)
    except LocksUnavailableError:
        return
    if file is not None:
        _held.append(file)
    # A new run names itself before it waits for the jobs of the one before. So whoever is not waited for sees its name.
    run, path = os.environ.get(RUN_VARIABLE), Path(folder) / RUN_LOCK
    holder = _holder_in(path)
    if run and path.exists() and (holder is None or holder.run != run):
        raise UserError(path, "the run that asked for this job has ended", "Start the pipeline again")


def wait_for_jobs(folder: str | os.PathLike[str], timeout_s: float) -> bool:
    """Wait until no job is at work in the folder.

    A run that is killed does not take its jobs with it: they go on to write what they were asked for. A new run must
    not start the same jobs beside them.

    Returns
    -------
    bool
        Whether the jobs have ended within the time.
    """
    end = time.monotonic() + timeout_s
    while True:
        try:
            file = _open_and_lock(Path(folder) / JOBS_LOCK, exclusive=True)
        except LocksUnavailableError:
            return True
        if file is not None:
            file.close()
            return True
        if time.monotonic() >= end:
            return False
        time.sleep(POLL_INTERVAL_S)


def holder_of(folder: str | os.PathLike[str]) -> Holder | None:
    """The run that has the folder, or had it and was ended before it could say so; only to be told of."""
    return _holder_in(Path(folder) / RUN_LOCK)


def _open_and_lock(path: Path, exclusive: bool, wait: bool = False) -> IO[bytes] | None:
    """The open file with the lock; `None` where another process has it."""
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666), "r+b")
        except OSError as error:
            reason = f"cannot be written ({error.strerror})"
            raise UserError(path, reason, "Make room, or mend the permissions of its folder") from error
        try:
            locked = lock(file, exclusive, wait)
        except LocksUnavailableError:
            file.close()
            raise
        if locked and _is_still(path, file):
            return file
        file.close()
        if not locked:
            return None


def _is_still(path: Path, file: IO[bytes]) -> bool:
    """Whether a file has not been taken away while its lock was waited for."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def _holder_in(path: Path) -> Holder | None:
    try:
        return Holder(**json.loads(path.read_bytes()))
    except (OSError, ValueError, TypeError):
        return None


def _record(run: str) -> bytes:
    return json.dumps(asdict(Holder.here(run))).encode()


def _write(file: IO[bytes], content: bytes) -> None:
    # Not a temporary file that is moved into place: the lock belongs to this very file.
    file.seek(0)
    file.truncate()
    file.write(content)
    file.flush()
    # jobs on other machines read it while this process keeps it open
    os.fsync(file.fileno())


def _leave(file: IO[bytes], pid: int) -> None:
    if os.getpid() == pid:
        _write(file, b"")
        file.close()


def _boot_id() -> str:
    try:
        return _BOOT_ID.read_text(encoding="ascii").strip()
    except OSError:
        return ""
