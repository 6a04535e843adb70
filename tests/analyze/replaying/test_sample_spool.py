"""Samples that wait on the disk are those of the table, by source and axis."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fusetune.analyze.replaying.samples import SampleSpool, SortedSamples
from fusetune.analyze.replaying.store.reader import ColumnsOnDisk, read_innovations
from fusetune.errors import UserError

SOURCES = ("mag", "gnss_vel", "baro_hgt", "no_such_source")


def table(count: int, seed: int, *, measured: bool) -> pa.Table:
    generator = np.random.default_rng(seed)
    columns = {
        "source": np.array(SOURCES)[generator.integers(0, len(SOURCES), count)],
        "axis": generator.integers(0, 3, count).astype(np.int32),
        "timestamp_sample": np.arange(count) * 1000,
        **{
            name: generator.normal(size=count).astype(np.float32)
            for name in ("observation", "observation_variance", "innovation", "innovation_variance", "test_ratio")
        },
        "innovation_rejected": generator.random(count) < 0.2,
        "fused": generator.random(count) < 0.8,
    }
    if measured:
        columns["measured"] = generator.random(count) < 0.7
    return pa.table(columns)


@given(count=st.integers(0, 80), group=st.integers(1, 30), seed=st.integers(0, 5), measured=st.booleans())
@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_each_source_and_axis_has_its_rows_in_the_order_of_the_file(
    tmp_path: Path, count: int, group: int, seed: int, measured: bool
) -> None:
    rows = table(count, seed, measured=measured)
    pq.write_table(rows, tmp_path / "a.parquet", row_group_size=group)
    samples = read_innovations(tmp_path / "a.parquet", {})
    frame = rows.to_pandas()
    frame = frame[frame["measured"]] if measured else frame
    expected = {key: part for key, part in frame.groupby(["source", "axis"]) if key[0] != "no_such_source"}
    assert set(samples) == set(expected)
    for key, part in expected.items():
        one = samples[key]
        for name in ("timestamp_sample", "observation", "observation_variance", "innovation", "test_ratio", "fused"):
            np.testing.assert_array_equal(getattr(one, name), part[name].to_numpy())
        assert one.innovation.dtype == np.float64
    assert list(tmp_path.iterdir()) == [tmp_path / "a.parquet"]


def test_sources_come_in_the_order_of_their_first_row_and_their_axes_ascending(tmp_path: Path) -> None:
    rows = table(60, 1, measured=False)
    pq.write_table(rows, tmp_path / "a.parquet", row_group_size=10)
    order = list(dict.fromkeys(rows["source"].to_pylist()))
    found = list(read_innovations(tmp_path / "a.parquet", {}))
    assert found == sorted(found, key=lambda key: (order.index(key[0]), key[1]))


def test_sets_share_a_spool(tmp_path: Path) -> None:
    spool = SampleSpool(tmp_path)
    tables = [table(50, seed, measured=False) for seed in (1, 2)]
    found = []
    for number, rows in enumerate(tables):
        pq.write_table(rows, tmp_path / f"{number}.parquet")
        found.append(read_innovations(tmp_path / f"{number}.parquet", {}, spool))
    for rows, samples in zip(tables, found, strict=True):
        frame = rows.to_pandas()
        mag = frame[(frame["source"] == "mag") & (frame["axis"] == 0)]
        np.testing.assert_array_equal(samples["mag", 0].innovation, mag["innovation"])


def test_samples_in_memory_are_those_on_the_disk(tmp_path: Path) -> None:
    rows = table(80, 3, measured=False)
    pq.write_table(rows, tmp_path / "a.parquet")
    names = [name for name in rows.column_names if name != "source"]
    sources = sorted(SOURCES)
    structured = np.zeros(80, [("source", "i4"), *((name, rows[name].to_numpy().dtype) for name in names)])
    structured["source"] = [sources.index(name) for name in rows["source"].to_pylist()]
    for name in names:
        structured[name] = rows[name].to_numpy()
    found, read = SortedSamples(structured, sources, lambda _: 1.0), read_innovations(tmp_path / "a.parquet", {})
    assert set(found) == set(read)
    for key, samples in found.items():
        for name in ("timestamp_sample", "observation", "innovation", "test_ratio", "fused", "rejected"):
            np.testing.assert_array_equal(getattr(samples, name), getattr(read[key], name))


def test_a_column_that_a_table_lacks_is_no_column(tmp_path: Path) -> None:
    pq.write_table(pa.table({"x": [1.0, 2.0]}), tmp_path / "a.parquet")
    columns = ColumnsOnDisk(tmp_path / "a.parquet")
    assert list(columns) == ["x"]
    assert columns.get("y") is None
    np.testing.assert_array_equal(columns["x"], [1.0, 2.0])


def test_a_damaged_table_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes(b"PAR1 is not all of it")
    with pytest.raises(UserError, match=r"a\.parquet"):
        read_innovations(tmp_path / "a.parquet", {})
    with pytest.raises(UserError, match=r"a\.parquet"):
        ColumnsOnDisk(tmp_path / "a.parquet")
