"""Tables whose rows come in pieces: written in row groups of one length, so that no more than one is in memory.

The pieces may be cut anywhere: the file depends on the rows alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pyarrow as pa

from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import table_writer

ROWS_PER_GROUP = 1 << 15


def replay_table_options(schema: pa.Schema) -> dict[str, object]:
    """How tables of a replay are written."""
    # the extremes of figures would only take time
    texts = _texts(schema)
    return {"compression": "zstd", "compression_level": 1, "use_dictionary": texts, "write_statistics": False}


def _texts(schema: pa.Schema) -> list[str]:
    """Columns that are written with a dictionary: figures hardly ever repeat, and one of them would only take time."""
    return [field.name for field in schema if pa.types.is_dictionary(field.type) or pa.types.is_string(field.type)]


@contextmanager
def written_in_groups(
    target: AnyPath, dtype: np.dtype, to_table: Callable[[np.ndarray], pa.Table]
) -> Iterator[Callable[[np.ndarray], None]]:
    """Write a Parquet file that is either whole or not there.

    Parameters
    ----------
    dtype : of the rows
    to_table : makes columns of some rows

    Yields
    ------
    Takes the next rows.
    """
    # what a replay wrote is the estimator's; pages, which come by here for other tables, need not load it
    from fusetune.ekf2.replay.recording import joined_rows

    waiting: list[np.ndarray] = []
    schema = to_table(np.zeros(0, dtype)).schema
    with atomic_path(target) as path, table_writer(path, schema, **replay_table_options(schema)) as writer:

        def take(rows: np.ndarray) -> None:
            waiting.append(rows)
            if sum(map(len, waiting)) >= ROWS_PER_GROUP:
                whole = joined_rows(waiting, dtype)
                whole_groups = len(whole) - len(whole) % ROWS_PER_GROUP
                for first in range(0, whole_groups, ROWS_PER_GROUP):
                    writer.write_table(to_table(whole[first : first + ROWS_PER_GROUP]))
                waiting[:] = [whole[whole_groups:].copy()]

        yield take
        if any(map(len, waiting)):
            writer.write_table(to_table(joined_rows(waiting, dtype)))


@contextmanager
def tables_in_groups(target: AnyPath, schema: pa.Schema) -> Iterator[Callable[[pa.Table], None]]:
    """Write a Parquet file that is either whole or not there, out of tables that are small or large.

    Yields
    ------
    Takes the next table.
    """
    waiting: list[pa.Table] = []
    rows = 0
    with atomic_path(target) as path, table_writer(path, schema, use_dictionary=_texts(schema)) as writer:

        def write() -> None:
            nonlocal rows
            if waiting:
                writer.write_table(pa.concat_tables(waiting).unify_dictionaries())
                waiting.clear()
                rows = 0

        def take(table: pa.Table) -> None:
            nonlocal rows
            waiting.append(table)
            rows += len(table)
            if rows >= ROWS_PER_GROUP:
                write()

        yield take
        write()
