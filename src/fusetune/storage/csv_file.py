"""Tables as CSV files, for spreadsheets first: programs find most of them as Parquet beside.

They are UTF-8 and begin with its mark (BOM), always: without it Excel takes ° and ² and the ä of a file's name for
other characters. pandas, Arrow and R leave the mark out by themselves; Python's `csv` does with the encoding
`utf-8-sig`. Where nothing is known a cell is empty.
"""

from __future__ import annotations

import codecs
import os
from collections.abc import Sequence

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from fusetune.storage.cells import harmless
from fusetune.storage.files import atomic_path
from fusetune.storage.sheet import SheetColumn


def write_csv(path: str | os.PathLike[str], table: pa.Table, sheet: Sequence[SheetColumn] = ()) -> None:
    """Write a table as CSV, as a whole or not at all; numbers are written as numbers, texts are made harmless.

    Parameters
    ----------
    sheet
        The columns that are written, under their names there; all of the table's where there are none.
    """
    if sheet:
        table = table.select([column.source for column in sheet]).rename_columns([column.name for column in sheet])
    columns = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        if pa.types.is_dictionary(column.type):
            column = pc.cast(column, column.type.value_type)
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            texts = [None if text is None else harmless(text) for text in column.to_pylist()]
            column = pa.chunked_array([pa.array(texts, column.type)])
        elif pa.types.is_floating(column.type):
            column = pc.if_else(pc.is_nan(column), None, column)
        columns.append((name, column))
    rows = pa.table([column for _, column in columns], names=[harmless(name) for name, _ in columns])
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        file.write(codecs.BOM_UTF8)
        pyarrow.csv.write_csv(rows, file)
