"""Which logs lie in a folder, and under which names their flights are known.

Every entry that says by its name that it is a log is told of: as a log, or as one that cannot be flown, with the
reason. Hidden entries, whose names begin with a dot, are passed over: other systems leave their own notes there.

The name of a flight is the path of its log below the folder, without the suffix, with `_` between the folders, and
without PX4's own top folder of an SD card, `log`: `log/sess001/log001.ulg` is the flight `sess001_log001`. It follows
from the log's own place, so that a log that is added elsewhere leaves it as it is. Where two logs come to the same
name all the same, the one in fewer folders, then the first by name, keeps it; the others get some digits of the digest
of their path.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from fusetune.errors import UserError
from fusetune.storage.files import DEVICES

_LOG = re.compile(r"\.ulg$", re.IGNORECASE | re.DOTALL)
_PACKED = re.compile(r"\.ulg\.(gz|xz|bz2|zst|lz4|zip|7z)$", re.IGNORECASE | re.DOTALL)

SD_CARD_FOLDER = "log"
TABLE_NAMES = ("flights.parquet", "flights.csv", "checks.csv", "present.json", "delays.json", "legs.parquet")
"""Files that lie beside the folders of flights, of the save and of the analyze room."""
LONGEST_NAME_BYTES = 120
"""File systems end names at 255 bytes; jobs append parts of their own."""

_NO_PART_OF_A_NAME = set("/\\{}<>,")
"""Separators, and what Snakemake takes for an end of a wildcard, of a variable or of a value on a command line."""
_NO_PART_OF_A_NAME_CATEGORIES = {"Cc", "Cf", "Cs", "Zl", "Zp"}
_ONE_LINE_HAS_NO = {"Cc", "Cf", "Zl", "Zp"}

_REMEDY_LINK = "Mend the link or remove it"


@dataclass(frozen=True)
class Log:
    """A log that can be opened."""

    flight: str
    """Name of its flight, unique in the folder, also where file systems do not tell small from capital letters."""
    path: str
    shown: str
    """Path below the folder, as text that can be written and printed."""


@dataclass(frozen=True)
class RefusedEntry:
    """An entry that says by its name that it is a log, and cannot be flown."""

    flight: str
    shown: str
    reason: str
    remedy: str


@dataclass(frozen=True)
class Discovery:
    """What was found, each in the order of the flights' names."""

    logs: tuple[Log, ...]
    refused: tuple[RefusedEntry, ...]


@dataclass(frozen=True)
class _Entry:
    path: str
    parts: tuple[str, ...]
    """Path below the folder."""
    reason: str = ""
    remedy: str = ""


def discover_logs(folder: str | os.PathLike[str]) -> Discovery:
    """Find the logs in a folder and in the folders below it, links followed.

    Raises
    ------
    OSError
        The folder itself cannot be listed.
    """
    os.listdir(folder)
    entries = sorted(_entries(os.fspath(folder)), key=lambda entry: (len(entry.parts), entry.parts))
    names = _unique_names(entries)
    logs, refused = [], []
    for entry, name in zip(entries, names, strict=True):
        shown = printable("/".join(entry.parts))
        if entry.reason:
            refused.append(RefusedEntry(name, shown, entry.reason, entry.remedy))
        else:
            logs.append(Log(name, entry.path, shown))
    return Discovery(
        tuple(sorted(logs, key=lambda log: log.flight)), tuple(sorted(refused, key=lambda entry: entry.flight))
    )


@dataclass(frozen=True)
class GivenLog:
    """A log of a command line, or why there is none.

    Attributes
    ----------
    path : where it is
    shown : as it can be printed
    error : why it cannot be one, else None
    """

    path: str
    shown: str
    error: UserError | None = None


def given_logs(paths: Iterable[str | os.PathLike[str]]) -> Iterator[GivenLog]:
    """Logs, and those in folders among them, which are searched; what is no log is given with its error."""
    for path in (os.fspath(one) for one in paths):
        shown = printable(path)
        if not os.path.isdir(path):
            yield GivenLog(path, shown)
            continue
        try:
            inside = discover_logs(path)
        except OSError as error:
            reason = f"cannot be listed ({error.strerror or error})"
            yield GivenLog(path, shown, UserError(path, reason, "Mend its permissions"))
            continue
        for entry in inside.refused:
            name = printable(os.path.join(path, entry.shown))
            yield GivenLog(name, name, UserError(name, entry.reason, entry.remedy))
        for log in inside.logs:
            yield GivenLog(log.path, printable(os.path.join(path, log.shown)))
        if not inside.refused and not inside.logs:
            yield GivenLog(path, shown, UserError(shown, "holds no log", "Name a folder with .ulg files in it"))


