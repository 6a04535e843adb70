"""The scores of the sets of a flight as they were made, each by what it was made of: one more set costs only its own.

All are in one file, a SQLite database, so that a thousand sets are neither thousands of files nor one that is written
anew for each. It only ever saves work: what is missing, damaged or of another make is made again.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pyarrow as pa

from fusetune.analyze.scoring.set_scores import TABLES, SetScores
from fusetune.storage.files import AnyPath


class KeptScores:
    """The scores that are kept; `kept_scores` opens the file."""

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database

    def has(self, key: str) -> bool:
        """Whether the scores of a set are there, as they were written."""
        return self._sound(key) is not None

    def scores(self, key: str) -> SetScores:
        """Those scores.

        Raises
        ------
        KeyError
            They are not there, or are damaged.
        """
        content = self._sound(key)
        if content is None:
            raise KeyError(key)
        summary, tables = content
        return SetScores(**_tables_of(tables), summary=json.loads(summary))

    def keep(self, key: str, scores: SetScores) -> None:
        """Add or replace the scores of a set."""
        content = json.dumps(scores.summary).encode(), _bytes_of(scores)
        self._database.execute(
            "INSERT OR REPLACE INTO scores VALUES (?, ?, ?, ?)", (key, _digest(key, *content), *content)
        )

    def drop_others(self, keys: Collection[str]) -> None:
        """Remove what is none of these."""
        known = [key for (key,) in self._database.execute("SELECT key FROM scores")]
        self._database.executemany("DELETE FROM scores WHERE key = ?", [(key,) for key in known if key not in keys])

    def _sound(self, key: str) -> tuple[bytes, bytes] | None:
        row = self._database.execute("SELECT digest, summary, tables FROM scores WHERE key = ?", (key,)).fetchone()
        if row is None or not all(isinstance(part, bytes) for part in row):
            return None
        digest, summary, tables = row
        return (summary, tables) if digest == _digest(key, summary, tables) else None


@contextmanager
def kept_scores(path: AnyPath | None) -> Iterator[KeptScores]:
    """Open the scores that are kept in a file, which is made where there is none; without a path they stay in memory.

    Each set is there for good as soon as it was kept: a process that is killed loses none.
    """
    with closing(_opened(path)) as database:
        yield KeptScores(database)


def _opened(path: AnyPath | None) -> sqlite3.Connection:
    if path is None:
        return _with_table(":memory:")
    try:
        return _with_table(str(path))
    except sqlite3.DatabaseError:
        Path(path).unlink(missing_ok=True)
        return _with_table(str(path))


def _with_table(name: str) -> sqlite3.Connection:
    # each statement is its own transaction
    database = sqlite3.connect(name, isolation_level=None)
    try:
        # what is lost when the power fails is found by its digest, and made again
        database.execute("PRAGMA synchronous = OFF")
        database.execute("PRAGMA auto_vacuum = FULL")
        database.execute(
            "CREATE TABLE IF NOT EXISTS scores (key TEXT PRIMARY KEY, digest BLOB, summary BLOB, tables BLOB)"
        )
        if database.execute("PRAGMA quick_check").fetchone() != ("ok",):
            raise sqlite3.DatabaseError(name)
    except sqlite3.DatabaseError:
        database.close()
        raise
    return database


def _digest(key: str, summary: bytes, tables: bytes) -> bytes:
    digest = hashlib.blake2b(key.encode())
    digest.update(len(summary).to_bytes(8, "little"))
    digest.update(summary)
    digest.update(tables)
    return digest.digest()


def _bytes_of(scores: SetScores) -> bytes:
    """All tables, one after the other, as one compressed stream; names as dictionaries, which take least."""
    sink = pa.BufferOutputStream()
    with pa.CompressedOutputStream(sink, "zstd") as stream:
        for name in TABLES:
            table = _with_dictionaries(getattr(scores, name))
            with pa.ipc.new_stream(stream, table.schema) as writer:
                writer.write_table(table)
    return bytes(sink.getvalue().to_pybytes())


def _tables_of(content: bytes) -> dict[str, pa.Table]:
    with pa.CompressedInputStream(pa.BufferReader(content), "zstd") as stream:
        found = {}
        for name, schema in TABLES.items():
            with pa.ipc.open_stream(stream) as reader:
                found[name] = reader.read_all().cast(schema)
        return found


def _with_dictionaries(table: pa.Table) -> pa.Table:
    columns = (column.combine_chunks() for column in table.columns)
    encoded = [one.dictionary_encode() if pa.types.is_string(one.type) else one for one in columns]
    return pa.table(dict(zip(table.column_names, encoded, strict=True)))
