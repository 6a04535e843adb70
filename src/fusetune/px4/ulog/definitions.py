"""Message definitions of a ULog file: from their text to the layout of the records.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. A definition comes from a file that may be
damaged, so its size, its depth and the names in it are limited before anything is made of them. Sizes and numbers of
columns are reckoned definition by definition, from the lengths of the arrays, so an array costs no more than a field;
columns are made only of what is within the limits and is asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
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


class MessageSize(NamedTuple):
    """How large a definition is with all that is nested in it."""

    size: int
    """Bytes with the padding at the end."""
    columns: int
    depth: int
    """Levels of definitions nested in it."""


@dataclass(frozen=True)
class MessageLayout:
    """How a data message of one topic lies in its record."""

    dtype: np.dtype
    """Flattened columns, packed; without the padding at the end, which the logger leaves out."""
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


class _UndefinedError(ValueError):
    """A definition that is missing, and may still come."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"{name} is not defined")


class Definitions:
    """All definitions of a log and what topics they make.

    What was found once, good or bad, is kept, so that asking again for thousands of subscriptions costs nothing.
    """

    def __init__(self) -> None:
        self._formats: dict[str, tuple[Field, ...]] = {}
        self._sizes: dict[str, MessageSize] = {}
        self._paddings: dict[str, int] = {}
        self._faults: dict[str, str] = {}
        self._waiting: dict[str, list[str]] = {}
        """Faulty definitions by the name of what they lack."""

    def add(self, payload: bytes) -> None:
        """Take the definition of a format record; of several for one name the first holds.

        Raises
        ------
        ValueError
            The text is no definition.
        """
        name, fields = parse_format(payload)
        if name not in self._formats:
            self._formats[name] = fields
            for waiting in self._waiting.pop(name, ()):
                del self._faults[waiting]

    def size(self, name: str) -> MessageSize:
        """Size of a topic's data messages.

        Raises
        ------
        ValueError
            A definition is missing, too large, nested without end, or has two fields of one name.
        """
        if name in self._faults:
            raise ValueError(self._faults[name])
        try:
            return self._size(name, 0)
        except ValueError as error:
            self._faults[name] = str(error)
            if isinstance(error, _UndefinedError):
                self._waiting.setdefault(error.name, []).append(name)
            raise

    def _size(self, name: str, depth: int) -> MessageSize:
        known = self._sizes.get(name)
        if known is None:
            if name not in self._formats:
                raise _UndefinedError(name)
            if depth > _DEEPEST_NESTING:
                raise ValueError(f"{name} is nested without end")
            known = self._sizes[name] = self._sum(name, depth)
        return known

    def _sum(self, name: str, depth: int) -> MessageSize:
        fields = self._formats[name]
        if len({field.name for field in fields}) != len(fields):
            raise ValueError(f"{name} has two fields of one name")
        size, columns, deepest = 0, 0, 0
        for field in fields:
            one = self._field_size(field, depth)
            count = field.length or 1
            size, columns, deepest = size + count * one.size, columns + count * one.columns, max(deepest, one.depth)
        if size > _LONGEST_MESSAGE or columns > _MOST_COLUMNS:
            raise ValueError(f"{name} is longer than any record")
        if deepest > _DEEPEST_NESTING:
            raise ValueError(f"{name} is nested too deep")
        return MessageSize(size, columns, deepest)

    def _field_size(self, field: Field, depth: int) -> MessageSize:
        """Size of one element of a field."""
        if field.type_name in _SIZES:
            return MessageSize(_SIZES[field.type_name], 1, 0)
        nested = self._size(field.type_name, depth + 1)
        return nested._replace(depth=nested.depth + 1)

    def padding(self, name: str) -> int:
        """Bytes of padding at the end of a topic's data messages, which the logger leaves out.

        Raises
        ------
        ValueError
            As `size`, or the topic has no time stamp.
        """
        if name in self._paddings:
            return self._paddings[name]
        self.size(name)
        fields = self._formats[name]
        if not any((field.type_name, field.name) == ("uint64_t", "timestamp") and not field.length for field in fields):
            self._faults[name] = f"{name} has no time stamp"
            raise ValueError(self._faults[name])
        found = 0
        for field in reversed(fields):
            one = self._field_size(field, 0)
            if one.columns and not field.name.startswith(_PADDING):
                break
            found += (field.length or 1) * one.size
        self._paddings[name] = found
        return found

    def layout(self, name: str) -> MessageLayout:
        """Layout of a topic's data messages, nested definitions flattened: ``esc[0].esc_rpm``.

        Raises
        ------
        ValueError
            As `padding`.
        """
        self.padding(name)
        columns = list(self._columns("", name))
        while columns and columns[-1][0].startswith(_PADDING):
            columns.pop()
        dtype = np.dtype([(column, _TYPES[type_name]) for column, type_name in columns])
        return MessageLayout(dtype, frozenset(column for column, type_name in columns if type_name == "bool"))

    def _columns(self, prefix: str, name: str) -> Iterator[tuple[str, str]]:
        for field in self._formats[name]:
            nested = field.type_name not in _TYPES
            if nested and not self._sizes[field.type_name].columns:
                continue
            places = [""] if not field.length else [f"[{index}]" for index in range(field.length)]
            for place in places:
                column = f"{prefix}{field.name}{place}"
                if nested:
                    yield from self._columns(f"{column}.", field.type_name)
                else:
                    yield column, field.type_name


def is_padding(column: str) -> bool:
    """Whether a column only fills space."""
    return _PADDING in column
