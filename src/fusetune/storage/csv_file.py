"""Tables as CSV files."""

from __future__ import annotations

import os

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from fusetune.storage.cells import harmless
from fusetune.storage.files import atomic_path


def write_csv(path: str | os.PathLike[str], table: pa.Table) -> None:
    """Write a table as CSV, as a whole or not at all; numbers are written as numbers, texts are made harmless."""
    columns = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        if pa.types.is_dictionary(column.type):
            column = pc.cast(column, column.type.value_type)
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            texts = [None if text is None else harmless(text) for text in column.to_pylist()]
            column = pa.chunked_array([pa.array(texts, column.type)])
        columns.append((name, column))
    rows = pa.table([column for _, column in columns], names=[harmless(name) for name, _ in columns])
    with atomic_path(path) as temporary:
        pyarrow.csv.write_csv(rows, temporary)
