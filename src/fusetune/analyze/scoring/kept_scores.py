"""The scores of the sets of a flight as they were made, each by what it was made of: one more set costs only its own.

All are in one file, a SQLite database, so that a thousand sets are neither thousands of files nor one that is written
anew for each. Sets that were scored together are one row of it: their tables are joined, which takes less time and room
than to keep each. It only ever saves work: what is missing, damaged or of another make is made again.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from fusetune.analyze.scoring.columns import parted
from fusetune.analyze.scoring.set_scores import TABLES, SetScores
from fusetune.storage.files import AnyPath

_CODEC = "lz4"


class _Place(NamedTuple):
    """Where the scores of a set are: number of the row, and which of its sets it is."""

    row: int
    place: int


class KeptScores:
    """The scores that are kept; `kept_scores` opens the file."""

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database
        self._places: dict[str, _Place] = {}
        self._keys: dict[int, list[str]] = {}
        self._unpacked: tuple[int, list[SetScores]] | None = None
        for number in [number for (number,) in database.execute("SELECT number FROM kept")]:
            content = self._sound(number)
            if content is None:
                self._forget(number)
            else:
                self._enter(number, [one["key"] for one in json.loads(content[0])])

    def has(self, key: str) -> bool:
        """Whether the scores of a set are there, as they were written."""
        return key in self._places

    def scores(self, key: str) -> SetScores:
        """Those scores; quick for sets that were kept together and are asked for one after the other.

        Raises
        ------
        KeyError
            They are not there, or are damaged.
        """
        row, place = self._places[key]
        if self._unpacked is None or self._unpacked[0] != row:
            content = self._sound(row)
            if content is None:
                raise KeyError(key)
            self._unpacked = row, _unpacked(*content)
        return self._unpacked[1][place]

    def keep(self, scores: Mapping[str, SetScores]) -> None:
        """Add the scores of sets, by key, or replace them: all at once, or where the process is killed none."""
        head, tables = _packed(scores)
        cursor = self._database.execute(
            "INSERT INTO kept (digest, head, tables) VALUES (?, ?, ?)", (_digest(head, tables), head, tables)
        )
        assert cursor.lastrowid is not None, "SQLite numbers the rows"
        self._enter(cursor.lastrowid, [*scores])

    def drop_others(self, keys: Collection[str]) -> None:
        """Remove what is none of these."""
        for row, held in [*self._keys.items()]:
            wanted = [key for key in held if key in keys and self._places[key].row == row]
            if len(wanted) < len(held):
                if wanted:
                    self.keep({key: self.scores(key) for key in wanted})
                self._forget(row)
        self._places = {key: place for key, place in self._places.items() if place.row in self._keys}

    def _enter(self, row: int, keys: list[str]) -> None:
        self._keys[row] = keys
        self._places |= {key: _Place(row, place) for place, key in enumerate(keys)}

    def _forget(self, row: int) -> None:
        self._keys.pop(row, None)
        self._database.execute("DELETE FROM kept WHERE number = ?", (row,))

    def _sound(self, row: int) -> tuple[bytes, bytes] | None:
        found = self._database.execute("SELECT digest, head, tables FROM kept WHERE number = ?", (row,)).fetchone()
        if found is None or not all(isinstance(part, bytes) for part in found):
            return None
        digest, head, tables = found
        return (head, tables) if digest == _digest(head, tables) else None


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
        # of an earlier version, which had a row for each set
        database.execute("DROP TABLE IF EXISTS scores")
        database.execute(
            "CREATE TABLE IF NOT EXISTS kept (number INTEGER PRIMARY KEY, digest BLOB, head BLOB, tables BLOB)"
        )
        if database.execute("PRAGMA quick_check").fetchone() != ("ok",):
            raise sqlite3.DatabaseError(name)
    except sqlite3.DatabaseError:
        database.close()
        raise
    return database


def _digest(head: bytes, tables: bytes) -> bytes:
    digest = hashlib.blake2b(len(head).to_bytes(8, "little"))
    digest.update(head)
    digest.update(tables)
    return digest.digest()


def _packed(scores: Mapping[str, SetScores]) -> tuple[bytes, bytes]:
    """Keys, numbers of rows and summaries as JSON; the tables, one after the other, as one compressed stream."""
    head = [
        {"key": key, "rows": {name: len(getattr(one, name)) for name in TABLES}, "summary": one.summary}
        for key, one in scores.items()
    ]
    sink = pa.BufferOutputStream()
    with pa.CompressedOutputStream(sink, _CODEC) as stream:
        for name in TABLES:
            table = _with_dictionaries(pa.concat_tables(getattr(one, name) for one in scores.values()))
            with pa.ipc.new_stream(stream, table.schema) as writer:
                writer.write_table(table)
    return json.dumps(head).encode(), bytes(sink.getvalue().to_pybytes())


def _unpacked(head: bytes, content: bytes) -> list[SetScores]:
    """The scores of each set."""
    told: list[dict[str, Any]] = json.loads(head)
    found: list[dict[str, pa.Table]] = [{} for _ in told]
    with pa.CompressedInputStream(pa.BufferReader(content), _CODEC) as stream:
        for name, schema in TABLES.items():
            with pa.ipc.open_stream(stream) as reader:
                table = reader.read_all().cast(schema)
            for one, part in zip(found, parted(table, [one["rows"][name] for one in told]), strict=True):
                one[name] = _of_itself(part)
    return [SetScores(**tables, summary=one["summary"]) for tables, one in zip(found, told, strict=True)]


def _with_dictionaries(table: pa.Table) -> pa.Table:
    """The table in one piece, names as dictionaries, which take least."""
    columns = (column.combine_chunks() for column in table.unify_dictionaries().columns)
    encoded = [one.dictionary_encode() if pa.types.is_string(one.type) else one for one in columns]
    return pa.table(dict(zip(table.column_names, encoded, strict=True)))


def _of_itself(table: pa.Table) -> pa.Table:
    """A part of a table without what its dictionaries have of the others, the rest in the order of its rows."""
    for place, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            column = table.column(place).combine_chunks()
            codes = column.indices.to_numpy(zero_copy_only=False)
            # texts repeat in long runs
            used = list(dict.fromkeys(codes[np.flatnonzero(np.diff(codes, prepend=-1))].tolist()))
            renamed = np.zeros(len(column.dictionary), np.int32)
            renamed[used] = np.arange(len(used), dtype=np.int32)
            own = pa.DictionaryArray.from_arrays(
                pa.array(renamed[codes]), column.dictionary.take(pa.array(used, pa.int32()))
            )
            table = table.set_column(place, field, own)
    return table
