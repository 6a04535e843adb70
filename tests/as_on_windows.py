"""Makes the process that imports it like one on Windows, as far as the package can tell that is imported after it.

Modules and functions that only POSIX has are gone, and `msvcrt` locks ranges of bytes. Linux has locks of the same
kind, which belong to an open file and not to its process (`F_OFD_SETLK`), so several processes can be tried.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import subprocess  # noqa: F401 - before msvcrt is there, by which it would tell that this is Windows
import sys
from types import ModuleType

_POSIX_MODULES = ("fcntl", "grp", "posix_ipc", "pwd", "resource", "syslog", "termios", "tty")
_POSIX_FUNCTIONS = ("chown", "fork", "getegid", "geteuid", "getgid", "getpgid", "getuid", "mkfifo", "setsid", "uname")


def _locking(descriptor: int, mode: int, count: int) -> None:
    """As Microsoft documents `_locking`: bytes from the place in the file, past its end too; EACCES where taken."""
    assert mode == msvcrt.LK_NBLCK  # type: ignore[attr-defined]
    start = os.lseek(descriptor, 0, os.SEEK_CUR)
    request = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, start, count, 0)
    try:
        fcntl.fcntl(descriptor, fcntl.F_OFD_SETLK, request)
    except OSError as error:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from error


msvcrt = ModuleType("msvcrt")
msvcrt.LK_NBLCK, msvcrt.locking = 2, _locking  # type: ignore[attr-defined]

for _name in _POSIX_MODULES:
    sys.modules[_name] = None  # type: ignore[assignment]
for _name in _POSIX_FUNCTIONS:
    delattr(os, _name)
sys.modules["msvcrt"] = msvcrt
