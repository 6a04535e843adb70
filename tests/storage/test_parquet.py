from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.flipped_bits import with_flipped_bits

from fusetune.errors import UserError
from fusetune.storage.parquet import read_pieces, read_schema, read_table, table_writer, write_table

TABLE = pa.table(
    {
        "timestamp": np.arange(40, dtype=np.int64) * 4_000,
        "innovation": np.sin(np.arange(40.0)),
        "source": pa.array(["gnss_vel", "baro_hgt"] * 20).dictionary_encode(),
    }
)
OPTIONS = {"compression": "zstd", "use_dictionary": ["source"], "write_statistics": False}
WITHOUT_OPTIONS = {"compression": "lz4", "use_dictionary": False, "write_statistics": False, "store_schema": False}


@pytest.mark.parametrize("options", [{}, OPTIONS, WITHOUT_OPTIONS])
def test_what_was_written_is_read_by_us_and_by_any_reader(tmp_path: Path, options: dict[str, object]) -> None:
    file = tmp_path / "a.parquet"
    write_table(TABLE, file, **options)
    for table in (read_table(file), pq.read_table(file), pq.read_table(file, page_checksum_verification=True)):
        assert table.cast(TABLE.schema).equals(TABLE)
    assert read_table(file, ["innovation"]).column_names == ["innovation"]


def test_a_table_written_in_pieces_is_sealed_too(tmp_path: Path) -> None:
    file = tmp_path / "a.parquet"
    with table_writer(file, TABLE.schema) as writer:
        for first in range(0, 40, 10):
            writer.write_table(TABLE.slice(first, 10))
    assert read_table(file).equals(TABLE)
    assert [len(piece) for piece in read_pieces(file)] == [10] * 4
    assert pa.concat_tables(read_pieces(file)).equals(TABLE)
    assert read_schema(file) == TABLE.schema
    file.write_bytes(file.read_bytes().replace(b"innovation", b"innovatjon"))
    for read in (read_schema, lambda damaged: list(read_pieces(damaged))):
        with pytest.raises(UserError, match=r"a\.parquet"):
            read(file)


@pytest.mark.parametrize("options", [OPTIONS, WITHOUT_OPTIONS])
def test_a_flipped_bit_of_any_byte_is_found(tmp_path: Path, options: dict[str, object]) -> None:
    """Magic, page headers, dictionary and data pages, seal, footer, its length: a bit of each byte, all of the last."""
    file, flipped = tmp_path / "a.parquet", tmp_path / "flipped.parquet"
    write_table(TABLE.select(["timestamp", "source"]).slice(0, 4), file, **options)
    content = file.read_bytes()
    for damaged in with_flipped_bits(content, all_from=len(content) - 8):
        flipped.write_bytes(damaged)
        with pytest.raises(UserError, match=r"flipped\.parquet.*Delete it and run the pipeline again"):
            read_table(flipped)


def test_where_the_seal_may_be_missing_a_flipped_bit_is_found_or_changes_nothing(tmp_path: Path) -> None:
    file, flipped = tmp_path / "a.parquet", tmp_path / "flipped.parquet"
    table = TABLE.select(["timestamp", "source"]).slice(0, 4)
    write_table(table, file, **OPTIONS)
    content, read = file.read_bytes(), 0
    for damaged in with_flipped_bits(content, all_from=len(content) - 8):
        flipped.write_bytes(damaged)
        with suppress(UserError):
            assert read_table(flipped, sealed=False).equals(table)
            read += 1
    assert read == len(b"fusetune SHA-256:")


@pytest.mark.parametrize("left", [0, 3, 8, 60, -1])
def test_a_file_that_was_cut_is_found(tmp_path: Path, left: int) -> None:
    file = tmp_path / "a.parquet"
    write_table(TABLE, file)
    file.write_bytes(file.read_bytes()[:left])
    with pytest.raises(UserError, match=r"a\.parquet"):
        read_table(file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"a\.parquet: cannot be read: No such file"):
        read_table(tmp_path / "a.parquet")


def test_only_where_it_is_allowed_a_file_may_lack_the_seal(tmp_path: Path) -> None:
    file = tmp_path / "a.parquet"
    pq.write_table(TABLE, file)
    assert read_table(file, sealed=False).equals(TABLE)
    with pytest.raises(UserError, match="checksum"):
        read_table(file)


def test_the_same_table_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.parquet", "b.parquet"):
        write_table(TABLE, tmp_path / name, **OPTIONS)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
