"""A checksum beside a file that has no place for one: `<file>.sha256`, as `sha256sum` writes and checks it."""

from __future__ import annotations

import os
from pathlib import Path

from fusetune.errors import UserError
from fusetune.storage.files import atomic_path, sha256_of


def checksum_file(path: str | os.PathLike[str]) -> Path:
    """Where the checksum of a file stands."""
    return Path(f"{os.fspath(path)}.sha256")


def write_checksum(path: str | os.PathLike[str]) -> None:
    """Write the checksum of a file beside it."""
    with atomic_path(checksum_file(path)) as temporary:
        temporary.write_bytes(_line(Path(path)))


def check_checksum(path: str | os.PathLike[str], remedy: str) -> None:
    """Compare a file with the checksum beside it.

    Raises
    ------
    UserError
        The file or its checksum cannot be read, or they disagree.
    """
    beside = checksum_file(path)
    try:
        agrees = beside.read_bytes() == _line(Path(path))
    except OSError as error:
        raise UserError(path, f"cannot be read together with {beside.name}: {error.strerror}", remedy) from error
    if not agrees:
        raise UserError(path, f"is damaged: it is not the file of {beside.name}", remedy)


def _line(path: Path) -> bytes:
    return f"{sha256_of(path)}  ".encode() + os.fsencode(path.name) + b"\n"
