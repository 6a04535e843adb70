"""Text in the repository that is made from the code: it is compared, and renewed by `pytest --update`.

A made block stands between two lines of a file that name it, in whatever the file has for comments::

    <!-- made:imports, renewed by pytest --update -->
    ...
    <!-- /made:imports -->
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable
from pathlib import Path

from fusetune.storage.files import atomic_path

UpToDate = Callable[[Path, str | None, str], None]
"""What the fixture `up_to_date` gives: file, name of the block (None for the whole file), what should stand there."""


class OutOfDateError(AssertionError):
    """A file does not hold what the code says; the message shows the difference and how to renew it."""


def compare(file: Path, block: str | None, text: str, command: str, update: bool) -> None:
    """Compare a block of a file with what it should hold.

    Parameters
    ----------
    file
        In UTF-8.
    block
        Name between whose two lines the block stands; None for the whole file.
    text
        What should stand there; one newline at its end is added where there is none.
    command
        Renews it; told where the file is out of date.
    update
        Write the text instead of raising.

    Raises
    ------
    OutOfDateError
        Something else stands there.
    ValueError
        The file does not have each of the two lines once, in their order.
    """
    whole = file.read_text(encoding="utf-8") if block is not None or file.exists() else ""
    start, end = (0, len(whole)) if block is None else _place(file, whole, block)
    wanted, found = text.removesuffix("\n") + "\n", whole[start:end]
    if found == wanted:
        return
    if update:
        with atomic_path(file) as temporary:
            temporary.write_text(whole[:start] + wanted + whole[end:], encoding="utf-8", newline="\n")
        return
    lines = difflib.unified_diff(found.splitlines(), wanted.splitlines(), "in the file", "from the code", lineterm="")
    what = file.name if block is None else f"{block!r} in {file.name}"
    raise OutOfDateError("\n".join([f"{what} is out of date; renew it with", f"  {command}", *lines]))


def _place(file: Path, whole: str, block: str) -> tuple[int, int]:
    """Where in the text of a file the content of a block begins and ends."""
    name = re.escape(block)
    begins = list(re.finditer(rf"^.*(?<!/)\bmade:{name}(?![\w-]).*\n", whole, re.MULTILINE))
    ends = list(re.finditer(rf"^.*/made:{name}(?![\w-]).*$", whole, re.MULTILINE))
    if len(begins) != 1 or len(ends) != 1 or begins[0].end() > ends[0].start():
        raise ValueError(f"{file} needs one line with 'made:{block}' and, below it, one with '/made:{block}'")
    return begins[0].end(), ends[0].start()
