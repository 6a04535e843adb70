"""Cells of a CSV file that a spreadsheet shows and does not run.

Spreadsheets take a cell that begins with ``=``, ``+``, ``-`` or ``@`` for a formula, tab and carriage return before it
notwithstanding (https://owasp.org/www-community/attacks/CSV_Injection), and names of files or of hardware come from
elsewhere. Such cells get an apostrophe in front, which spreadsheets do not show. Some split the cells of a file by
other separators than it has, so the same is done behind separators, quotes and line breaks within a cell.
"""

from __future__ import annotations

import re

_BEGIN = '(?:^|(?<=[;,|"\t\r\n]))'
_FORMULA = re.compile(_BEGIN + "(?=[=+\\-@\uff1d\uff0b\uff0d\uff20\t\r'])")
_MARK = re.compile(_BEGIN + "'")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def harmless(text: str) -> str:
    """A text that no spreadsheet takes for a formula; numbers stay as they are."""
    return text if _NUMBER.fullmatch(text) else _FORMULA.sub("'", text)


def as_it_was(cell: str) -> str:
    """What `harmless` was given, for reading such a file."""
    return _MARK.sub("", cell)
