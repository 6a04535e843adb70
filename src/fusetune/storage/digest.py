"""One figure for the sources of a part of the package, so that changed code re-runs what depends on it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

_PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
_NOT_SOURCES = {".pyc", ".pyo", ".nbi", ".nbc"}


def source_digest(*parts: str) -> str:
    """SHA-256 over the names and bytes of the source files of some parts of the package.

    Parameters
    ----------
    parts
        Folders or files relative to the package (``"px4"``, ``"ekf2"``, ``"save/verdict.py"``); their order does not
        matter. Data files that ship with a part (CSV, schemas, styles) count as sources; compiled caches do not.

    Raises
    ------
    FileNotFoundError
        A part does not exist.
    """
    return source_digests({"these": parts})["these"]


def source_digests(kinds: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """`source_digest` of several lists of parts; each file is read once."""
    files = {part: _source_files(part) for part in {part for parts in kinds.values() for part in parts}}
    read = {file: _named(file) for file in {file for of_part in files.values() for file in of_part}}
    digests = {}
    for kind, parts in kinds.items():
        digest = hashlib.sha256()
        for file in sorted({file for part in parts for file in files[part]}):
            digest.update(read[file])
        digests[kind] = digest.hexdigest()
    return digests


def _named(file: Path) -> bytes:
    name, content = file.relative_to(_PACKAGE_FOLDER).as_posix(), file.read_bytes()
    return f"{name}\0{len(content)}\0".encode() + content


def _source_files(part: str) -> list[Path]:
    path = _PACKAGE_FOLDER / part
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise FileNotFoundError(f"the package has no part {part!r}")
    return [
        file
        for file in path.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and file.suffix not in _NOT_SOURCES
    ]
