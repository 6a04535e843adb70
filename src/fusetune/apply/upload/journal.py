"""What an upload was about to do and has done: one line after the other, each on the disk before the next step.

A line is JSON and ends with the beginning of a SHA-256 over it and over that of the line before, so that a line that is
changed or gone shows. The last one may be torn, when the machine stopped while it was written: what it would have told
is then not known, and is read from the vehicle.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, Literal

from fusetune.apply.upload.backup import sync_folder
from fusetune.apply.upload.values import Type, Value
from fusetune.errors import UserError
from fusetune.storage.file_lock import LocksUnavailableError, lock
from fusetune.storage.files import AnyPath

JOURNAL, BACKUP, TRANSCRIPT = "journal.jsonl", "backup.params", "transcript.txt"
Goal = Literal["new", "old"]
_SEAL_DIGITS = 16
_FROM_BACKUP = "Move the folder away, and roll back by its backup.params, copied to another folder"


@dataclass(frozen=True)
class Change:
    """A parameter with the value that it had and the one that it is to have."""

    name: str
    old: Value
    new: Value
    reboot: bool = False

    def value(self, goal: Goal) -> Value:
        """The one or the other."""
        return self.new if goal == "new" else self.old


@dataclass
class Record:
    """What a journal tells.

    Attributes
    ----------
    purpose : "upload" or "rollback", for the words
    uuid, release, system : of the vehicle
    sent : parameters to which something was written, in order
    goal : whither it was under way when the journal ends: to all new values, or back to the old ones
    why_back : why it went back
    ended : how: "new" or "old"; empty while it has not
    """

    purpose: str
    file: str
    uuid: str
    release: str
    system: int
    changes: tuple[Change, ...]
    sent: list[str] = field(default_factory=list)
    goal: Goal = "new"
    why_back: str = ""
    ended: str = ""


class NothingPlanned(UserError):
    """A journal that was begun, and nothing more."""


class Journal:
    """The journal of one upload, held for this process alone.

    Raises
    ------
    UserError
        Another process holds it.
    """

    def __init__(self, folder: AnyPath) -> None:
        folder = Path(folder)
        self._path = folder / JOURNAL
        self._file: IO[bytes] = open(self._path, "ab+")  # noqa: SIM115
        try:
            if not lock(self._file, exclusive=True, wait=False):
                self._file.close()
                raise UserError(folder, "is in use by another upload", "Wait until that has ended")
        except LocksUnavailableError:
            pass  # on such a file system nobody can be kept out
        self._seal = _cut_torn_line(self._file, self._path)
        sync_folder(folder)

    def begin(self, record: Record) -> None:
        """Write down what is to be done."""
        changes = [
            {
                "name": one.name,
                "type": one.new.type,
                "old": f"{one.old.bits:08x}",
                "new": f"{one.new.bits:08x}",
                "reboot": one.reboot,
            }
            for one in record.changes
        ]
        who = {"uuid": record.uuid, "release": record.release, "system": record.system}
        self.write("planned", purpose=record.purpose, file=record.file, **who, changes=changes)

    def write(self, event: str, **details: Any) -> None:
        """Append a line; when this returns, it is on the disk."""
        when = datetime.now(UTC).isoformat(timespec="milliseconds")
        text = json.dumps({"event": event, "utc": when, **details}, ensure_ascii=True)
        self._seal = _seal(self._seal, text)
        self._file.write(f"{text}\t{self._seal}\n".encode())
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Let it go."""
        self._file.close()


def read_journal(folder: AnyPath) -> Record:
    """What the journal of a folder tells.

    Raises
    ------
    UserError
        There is none, it is damaged, or it ends before anything was planned.
    """
    folder = Path(folder)
    path = folder / JOURNAL
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(
            path, f"cannot be read ({error.strerror})", "Name the folder of an upload with --folder"
        ) from None
    entries, _, _ = _entries(content, path)
    if not entries or entries[0].get("event") != "planned":
        raise NothingPlanned(path, "ends before anything was written to the vehicle", "Upload anew")
    try:
        record = _record(entries[0])
        for entry in entries[1:]:
            _follow(record, entry)
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(path, f"does not tell what was done ({error})", _FROM_BACKUP) from error
    return record


def _record(entry: Mapping[str, Any]) -> Record:
    changes = tuple(
        Change(
            one["name"],
            Value(_type(one["type"]), int(one["old"], 16)),
            Value(_type(one["type"]), int(one["new"], 16)),
            one["reboot"],
        )
        for one in entry["changes"]
    )
    return Record(entry["purpose"], entry["file"], entry["uuid"], entry["release"], entry["system"], changes)


def _follow(record: Record, entry: Mapping[str, Any]) -> None:
    if entry["event"] == "sending" and entry["name"] not in record.sent:
        record.sent.append(entry["name"])
    elif entry["event"] == "going back":
        record.goal, record.why_back = "old", entry["why"]
    elif entry["event"] == "ended":
        record.ended = entry["with"]


def _type(text: str) -> Type:
    if text not in ("INT32", "FLOAT"):
        raise ValueError(f"type {text}")
    return "INT32" if text == "INT32" else "FLOAT"


def _seal(before: str, text: str) -> str:
    return hashlib.sha256(f"{before}{text}".encode()).hexdigest()[:_SEAL_DIGITS]


def _entries(content: bytes, path: Path) -> tuple[Sequence[Mapping[str, Any]], str, int]:
    """Entries of a journal, the last seal, and how many bytes they fill; what follows is a torn line."""
    entries, seal, whole = [], "", 0
    lines = content.splitlines(keepends=True)
    for number, line in enumerate(lines, start=1):
        text, _, told = line.decode("ascii", errors="replace").rstrip("\n").rpartition("\t")
        if not line.endswith(b"\n") or told != _seal(seal, text):
            if number == len(lines):
                break
            raise UserError(path, f"is damaged at line {number}", _FROM_BACKUP)
        seal, whole = told, whole + len(line)
        entries.append(json.loads(text))
    return entries, seal, whole


def _cut_torn_line(file: IO[bytes], path: Path) -> str:
    file.seek(0)
    content = file.read()
    _, seal, whole = _entries(content, path)
    if whole < len(content):
        file.truncate(whole)
    file.seek(0, os.SEEK_END)
    return seal
