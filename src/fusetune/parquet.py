"""Parquet files, as a whole or in pieces.

Reading goes without PyArrow's data set machinery, whose import alone takes longer than most reads here.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq


def read_table(path: str | os.PathLike[str], columns: Sequence[str] | None = None) -> pa.Table:
    """Read a Parquet file, or some of its columns.

    Raises
    ------
    OSError, pyarrow.ArrowException
        The file does not exist, or is no Parquet file.
    """
    with pq.ParquetFile(path, memory_map=True) as parquet:
        return parquet.read(columns=columns if columns is None else list(columns), use_threads=False)


def read_schema(path: str | os.PathLike[str]) -> pa.Schema:
    """Names and types of the columns of a Parquet file; raises what `read_table` does."""
    with pq.ParquetFile(path, memory_map=True) as parquet:
        return parquet.schema_arrow


def read_pieces(path: str | os.PathLike[str], columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
    """Read a Parquet file, or some of its columns, one row group at a time; raises what `read_table` does."""
    with pq.ParquetFile(path) as parquet:
        for number in range(parquet.num_row_groups):
            yield parquet.read_row_group(
                number, columns=columns if columns is None else list(columns), use_threads=False
            )


@contextmanager
def table_writer(path: str | os.PathLike[str], schema: pa.Schema, **options: Any) -> Iterator[pq.ParquetWriter]:
    """Write a Parquet file piece by piece; `options` are those of `pyarrow.parquet.ParquetWriter`."""
    with pq.ParquetWriter(path, schema, **options) as writer:
        yield writer
