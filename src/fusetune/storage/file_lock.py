"""Locks on open files that the operating system drops with the process that holds them, however it ends.

POSIX has `flock`. Windows locks ranges of bytes, each for one process alone; what several may share at a time is there
one of many bytes for each of them, and all of these bytes for who wants it alone. They lie far behind what the file
holds: others could not read a locked byte.
"""

from __future__ import annotations

import errno
import time
from typing import IO

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]
try:
    import msvcrt
except ImportError:
    msvcrt = None  # type: ignore[assignment]

POLL_INTERVAL_S = 0.2

_TAKEN = {errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK}
_FIRST_BYTE = 1 << 30
_SHARES = 1024
"""How many processes may share a lock on Windows."""


class LocksUnavailableError(Exception):
    """The file system, or the system, has no locks that end with their process."""


def lock(file: IO[bytes], exclusive: bool, wait: bool) -> bool:
    """Lock a file until it is closed.

    Parameters
    ----------
    file
        Open for reading and writing: network file systems give no exclusive lock otherwise.
    exclusive
        For this process alone, or together with others that want it so.
    wait
        Until it can be had.

    Returns
    -------
    bool
        Whether the file is locked; always so where it was waited for.

    Raises
    ------
    LocksUnavailableError
        There are no such locks here.
    """
    while True:
        try:
            if fcntl is not None:
                kind = fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH
                fcntl.flock(file, kind if wait else kind | fcntl.LOCK_NB)
            elif msvcrt is not None:
                _lock_bytes(file, exclusive)
            else:
                raise LocksUnavailableError("this system has none")
            return True
        except OSError as error:
            if error.errno not in _TAKEN:
                raise LocksUnavailableError(error.strerror) from error
        if not wait:
            return False
        time.sleep(POLL_INTERVAL_S)


def _lock_bytes(file: IO[bytes], exclusive: bool) -> None:
    """Lock all bytes, or the first that is free; raises `OSError` where that cannot be had."""
    place = file.tell()
    try:
        if exclusive:
            return _lock_range(file, 0, _SHARES)
        for share in range(_SHARES - 1):
            try:
                return _lock_range(file, share, 1)
            except OSError as error:
                if error.errno not in _TAKEN:
                    raise
        return _lock_range(file, _SHARES - 1, 1)
    finally:
        file.seek(place)


def _lock_range(file: IO[bytes], first: int, count: int) -> None:
    file.seek(_FIRST_BYTE + first)
    msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, count)  # type: ignore[attr-defined]
