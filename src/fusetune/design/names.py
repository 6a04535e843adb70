"""Names that people give, and that become names of files."""

from __future__ import annotations

from fusetune.storage.files import DEVICES

NAME_PATTERN = "^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"


def name_problem(name: str) -> str | None:
    """Why a name of letters, digits, ``_`` and ``-`` cannot be that of a file; `None` where it can."""
    if name.casefold() in DEVICES:
        return f"{name!r} is a device to Windows; expected another name"
    return None


def one_line(text: str) -> str:
    """A description as one line: comments of parameter files and cells of tables hold no more."""
    return " ".join("".join(mark if mark.isprintable() else " " for mark in text).split())
