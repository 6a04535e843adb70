"""The folder of a search: new, empty, or marked as that of one."""

from __future__ import annotations

from pathlib import Path

from fusetune.errors import UserError
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path

_MARK = ".search.json"


def demand_search_folder(path: AnyPath) -> None:
    """See that a folder is new, empty, or of a search, and mark it as that.

    Raises
    ------
    UserError
        It holds other files, which the search would mix with its own or overwrite.
    """
    folder = Path(path)
    mark = folder / _MARK
    if folder.exists() and not folder.is_dir():
        raise UserError(folder, "is a file, and the search needs a folder", "Name another folder (--out)")
    if not mark.exists():
        found = [one.name for one in folder.iterdir()] if folder.is_dir() else []
        # hidden files: a mark that was being written, what file managers leave
        other = min((name for name in found if not name.startswith(".")), default=None)
        if other is not None:
            raise UserError(
                folder,
                f"holds files that are no search's ({other})",
                "Name a new or an empty folder, or that of a search which was stopped (--out)",
            )
        with atomic_path(mark) as temporary:
            write_document(temporary, {"holds": "a search of parameters, which goes on from what is kept here"})
