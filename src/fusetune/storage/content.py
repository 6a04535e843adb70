"""What a file holds, as one figure: its content is its identity, whatever its name and its time stamps."""

from __future__ import annotations

import hashlib
import json
import os
import time
from pathlib import Path

from fusetune.storage.files import atomic_path

SETTLED_NS = 3_000_000_000
"""A file that changed less than this before it was read may change again within one tick of its time stamps.

The coarsest file system in use (FAT) stamps every 2 s.
"""

_Stamp = tuple[int, int, int, int, int]


class ContentDigests:
    """SHA-256 of files; each is read once by a process, and never again while it stays as it is.

    Parameters
    ----------
    cache
        File of what earlier processes read; a missing or unreadable one counts as empty, for it only ever saves time.
    """

    def __init__(self, cache: str | os.PathLike[str]) -> None:
        self._cache = Path(cache)
        self._known = _read(self._cache)
        self._digests: dict[str, str] = {}
        self._stamps: dict[str, _Stamp | None] = {}
        self._settled: dict[str, tuple[_Stamp, str]] = {}

    def of(self, path: str | os.PathLike[str]) -> str:
        """SHA-256 of a file, hexadecimal, as it was when this process first asked.

        A file that cannot be read has the error's text instead, so that it differs from what it is once it can be.
        """
        name = os.path.abspath(path)
        if name not in self._digests:
            self._digests[name] = self._digest(name)
        return self._digests[name]

    def changed(self) -> list[str]:
        """Absolute paths of the files that are no longer as they were when they were asked for."""
        return [name for name, stamp in self._stamps.items() if _stamp_of(name) != stamp]

    def save(self) -> None:
        """Keep for later processes what was asked for, and nothing else."""
        if self._settled != self._known:
            with atomic_path(self._cache) as temporary:
                temporary.write_text(json.dumps(self._settled), encoding="ascii")

    def _digest(self, name: str) -> str:
        begun = time.time_ns()
        self._stamps[name] = _stamp_of(name)
        try:
            with open(name, "rb") as file:
                before = _stamp(os.fstat(file.fileno()))
                stamp, digest = self._known.get(name, (None, ""))
                if stamp != before:
                    digest = hashlib.file_digest(file, "sha256").hexdigest()
                after = _stamp(os.fstat(file.fileno()))
        except OSError as error:
            return f"cannot be read ({error.strerror})"
        _, modified_ns, changed_ns, *_ = before
        if before == after and max(modified_ns, changed_ns) < begun - SETTLED_NS:
            self._settled[name] = (before, digest)
        return digest


def _stamp(status: os.stat_result) -> _Stamp:
    return (status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino, status.st_dev)


def _stamp_of(name: str) -> _Stamp | None:
    try:
        return _stamp(os.stat(name))
    except OSError:
        return None


def _read(cache: Path) -> dict[str, tuple[_Stamp, str]]:
    try:
        document = json.loads(cache.read_text(encoding="ascii"))
        return {name: (tuple(stamp), str(digest)) for name, (stamp, digest) in document.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}
