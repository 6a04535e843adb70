"""Columns of a table that is written for spreadsheets: one fact in each, units in their names, always in one order.

What a list or a packed text of the table holds has no place in a sheet; it is a sheet of its own, or stays in Parquet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class SheetColumn:
    """A column of a sheet.

    Attributes
    ----------
    name : in the sheet, with its unit where it has one
    words : what it is
    of : the column of the table that it is; empty where that has the same name
    """

    name: str
    words: str
    of: str = ""

    @property
    def source(self) -> str:
        """The column of the table."""
        return self.of or self.name


def table_row(columns: Sequence[SheetColumn], row: Mapping[str, str]) -> dict[str, str]:
    """A row that was read from a sheet, by the names of the table."""
    names = {column.name: column.source for column in columns}
    return {names.get(name, name): value for name, value in row.items()}


def columns_in_words(columns: Sequence[SheetColumn]) -> str:
    """The columns as a table of Markdown."""
    lines = [f"| `{column.name}` | {column.words} |" for column in columns]
    return "\n".join(["| column | what it is |", "|---|---|", *lines]) + "\n"
