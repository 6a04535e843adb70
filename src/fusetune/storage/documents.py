"""JSON files that show when a byte of them has changed.

The last entry of each, `digest`, is the SHA-256 of all the bytes before it. The files stay plain JSON: readable, and
the same for the same content.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from fusetune.errors import RUN_AGAIN, UserError
from fusetune.storage.indented_json import indented

Built = TypeVar("Built")

_DIGEST = "digest"
_BEFORE, _AFTER = b',\n "digest": "', b'"\n}\n'
_SEAL_BYTES = len(_BEFORE) + 2 * hashlib.sha256().digest_size + len(_AFTER)


def write_document(
    path: str | os.PathLike[str],
    document: Mapping[str, Any],
    *,
    lines: int = 0,
    sort_keys: bool = False,
    allow_nan: bool = True,
) -> None:
    """Write a mapping, which must not be empty, as a JSON file with its digest.

    Parameters
    ----------
    lines
        One line per entry instead of indentation, at which the encoder is slow; 2 for the entries of entries as well.
    sort_keys, allow_nan
        As for `json.dumps`.
    """
    if not document or _DIGEST in document:
        raise ValueError(f"a document has entries, and none of them is {_DIGEST!r}")

    def text_of(value: Any, lines: int) -> str:
        if lines and isinstance(value, Mapping) and value:
            entries = sorted(value.items()) if sort_keys else value.items()
            return (
                "{\n" + ",\n".join(f"{json.dumps(str(key))}: {text_of(one, lines - 1)}" for key, one in entries) + "\n}"
            )
        return json.dumps(value, sort_keys=sort_keys, ensure_ascii=False, allow_nan=allow_nan)

    text = text_of(document, lines) if lines else indented(document, sort_keys=sort_keys, allow_nan=allow_nan)
    text = text.removesuffix("\n}")
    # a name that is no text, as of a file of another encoding, becomes the escape that JSON has for it
    content = text.encode("utf-8", errors="backslashreplace")
    Path(path).write_bytes(content + _seal_of(content))


def read_document(path: str | os.PathLike[str], *, remedy: str = RUN_AGAIN, sealed: bool = True) -> dict[str, Any]:
    """Read a JSON file that holds a mapping; its digest is checked and left out.

    Parameters
    ----------
    remedy
        What the user can do about a damaged file.
    sealed
        Whether the file must carry its digest, as all that `write_document` wrote do.

    Raises
    ------
    UserError
        The file does not exist, holds no mapping, or a byte of it has changed since it was written.
    """
    try:
        content = Path(path).read_bytes()
        is_sealed = content[-_SEAL_BYTES:].startswith(_BEFORE)
        if is_sealed and content[-_SEAL_BYTES:] != _seal_of(content[:-_SEAL_BYTES]):
            raise UserError(path, "is damaged: its bytes are no longer those that were written", remedy)
        if sealed and not is_sealed:
            raise UserError(path, "is cut or damaged: it does not end with the digest it was written with", remedy)
        document = json.loads(content)
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror}", remedy) from error
    except (ValueError, RecursionError) as error:
        raise UserError(path, f"is no readable JSON ({error})", remedy) from error
    if not isinstance(document, dict):
        raise UserError(path, "is no JSON mapping", remedy)
    document.pop(_DIGEST, None)
    return document


def read_as(path: str | os.PathLike[str], build: Callable[[dict[str, Any]], Built], what: str) -> Built:
    """Build something of a JSON file that `write_document` wrote.

    Parameters
    ----------
    build
        Makes it of the mapping; a key that it misses, or does not expect, means that the file holds something else.
    what
        Of which the file tells, for the message.

    Raises
    ------
    UserError
        As of `read_document`, or the file holds something else.
    """
    document = read_document(path)
    try:
        return build(document)
    except (TypeError, KeyError) as error:
        raise UserError(path, f"does not say {what} ({error})", RUN_AGAIN) from error


def _seal_of(content: bytes) -> bytes:
    return _BEFORE + hashlib.sha256(content).hexdigest().encode() + _AFTER
