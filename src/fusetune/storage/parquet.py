"""Parquet files, as a whole or in pieces, that show when a byte of them has changed.

The format's own checksums cover the values of each page, but neither the pages' headers nor the footer, and a changed
bit there reads as other values, too. So each file carries a seal beside them: the SHA-256 of all its other bytes. It
stands between the last page and the footer, where no reader looks, for the footer is found from the end of the file
and the pages by their offsets from its beginning. Any Parquet reader opens such a file.

Reading goes without PyArrow's data set machinery, whose import alone takes longer than most reads here.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from fusetune.errors import RUN_AGAIN, UserError

_TAIL_BYTES = 8
"""Length of the footer (4 bytes, little-endian) and the magic, which end the file."""
_SEAL_MARK = b"fusetune SHA-256:"
_SEAL_BYTES = len(_SEAL_MARK) + hashlib.sha256().digest_size


def write_table(table: pa.Table, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a sealed Parquet file; `options` are those of `pyarrow.parquet.write_table`."""
    pq.write_table(table, path, write_page_checksum=True, **options)
    seal(path)


@contextmanager
def table_writer(path: str | os.PathLike[str], schema: pa.Schema, **options: Any) -> Iterator[pq.ParquetWriter]:
    """Write a Parquet file piece by piece; it is sealed at the end. `options` are those of `ParquetWriter`."""
    with pq.ParquetWriter(path, schema, write_page_checksum=True, **options) as writer:
        yield writer
    seal(path)


def read_table(
    path: str | os.PathLike[str],
    columns: Sequence[str] | None = None,
    *,
    words: Sequence[str] = (),
    remedy: str = RUN_AGAIN,
    sealed: bool = True,
) -> pa.Table:
    """Read a Parquet file, or some of its columns.

    Parameters
    ----------
    words
        Columns of text that come with a code for each row, whatever the file's own type: of few different words, which
        is many times faster.
    remedy
        What the user can do about a damaged file.
    sealed
        Whether the file must carry its seal, as all that the package wrote do. One of another program may lack it; of
        one that had it, a single changed bit is found all the same, unless it is one of the seal's mark.

    Raises
    ------
    UserError
        The file does not exist, is no Parquet file, or a byte of it has changed since it was written.
    """
    with _opened(path, remedy, sealed, words) as parquet:
        return parquet.read(columns=columns if columns is None else list(columns), use_threads=False)


def read_schema(path: str | os.PathLike[str], *, remedy: str = RUN_AGAIN, sealed: bool = True) -> pa.Schema:
    """Names and types of the columns of a Parquet file; parameters and errors are those of `read_table`."""
    with _opened(path, remedy, sealed) as parquet:
        return parquet.schema_arrow


def read_pieces(
    path: str | os.PathLike[str],
    columns: Sequence[str] | None = None,
    *,
    words: Sequence[str] = (),
    remedy: str = RUN_AGAIN,
    sealed: bool = True,
) -> Iterator[pa.Table]:
    """Read a Parquet file one row group at a time; parameters and errors are those of `read_table`."""
    chosen = columns if columns is None else list(columns)
    with _opened(path, remedy, sealed, words) as parquet:
        for number in range(parquet.num_row_groups):
            yield parquet.read_row_group(number, columns=chosen, use_threads=False)


def seal(path: str | os.PathLike[str]) -> None:
    """Put the seal into a Parquet file that has just been written."""
    with open(path, "r+b") as file:
        footer = _footer_start(file)
        digest = _digest_around(file, footer, footer)
        file.seek(footer)
        tail = file.read()
        file.seek(footer)
        file.write(_SEAL_MARK + digest + tail)


@contextmanager
def _opened(
    path: str | os.PathLike[str], remedy: str, sealed: bool, words: Sequence[str] = ()
) -> Iterator[pq.ParquetFile]:
    """A Parquet file whose seal has been found sound."""
    try:
        _check_seal(path, remedy, sealed)
        # memory-mapped, the pages of all that was read would count as this process's memory
        with pq.ParquetFile(path, page_checksum_verification=True, read_dictionary=list(words)) as parquet:
            yield parquet
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror or error}", remedy) from error
    except (pa.ArrowException, ValueError) as error:
        raise UserError(path, f"is no readable Parquet file: {error}", remedy) from error


def _check_seal(path: str | os.PathLike[str], remedy: str, sealed: bool) -> None:
    with open(path, "rb") as file:
        footer = _footer_start(file)
        file.seek(max(footer - _SEAL_BYTES, 0))
        stamp = file.read(_SEAL_BYTES)
        is_sealed = footer >= _SEAL_BYTES and stamp.startswith(_SEAL_MARK)
        if is_sealed and stamp != _SEAL_MARK + _digest_around(file, footer - _SEAL_BYTES, footer):
            raise UserError(path, "is damaged: its bytes are no longer those that were written", remedy)
        # a seal at another place than the footer tells is one whose footer, or its length, has changed
        is_cut = not is_sealed and (sealed or _holds_mark(file))
    if is_cut:
        raise UserError(path, "is cut or damaged: it does not end with the checksum it was written with", remedy)


def _holds_mark(file: BinaryIO) -> bool:
    file.seek(0)
    before = b""
    while chunk := file.read(1 << 20):
        if _SEAL_MARK in before + chunk:
            return True
        before = chunk[-len(_SEAL_MARK) :]
    return False


def _footer_start(file: BinaryIO) -> int:
    """Offset of the footer, as the end of the file says; below 0 where that cannot be."""
    end = file.seek(0, os.SEEK_END)
    if end < _TAIL_BYTES:
        return -1
    file.seek(end - _TAIL_BYTES)
    return end - _TAIL_BYTES - int.from_bytes(file.read(4), "little")


def _digest_around(file: BinaryIO, pages_end: int, footer: int) -> bytes:
    """SHA-256 of a file without the bytes between the end of its pages and its footer."""
    digest = hashlib.sha256()
    file.seek(0)
    while left := pages_end - file.tell():
        chunk = file.read(min(left, 1 << 20))
        if not chunk:
            break
        digest.update(chunk)
    file.seek(footer)
    digest.update(file.read())
    return digest.digest()
