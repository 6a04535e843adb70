"""Parquet files that show when a byte of them has changed.

The format's own checksums cover the values of each page, but neither the pages' headers nor the footer, and a changed
bit there reads as other values, too. So each file carries a seal beside them: the SHA-256 of all its other bytes. It
stands between the last page and the footer, where no reader looks, for the footer is found from the end of the file
and the pages by their offsets from its beginning. Any Parquet reader opens such a file.

Reading goes without PyArrow's data set machinery, whose import alone takes longer than most reads here.
"""

from __future__ import annotations

import hashlib
import mmap
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

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
    remedy: str = RUN_AGAIN,
    sealed: bool = True,
) -> pa.Table:
    """Read a Parquet file, or some of its columns.

    Parameters
    ----------
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
    with _opened(path, remedy, sealed) as parquet:
        return parquet.read(columns=columns if columns is None else list(columns), use_threads=False)


def read_schema(path: str | os.PathLike[str], *, remedy: str = RUN_AGAIN, sealed: bool = True) -> pa.Schema:
    """Names and types of the columns of a Parquet file; parameters and errors are those of `read_table`."""
    with _opened(path, remedy, sealed) as parquet:
        return parquet.schema_arrow


def read_pieces(path: str | os.PathLike[str], *, remedy: str = RUN_AGAIN, sealed: bool = True) -> Iterator[pa.Table]:
    """Read a Parquet file one row group at a time; parameters and errors are those of `read_table`."""
    with _opened(path, remedy, sealed) as parquet:
        for number in range(parquet.num_row_groups):
            yield parquet.read_row_group(number, use_threads=False)


@contextmanager
def _opened(path: str | os.PathLike[str], remedy: str, sealed: bool) -> Iterator[pq.ParquetFile]:
    try:
        content = _mapped(path)
        _check_seal(content, path, remedy, sealed)
        with pq.ParquetFile(pa.BufferReader(pa.py_buffer(content)), page_checksum_verification=True) as parquet:
            yield parquet
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror or error}", remedy) from error
    except (pa.ArrowException, ValueError) as error:
        raise UserError(path, f"is no readable Parquet file: {error}", remedy) from error


def seal(path: str | os.PathLike[str]) -> None:
    """Put the seal into a Parquet file that has just been written."""
    with open(path, "r+b") as file:
        end = file.seek(-_TAIL_BYTES, os.SEEK_END) + _TAIL_BYTES
        footer = end - _TAIL_BYTES - int.from_bytes(file.read(4), "little")
        digest = hashlib.sha256()
        file.seek(0)
        left = footer
        while left > 0:
            chunk = file.read(min(left, 1 << 20))
            digest.update(chunk)
            left -= len(chunk)
        tail = file.read()
        digest.update(tail)
        file.seek(footer)
        file.write(_SEAL_MARK + digest.digest() + tail)


def _mapped(path: str | os.PathLike[str]) -> bytes | mmap.mmap:
    with open(path, "rb") as file:
        if os.fstat(file.fileno()).st_size == 0:
            return b""
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def _check_seal(content: bytes | mmap.mmap, path: str | os.PathLike[str], remedy: str, sealed: bool) -> None:
    footer = len(content) - _TAIL_BYTES - int.from_bytes(content[-_TAIL_BYTES:-4], "little")
    stamp = content[footer - _SEAL_BYTES : footer] if footer >= _SEAL_BYTES else b""
    if not stamp.startswith(_SEAL_MARK):
        # a seal at another place than the footer tells is one whose footer, or its length, has changed
        if sealed or content.find(_SEAL_MARK) >= 0:
            raise UserError(path, "is cut or damaged: it does not end with the checksum it was written with", remedy)
        return
    view = memoryview(content)
    digest = hashlib.sha256(view[: footer - _SEAL_BYTES])
    digest.update(view[footer:])
    if stamp != _SEAL_MARK + digest.digest():
        raise UserError(path, "is damaged: its bytes are no longer those that were written", remedy)
