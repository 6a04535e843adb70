"""The blob of a flight: a JSON header and arrays, as the viewer of the pages reads them.

gzip of: uint32 (little-endian), the length of the header; the header, UTF-8, padded with spaces to a multiple of 4; the
arrays one after the other. Of each array the lowest bytes of all its elements come first, the highest last: what hardly
changes from element to element then lies together, and takes little room. `header["arrays"]` says of each where it
begins behind the header, how many elements it has and what they are:

====  ==============================================================================================
type  elements
====  ==============================================================================================
f4    float32 with a mantissa rounded to 16 bits, which four digits need; NaN where nothing is
u4    uint32
u1    bytes: flags
dt    uint32, differences of times in units of 0.1 ms since the log began, the first one since then
====  ==============================================================================================
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.errors import RUN_AGAIN, UserError
from fusetune.storage.files import AnyPath

VERSION = 1
TICK_US = 100
"""Unit of times, µs."""
MANTISSA_BITS = 16
_LOST_BITS = 23 - MANTISSA_BITS
_ALIGNED = 4
_LEVEL = 4
"""Of gzip: figures are noise in most of their bytes, which a higher one packs no better in a multiple of the time."""

_DTYPES: Mapping[str, np.dtype] = {
    "f4": np.dtype("<f4"),
    "u4": np.dtype("<u4"),
    "u1": np.dtype("u1"),
    "dt": np.dtype("<u4"),
}


class ArrayStore:
    """Arrays of a blob; one that it has already is not stored again."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._entries: list[dict[str, Any]] = []
        self._known: dict[tuple[str, bytes], int] = {}
        self._size = 0

    @property
    def entries(self) -> list[dict[str, Any]]:
        """`arrays` of the header."""
        return self._entries

    @property
    def content(self) -> bytes:
        """What stands behind the header."""
        return b"".join(self._parts)

    def figures(self, values: npt.ArrayLike) -> int:
        """Add figures (N,); their number."""
        return self._add("f4", rounded(np.asarray(values)))

    def times(self, ticks: npt.NDArray[np.int64]) -> int:
        """Add times (N,), ascending from 0 on, in units of `TICK_US`."""
        return self._add("dt", np.diff(ticks, prepend=0))

    def flags(self, values: npt.NDArray[np.bool_]) -> int:
        """Add flags (N,)."""
        return self._add("u1", values)

    def _add(self, kind: str, values: npt.NDArray[Any]) -> int:
        packed = np.ascontiguousarray(values.astype(_DTYPES[kind], copy=False))
        content = packed.view(np.uint8).reshape(packed.size, packed.itemsize).T.tobytes()
        known = self._known.setdefault((kind, content), len(self._entries))
        if known == len(self._entries):
            self._entries.append({"offset": self._size, "count": int(packed.size), "type": kind})
            self._parts.append(content)
            self._size += len(content)
        return known


def rounded(values: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Figures in single precision, their mantissa rounded to `MANTISSA_BITS`; what is not finite becomes NaN."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    bits = single.view(np.uint32)
    half, mask = np.uint32(1 << _LOST_BITS - 1), np.uint32(0xFFFFFFFF << _LOST_BITS & 0xFFFFFFFF)
    found = ((bits + half) & mask).view(np.float32)
    # the largest numbers would be rounded up to none
    too_large = np.isfinite(single) & ~np.isfinite(found)
    found[too_large] = (bits[too_large] & mask).view(np.float32)
    found[~np.isfinite(single)] = np.nan
    return found


class Blob(NamedTuple):
    """A blob that was read; arrays as `header["arrays"]` numbers them, times summed up to s since the log began."""

    header: dict[str, Any]
    arrays: list[npt.NDArray[Any]]


def pack(header: Mapping[str, Any], content: bytes) -> bytes:
    """Put header and arrays together; the same bytes for the same content."""
    text = json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode(errors="replace")
    text += b" " * (-len(text) % _ALIGNED)
    return gzip.compress(b"".join((len(text).to_bytes(4, "little"), text, content)), _LEVEL, mtime=0)


def unpack(blob: bytes, name: AnyPath = "a flight's blob") -> Blob:
    """Read a blob.

    Parameters
    ----------
    name : of its file, for the message

    Raises
    ------
    UserError
        It is none, or of another version.
    """
    header, content = _parts(blob, name)
    arrays = [_array(content, entry) for entry in header["arrays"]]
    return Blob(header, arrays)


def read_header(blob: bytes, name: AnyPath = "a flight's blob") -> dict[str, Any]:
    """The header of a blob alone; parameters and errors are those of `unpack`."""
    return _parts(blob, name)[0]


def with_header(blob: bytes, changed: Mapping[str, Any], name: AnyPath = "a flight's blob") -> bytes:
    """The blob with some entries of its header changed; errors as for `unpack`."""
    header, content = _parts(blob, name)
    return pack({**header, **changed}, content)


def _parts(blob: bytes, name: AnyPath) -> tuple[dict[str, Any], bytes]:
    try:
        raw = gzip.decompress(blob)
        length = int.from_bytes(raw[:4], "little")
        header = json.loads(raw[4 : 4 + length])
        version = header["version"]
    except (OSError, EOFError, ValueError, KeyError, TypeError) as error:
        raise UserError(name, f"holds no data of a flight ({error})", RUN_AGAIN) from error
    if version != VERSION:
        raise UserError(name, f"holds data of a flight in the form {version}, which is not {VERSION}", RUN_AGAIN)
    return header, raw[4 + length :]


def _array(content: bytes, entry: Mapping[str, Any]) -> npt.NDArray[Any]:
    dtype, count, start = _DTYPES[entry["type"]], entry["count"], entry["offset"]
    planes = np.frombuffer(content, np.uint8, count * dtype.itemsize, start)
    values = np.ascontiguousarray(planes.reshape(dtype.itemsize, count).T).view(dtype).reshape(count)
    return np.cumsum(values, dtype=np.int64) / (1_000_000 // TICK_US) if entry["type"] == "dt" else values
