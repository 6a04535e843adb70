"""Tables that are written in pieces: one file however the rows come, and no more than a group of them in memory."""

import tracemalloc
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fusetune.analyze.replaying.store import row_groups
from fusetune.analyze.replaying.store.columns import innovation_table, state_table
from fusetune.analyze.replaying.store.row_groups import tables_in_groups, written_in_groups
from fusetune.ekf2.replay.recording import INNOVATION_ROW, STATE_ROW

GROUP = 7


@pytest.fixture
def small_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_groups, "ROWS_PER_GROUP", GROUP)


def innovations(count: int) -> np.ndarray:
    rows = np.zeros(count, INNOVATION_ROW)
    rows["source"], rows["axis"] = np.arange(count) % 5, np.arange(count) % 3
    rows["timestamp_sample"] = 1000 * np.arange(count)
    rows["innovation"] = np.sin(np.arange(count))
    rows["fused"] = np.arange(count) % 2
    return rows


def written(target: Path, pieces: Iterable[np.ndarray]) -> Path:
    with written_in_groups(target, INNOVATION_ROW, innovation_table) as take:
        for piece in pieces:
            take(piece)
    return target


@given(cuts=st.lists(st.integers(0, 40), max_size=12), count=st.integers(0, 40))
@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.usefixtures("small_groups")
def test_the_file_does_not_depend_on_where_the_pieces_are_cut(tmp_path: Path, cuts: list[int], count: int) -> None:
    rows = innovations(count)
    whole = written(tmp_path / "whole.parquet", [rows])
    parts = written(tmp_path / "parts.parquet", np.split(rows, sorted(min(cut, count) for cut in cuts)))
    assert parts.read_bytes() == whole.read_bytes()
    assert pq.read_table(parts).equals(innovation_table(rows))
    with pq.ParquetFile(parts) as file:
        lengths = [file.metadata.row_group(number).num_rows for number in range(file.num_row_groups)]
    assert lengths == [GROUP] * (count // GROUP) + ([count % GROUP] if count % GROUP else [])


def test_what_waits_in_memory_is_bounded_by_the_length_of_a_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # 60,000 updates are ten minutes: 13 MB of states, of which a twentieth is a group
    group, piece, pieces = 3000, 1000, 60
    monkeypatch.setattr(row_groups, "ROWS_PER_GROUP", group)
    rows = np.zeros(piece, STATE_ROW)
    tracemalloc.start()
    with written_in_groups(tmp_path / "a.parquet", STATE_ROW, state_table) as take:
        for _ in range(pieces):
            take(rows.copy())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # the pieces that wait, the same joined, and as columns
    assert peak < 3.5 * group * STATE_ROW.itemsize < 0.2 * piece * pieces * STATE_ROW.itemsize
    assert pq.read_metadata(tmp_path / "a.parquet").num_rows == piece * pieces


@pytest.mark.usefixtures("small_groups")
def test_a_replay_that_fails_leaves_no_file(tmp_path: Path) -> None:
    def interrupted() -> Iterator[np.ndarray]:
        yield innovations(20)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        written(tmp_path / "a.parquet", interrupted())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("small_groups")
def test_tables_with_other_names_in_each_come_out_as_one(tmp_path: Path) -> None:
    schema = pa.schema([pa.field("set", pa.dictionary(pa.int32(), pa.string())), pa.field("value", pa.int64())])

    def table(name: str, first: int, count: int) -> pa.Table:
        names = pa.DictionaryArray.from_arrays(pa.array(np.zeros(count, np.int32)), pa.array([name]))
        return pa.table({"set": names, "value": pa.array(np.arange(first, first + count))}, schema=schema)

    with tables_in_groups(tmp_path / "a.parquet", schema) as take:
        for name, first, count in (("a", 0, 3), ("b", 3, 2), ("a", 5, 4), ("c", 9, 30), ("b", 39, 1)):
            take(table(name, first, count))
    found = pq.read_table(tmp_path / "a.parquet")
    assert found.schema.equals(schema)
    assert found["value"].to_pylist() == list(range(40))
    assert found["set"].cast(pa.string()).to_pylist() == [*"aaa", *"bb", *"aaaa", *"c" * 30, "b"]
