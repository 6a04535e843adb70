"""What was made from what: lets a job that makes several files make only those that are missing or out of date.

A job that handles many parameter sets spares the start of a process for each. The ledger in the folder of its outputs
says, per set, from which inputs its files were made (a key) and what these files held (a digest, for Snakemake renews
the time stamp of every output of a job). A set whose key and files are the same needs no second computation.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fusetune.storage.files import atomic_path


def key_of(inputs: Any) -> str:
    """Digest anything that JSON can hold, independent of the order of mappings."""
    text = json.dumps(inputs, sort_keys=True, ensure_ascii=False, allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _digests(files: Iterable[str | os.PathLike[str]]) -> dict[str, str]:
    digests = {}
    for file in files:
        with open(file, "rb") as content:
            digests[Path(file).name] = hashlib.file_digest(content, "blake2b").hexdigest()
    return digests


class Ledger:
    """The record of one folder.

    Parameters
    ----------
    path
        File of the record; a missing or unreadable one counts as empty, for it only ever saves work.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.entries: dict[str, dict[str, Any]] = {}
        try:
            entries = json.loads(self.path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return
        if isinstance(entries, dict):
            self.entries = {name: entry for name, entry in entries.items() if isinstance(entry, dict)}

    def is_current(self, name: str, key: str, files: Iterable[str | os.PathLike[str]]) -> bool:
        """Whether the files of an entry stand as they were made, from the inputs that the key digests."""
        entry = self.entries.get(name)
        if entry is None or entry.get("key") != key:
            return False
        try:
            return _digests(files) == entry.get("files")
        except OSError:
            return False

    def record(self, name: str, key: str, files: Iterable[str | os.PathLike[str]]) -> None:
        """Enter files that have just been made, and save the record."""
        self.record_all({name: (key, files)})

    def record_all(self, made: Mapping[str, tuple[str, Iterable[str | os.PathLike[str]]]]) -> None:
        """Enter several, each with its key and files, and save the record; nothing where there are none."""
        if not made:
            return
        for name, (key, files) in made.items():
            self.entries[name] = {"key": key, "files": _digests(files)}
        with atomic_path(self.path) as temporary:
            temporary.write_text(json.dumps(self.entries, indent=1, sort_keys=True), encoding="utf-8")
