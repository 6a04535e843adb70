"""Rows of a replay kept in arrays that grow."""

from __future__ import annotations

import tracemalloc

import numpy as np

from fusetune.ekf2.replay.kept_rows import KeptRows
from fusetune.ekf2.replay.recording import (
    FLAGS_ROW,
    INNOVATION_ROW,
    LOCAL_POSITION_ROW,
    STATE_ROW,
    RecordArrays,
    joined,
    with_fields,
)


def stretch(rows: int, first: int) -> RecordArrays:
    parts = RecordArrays(*(np.zeros(rows, row) for row in (INNOVATION_ROW, STATE_ROW, LOCAL_POSITION_ROW, FLAGS_ROW)))
    parts.innovations["timestamp_sample"] = parts.states["timestamp"] = np.arange(first, first + rows)
    return parts


def test_kept_rows_are_those_of_the_stretches_joined() -> None:
    stretches = [stretch(rows, first) for rows, first in ((5, 0), (0, 5), (70, 5))]
    kept = KeptRows()
    for rows in stretches:
        kept.take(rows)
    for found, expected in zip(kept.rows(), joined(stretches), strict=True):
        assert found.dtype == expected.dtype
        assert found.tobytes() == expected.tobytes()


def test_of_what_is_kept_fields_may_be_fewer_and_rows_other() -> None:
    def keep(rows: RecordArrays) -> RecordArrays:
        return rows._replace(innovations=rows.innovations[::2], states=with_fields(rows.states, ["timestamp"]))

    kept = KeptRows(keep)
    for first in (0, 10):
        kept.take(stretch(10, first))
    found = kept.rows()
    assert found.innovations["timestamp_sample"].tolist() == list(range(0, 20, 2))
    assert found.states.dtype.names == ("timestamp",)
    assert found.states["timestamp"].tolist() == list(range(20))


def test_without_any_stretch_there_are_no_rows() -> None:
    assert [len(rows) for rows in KeptRows().rows()] == [0, 0, 0, 0]


def test_rows_are_in_memory_once() -> None:
    rows, stretches = stretch(10_000, 0), 20
    size = sum(part.nbytes for part in rows) * stretches
    tracemalloc.start()
    kept = KeptRows()
    for _ in range(stretches):
        kept.take(rows)
    found = kept.rows()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert sum(part.nbytes for part in found) == size
    assert peak < 1.7 * size
