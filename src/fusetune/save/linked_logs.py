"""Logs that are named on a command line, brought into the folder of flights by links: where they lie they stay."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from fusetune.errors import UserError
from fusetune.save.discovery import discover_logs, given_logs, printable
from fusetune.storage.files import AnyPath

_SUFFIX = ".ulg"


@dataclass(frozen=True)
class LinkedLogs:
    """What became of the logs.

    Attributes
    ----------
    linked : links that are new
    there : logs and folders that lay in the folder of flights, or were linked before
    others : flights in the folder that were not named, and count as well
    """

    linked: int
    there: int
    others: int


def link_logs(paths: Sequence[AnyPath], flights: AnyPath) -> LinkedLogs:
    """Link logs, and folders of logs, into the folder of flights, which is made where there is none.

    A link has the name of its log; where that is taken, the name of the log's folder before it, or some digits of the
    digest of its path behind it, so that the same log has the same name in every run.

    Raises
    ------
    UserError
        Something named is no log and no folder with logs, or links cannot be made; then nothing is linked.
    """
    folder = Path(flights)
    asked = [Path(os.path.abspath(path)) for path in paths]
    for path in asked:
        _demand_logs(path)
    folder.mkdir(parents=True, exist_ok=True)
    new = [path for path in dict.fromkeys(asked) if not _is_there(path, folder)]
    for path in new:
        _link(path, folder)
    wanted = [os.path.realpath(path) for path in asked]
    others = sum(not _is_within(os.path.realpath(log.path), wanted) for log in discover_logs(folder).logs)
    return LinkedLogs(len(new), len(dict.fromkeys(asked)) - len(new), others)


def _demand_logs(path: Path) -> None:
    if not path.exists():
        raise UserError(printable(str(path)), "does not exist", "Mend the name")
    if path.is_dir():
        # what of several cannot be flown is told with its reason beside the others
        errors = [log.error for log in given_logs([path])]
        if all(errors) and errors[0] is not None:
            raise errors[0]


def _is_there(path: Path, folder: Path) -> bool:
    """Whether it lies in the folder, or a link of it leads there."""
    target = os.path.realpath(path)
    if _is_within(target, [os.path.realpath(folder)]) or _is_within(str(path), [os.path.abspath(folder)]):
        return True
    return any(entry.is_symlink() and os.path.realpath(entry.path) == target for entry in os.scandir(folder))


def _is_within(path: str, folders: Sequence[str]) -> bool:
    return any(path == one or path.startswith(one.rstrip(os.sep) + os.sep) for one in folders)


def _link(path: Path, folder: Path) -> None:
    for name in _names(path):
        try:
            os.symlink(path, folder / name, target_is_directory=path.is_dir())
            return
        except FileExistsError:
            continue
        except (OSError, NotImplementedError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            raise UserError(folder, f"takes no link to {path} ({why})", f"Copy the logs into {folder}") from error
    raise UserError(folder / path.name, "is taken", f"Copy {path} into {folder} under another name")


def _names(path: Path) -> Iterator[str]:
    stem, suffix = (path.name, "") if path.is_dir() else (path.stem, path.suffix)
    if not path.is_dir() and ".ulg" not in path.name.casefold():
        # it was named as a log, so it is told of as one
        stem, suffix = path.name, _SUFFIX
    yield f"{stem}{suffix}"
    if path.parent.name:
        yield f"{path.parent.name}_{stem}{suffix}"
    yield f"{stem}_{sha256(os.fsencode(path)).hexdigest()[:8]}{suffix}"
