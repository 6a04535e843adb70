"""A file of lines that is only ever added to, each line bound to the one before it by a checksum.

A line is a JSON object whose last entry is the SHA-256 of all before it, `previous` among that: the checksum of the
line before. So a line that was changed, put in or taken out shows; only that the last ones were taken away does not. A
process that is killed while it writes leaves the beginning of a line: who adds the next one ends it, and readers pass
it over.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.errors import UserError
from fusetune.storage.file_lock import LocksUnavailableError, lock
from fusetune.storage.files import AnyPath
from fusetune.storage.ledger import key_of

_SEAL, _END = b', "checksum": "', b'"}'
_SEALED_BYTES = len(_SEAL) + 2 * hashlib.sha256().digest_size + len(_END)
_REMEDY = "Put a copy of the file back, or move it away: then a new one begins"


@dataclass(frozen=True)
class Line:
    """One line.

    Attributes
    ----------
    key : digest of its content, the same whenever the same is written
    content : what was written, without what binds it
    checksum : of the line, which the next one names
    """

    key: str
    content: Mapping[str, Any]
    checksum: str


def read_lines(path: AnyPath) -> list[Line]:
    """All lines of a file; none where there is no file.

    Raises
    ------
    UserError
        The file cannot be read, or a line is not what was written.
    """
    try:
        parts = Path(path).read_bytes().split(b"\n")
    except FileNotFoundError:
        return []
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror}", "Mend its permissions") from error
    found: list[Line] = []
    for number, part in enumerate(parts, start=1):
        if not part.endswith(_END):
            # nothing, or the beginning of a line
            continue
        line = _line(part, found[-1].checksum if found else "")
        if line is None:
            raise UserError(
                path, f"line {number} is not what was written there, or does not follow the one before", _REMEDY
            )
        found.append(line)
    return found


def append(path: AnyPath, content: Mapping[str, Any], beside: Mapping[str, Any] | None = None) -> bool:
    """Add a line, unless one says the same already; it is on the disk when this returns.

    Parameters
    ----------
    content : by which lines are told apart
    beside : what is kept with it and does not count for that, such as when it was written

    Returns
    -------
    Whether a line was added.

    Raises
    ------
    UserError
        As of `read_lines`: nothing is added to a damaged file.
    """
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    key = key_of(content)
    with open(file, "ab+") as handle:
        with suppress(LocksUnavailableError):
            lock(handle, exclusive=True, wait=True)
        lines = read_lines(file)
        if any(line.key == key for line in lines):
            return False
        record = {"key": key, **content, **(beside or {}), "previous": lines[-1].checksum if lines else ""}
        # one write, of which a kill leaves the beginning
        handle.write((b"\n" if _is_torn(file) else b"") + _sealed(record) + b"\n")
        handle.flush()
        os.fsync(handle.fileno())
    return True


def _sealed(record: Mapping[str, Any]) -> bytes:
    text = json.dumps(record, ensure_ascii=True, allow_nan=False).encode()[:-1]
    return text + _SEAL + hashlib.sha256(text).hexdigest().encode() + _END


def _line(part: bytes, previous: str) -> Line | None:
    """What a whole line says; None where it is not what was written behind the line before."""
    text, seal = part[:-_SEALED_BYTES], part[-_SEALED_BYTES:]
    checksum = hashlib.sha256(text).hexdigest()
    if seal != _SEAL + checksum.encode() + _END:
        return None
    record = json.loads(text + b"}")
    if record.pop("previous") != previous:
        return None
    return Line(record.pop("key"), record, checksum)


def _is_torn(file: Path) -> bool:
    content = file.read_bytes()
    return bool(content) and not content.endswith(b"\n")
