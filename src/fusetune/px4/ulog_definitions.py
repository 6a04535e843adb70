"""Message definitions of a ULog file: from their text to the layout of the records.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. A definition comes from a file that may be
damaged, so its size, its depth and the names in it are limited before anything is made of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

_TYPES = {
    "int8_t": "<i1",
    "uint8_t": "<u1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
    "bool": "<i1",
    "char": "<i1",
}
_SIZES = {name: np.dtype(code).itemsize for name, code in _TYPES.items()}
_FIELD = re.compile(r"([A-Za-z]\w*)(?:\[(\d{1,5})\])? (\w{1,100})", re.ASCII)
_TOPIC_NAME = re.compile(r"[A-Za-z]\w{0,99}", re.ASCII)
_PADDING = "_padding"
_LONGEST_MESSAGE = 0xFFFF - 2
_MOST_COLUMNS = 4096
_DEEPEST_NESTING = 8


class Field(NamedTuple):
    """One field of a definition; `length` is `None` where it is no array."""

    type_name: str
    length: int | None
    name: str


@dataclass(frozen=True)
class MessageLayout:
    """How a data message of one topic lies in its record."""

    dtype: np.dtype
    """Flattened columns, packed; without the padding at the end, which the logger leaves out."""
    longest: int
    """Bytes with the padding at the end."""
    booleans: frozenset[str]
    """Columns of type `bool`, a byte in the record."""


def topic_name(text: str) -> str:
    """A topic's name, which becomes a file's name.

    Raises
    ------
    ValueError
        It is no name of a topic.
    """
    if not _TOPIC_NAME.fullmatch(text):
        raise ValueError(f"{text[:40]!r} is no name of a topic")
    return text


def parse_format(payload: bytes) -> tuple[str, tuple[Field, ...]]:
    """Name and fields of a format record. Bytes that are no UTF-8 are left out.

    Raises
    ------
    ValueError
        The text is no definition.
    """
    name, colon, fields = payload.decode("utf-8", "ignore").partition(":")
    if not colon:
        raise ValueError("a definition without a colon")
    return topic_name(name), tuple(_parse_field(text) for text in fields.split(";") if text)


def _parse_field(text: str) -> Field:
    match = _FIELD.fullmatch(text)
    if match is None:
        raise ValueError(f"{text[:40]!r} is no field")
    type_name, length, name = match.groups()
    return Field(type_name, None if length is None else int(length), name)


def message_layout(name: str, formats: Mapping[str, tuple[Field, ...]]) -> MessageLayout:
    """Layout of a topic's data messages, nested definitions flattened: ``esc[0].esc_rpm``.

    Raises
    ------
    ValueError
        A definition is missing, too large or nested without end, or has two columns of one name.
    """
    columns: list[tuple[str, str]] = []
    size = 0
    for column, type_name in _columns("", name, formats, 0):
        columns.append((column, type_name))
        size += _SIZES[type_name]
        if size > _LONGEST_MESSAGE or len(columns) > _MOST_COLUMNS:
            raise ValueError(f"{name} is longer than any record")
    while columns and columns[-1][0].startswith(_PADDING):
        columns.pop()
    if ("timestamp", "uint64_t") not in columns:
        raise ValueError(f"{name} has no time stamp")
    dtype = np.dtype([(column, _TYPES[type_name]) for column, type_name in columns])
    return MessageLayout(dtype, size, frozenset(column for column, type_name in columns if type_name == "bool"))


def _columns(prefix: str, name: str, formats: Mapping[str, tuple[Field, ...]], depth: int) -> Iterator[tuple[str, str]]:
    if name not in formats:
        raise ValueError(f"{name} is not defined")
    if depth > _DEEPEST_NESTING:
        raise ValueError(f"{name} is nested without end")
    for field in formats[name]:
        places = [""] if not field.length else [f"[{index}]" for index in range(field.length)]
        for place in places:
            column = f"{prefix}{field.name}{place}"
            if field.type_name in _TYPES:
                yield column, field.type_name
            else:
                yield from _columns(f"{column}.", field.type_name, formats, depth + 1)


def is_padding(column: str) -> bool:
    """Whether a column only fills space."""
    return _PADDING in column
