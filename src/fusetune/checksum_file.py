"""A checksum beside a file that has no place for one: `<file>.sha256`, as `sha256sum` writes and checks it.

Only the checksum counts, not the name that follows it: people make such files from other folders, too.
"""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

from fusetune.errors import UserError
from fusetune.files import atomic_path

_CHECKSUM = re.compile(rb"[0-9a-fA-F]{64}(?![0-9a-fA-F])")


def checksum_file(path: str | os.PathLike[str]) -> Path:
    """Where the checksum of a file stands."""
    return Path(f"{os.fspath(path)}.sha256")


def write_checksum(path: str | os.PathLike[str]) -> None:
    """Write the checksum of a file beside it."""
    with atomic_path(checksum_file(path)) as temporary:
        temporary.write_bytes(_checksum(path) + b"  " + os.fsencode(Path(path).name) + b"\n")


def has_checksum(path: str | os.PathLike[str]) -> bool:
    """Whether a checksum stands beside a file; what else people keep under such a name is none."""
    try:
        return _CHECKSUM.match(checksum_file(path).read_bytes()) is not None
    except OSError:
        return False


def check_checksum(path: str | os.PathLike[str], remedy: str) -> None:
    """Compare a file with the checksum beside it.

    Raises
    ------
    UserError
        The file or its checksum cannot be read, or they disagree.
    """
    beside = checksum_file(path)
    try:
        found = _CHECKSUM.match(beside.read_bytes())
        agrees = found is not None and found[0].lower() == _checksum(path)
    except OSError as error:
        raise UserError(path, f"cannot be read together with {beside.name}: {error.strerror}", remedy) from error
    if not agrees:
        raise UserError(path, f"is damaged: it is not the file of {beside.name}", remedy)


def _checksum(path: str | os.PathLike[str]) -> bytes:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest().encode()
