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
    # Figures hardly ever repeat: a dictionary of them, and their extremes, would only take time.
    texts = [field.name for field in schema if pa.types.is_dictionary(field.type)]
    return {"compression": "zstd", "compression_level": 1, "use_dictionary": texts, "write_statistics": False}


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
    with atomic_path(target) as path, table_writer(path, schema) as writer:

        def write() -> None:
            if waiting:
                writer.write_table(pa.concat_tables(waiting).unify_dictionaries())
                waiting.clear()

        def take(table: pa.Table) -> None:
            waiting.append(table)
            if sum(len(one) for one in waiting) >= ROWS_PER_GROUP:
                write()

        yield take
        write()
