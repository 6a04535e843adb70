"""Reading Parquet files without PyArrow's data set machinery, whose import alone takes longer than most reads here."""

from __future__ import annotations

import os
from collections.abc import Sequence

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