def log_error(shown: str, error: Exception) -> UserError:
    """What to tell of a log that the system does not give, or that lacks what every log has."""
    if isinstance(error, OSError):
        reason = f"cannot be read ({error.strerror or error})"
        return UserError(shown, reason, "Mend its permissions, or copy it again")
    reason = f"holds topics that lack fields every release has ({type(error).__name__}: {error})"
    return UserError(shown, reason, "Copy the log from the vehicle again")


def printable(text: str) -> str:
    r"""A name as it can be written as UTF-8 into one line: what cannot is escaped, as in `\x0a` and `\xff`."""
    escaped = "".join(
        f"\\x{ord(character):02x}" if unicodedata.category(character) in _ONE_LINE_HAS_NO else character
        for character in text
    )
    return escaped.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def _entries(folder: str) -> Iterator[_Entry]:
    """All entries that are told of. Each folder is listed once; links come last, so that none renames a log."""
    seen: set[tuple[int, int]] = set()
    waiting: list[tuple[str, tuple[str, ...]]] = [(folder, ())]
    linked: list[tuple[str, tuple[str, ...]]] = []
    while waiting or linked:
        place, parts = (waiting or linked).pop(0)
        try:
            status = os.stat(place)
            if (status.st_dev, status.st_ino) in seen:
                continue
            seen.add((status.st_dev, status.st_ino))
            listed = sorted(os.scandir(place), key=lambda entry: entry.name)
        except OSError as error:
            reason = f"is a folder that cannot be opened ({error.strerror})"
            yield _Entry(place, parts, reason, "Mend its permissions or remove it")
            continue
        for entry in listed:
            if entry.name.startswith("."):
                continue
            below = (*parts, entry.name)
            if os.path.isdir(entry.path):
                (linked if entry.is_symlink() else waiting).append((entry.path, below))
            if _LOG.search(entry.name) or _PACKED.search(entry.name):
                yield _judged(_Entry(entry.path, below))


def _judged(entry: _Entry) -> _Entry:
    reason, remedy = _trouble(entry.path)
    return replace(entry, reason=reason, remedy=remedy)


def _trouble(path: str) -> tuple[str, str]:
    """Why an entry cannot be flown, and what to do about it; two empty texts for a log that can be opened."""
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return f"is a link to nothing ({printable(_target(path))})", _REMEDY_LINK
    except OSError as error:
        if os.path.islink(path):
            return f"is a link that leads nowhere ({error.strerror})", _REMEDY_LINK
        return f"cannot be opened ({error.strerror})", "Mend its permissions or remove it"
    if stat.S_ISDIR(mode):
        return "is a folder, not a log; logs in it have lines of their own", "Rename the folder or remove it"
    if not stat.S_ISREG(mode):
        return "is no file that can be read from begin to end (a pipe, a socket or a device)", "Remove it"
    if _PACKED.search(path):
        return "is compressed", "Unpack it (gunzip, unzip …)"
    try:
        os.close(os.open(path, os.O_RDONLY))
    except OSError as error:
        return f"cannot be opened ({error.strerror})", "Mend its permissions or remove it"
    return "", ""


def _target(link: str) -> str:
    try:
        return os.readlink(link)
    except OSError:
        return "removed meanwhile"


def _unique_names(entries: Iterable[_Entry]) -> list[str]:
    """Names of the flights of entries, which come in the order in which names are given."""
    taken = {_folded(name) for name in TABLE_NAMES}
    names = []
    for entry in entries:
        name, digest = _name(entry.parts), _digest(entry.parts)
        for unique in (name, *(f"{name}_{digest[:digits]}" for digits in range(6, len(digest) + 1, 6))):
            if _folded(unique) not in taken:
                break
        taken.add(_folded(unique))
        names.append(unique)
    return names


def _name(parts: tuple[str, ...]) -> str:
    *folders, last = parts
    if folders and folders[0].casefold() == SD_CARD_FOLDER:
        folders = folders[1:]
    text = "_".join([*folders, _LOG.sub("", last)])
    allowed = "".join(
        "_"
        if character in _NO_PART_OF_A_NAME or unicodedata.category(character) in _NO_PART_OF_A_NAME_CATEGORIES
        else character
        for character in unicodedata.normalize("NFC", text)
    )
    # Windows, and many who write lists by hand, lose what stands at the ends
    name = allowed.strip().rstrip(". ") or "_"
    if name.partition(".")[0].strip().casefold() in DEVICES:
        name = f"{name}_" if "." not in name else name.replace(".", "_.", 1)
    if len(name.encode()) > LONGEST_NAME_BYTES:
        name = f"{name.encode()[:LONGEST_NAME_BYTES].decode(errors='ignore')}_{_digest(parts)[:6]}"
    return name


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name.casefold())


def _digest(parts: tuple[str, ...]) -> str:
    return hashlib.sha256(os.fsencode("/".join(parts))).hexdigest()
