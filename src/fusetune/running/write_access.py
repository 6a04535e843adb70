"""Who may change what this process is going to run.

Others are all but this process's user, root, and those who may write a folder of code that is run anyway (`like`
below): its owner, and, where its mode says so, its group or everybody. Windows keeps that in lists that the mode does
not show: there everything passes.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

from fusetune.errors import UserError
from fusetune.storage.files import AnyPath


def others_may_write(path: AnyPath, like: AnyPath) -> bool:
    """Whether others may change a file, or put something into a folder; False where it does not exist."""
    try:
        state, trusted = os.stat(path), os.stat(like)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return state.st_uid not in (0, _this_user(), trusted.st_uid) or bool(_excess(state, trusted))


def others_may_write_below(top: AnyPath, folder: AnyPath, like: AnyPath) -> bool:
    """Whether others may change anything on the way from `top` to `folder`, both included, or anything in `folder`."""
    return any(others_may_write(path, like) for path in (*_way(Path(top), Path(folder)), *_content(Path(folder))))


def take_write_access(top: AnyPath, folder: AnyPath, like: AnyPath) -> None:
    """Make the way from `top` to `folder`, both included, such that others may not write there.

    Raises
    ------
    UserError
        Something on the way belongs to somebody else.
    """
    for path in _way(Path(top), Path(folder)):
        path.mkdir(mode=0o755, parents=True, exist_ok=True)
        state = path.stat()
        if state.st_uid in (_this_user(), 0):
            path.chmod(stat.S_IMODE(state.st_mode) & ~_excess(state, os.stat(like)))
        if others_may_write(path, like):
            raise UserError(
                path,
                "another user may write to it, and could put any program in the place of the compiled estimator",
                "Delete it, or make it yours alone (chown, chmod), and start again",
            )


def _this_user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _excess(state: os.stat_result, trusted: os.stat_result) -> int:
    """The rights to write that a file's mode grants and that of the trusted folder does not."""
    granted = trusted.st_mode & stat.S_IWOTH
    if state.st_gid == trusted.st_gid:
        granted |= trusted.st_mode & stat.S_IWGRP
    return state.st_mode & (stat.S_IWGRP | stat.S_IWOTH) & ~granted


def _way(top: Path, folder: Path) -> list[Path]:
    return [path for path in reversed((folder, *folder.parents)) if path.is_relative_to(top)]


def _content(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        yield from (Path(parent) / name for name in (*folders, *files))
