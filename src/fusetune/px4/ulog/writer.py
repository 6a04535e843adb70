"""Writing a flight as a ULog file that PX4's tools read.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. Records are put together as NumPy arrays, one
per topic, and moved to their place in time all at once; equal flights give equal bytes.
"""

from __future__ import annotations

import os
import re
import struct
from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import Flight, ParameterValue, TopicKey, TopicTable
from fusetune.storage.files import atomic_path

_MAGIC = b"ULog\x01\x12\x35"
_FILE_VERSION = 1
_HAS_DEFAULT_PARAMETERS = 1
_SYSTEM_DEFAULT_BIT, _CURRENT_SETUP_BIT = 1, 2
_ROWS_AT_ONCE = 16384
_LEVELS = ("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING", "NOTICE", "INFO", "DEBUG")
_LONGEST_RECORD = 0xFFFF
_ARRAY_FIELD = re.compile(r"(.+)\[(\d+)\]$")
_FIELD_NAME = re.compile(r"[A-Za-z_]\w*")
_TYPE_NAMES = {
    "b1": "bool",
    "i1": "int8_t",
    "u1": "uint8_t",
    "i2": "int16_t",
    "u2": "uint16_t",
    "i4": "int32_t",
    "u4": "uint32_t",
    "i8": "int64_t",
    "u8": "uint64_t",
    "f4": "float",
    "f8": "double",
}


@dataclass(frozen=True)
class _Field:
    """One field of a message definition; `columns` has several entries for an array field."""

    name: str
    dtype: np.dtype
    columns: tuple[str, ...]
    is_array: bool

    @property
    def definition(self) -> str:
        length = f"[{len(self.columns)}]" if self.is_array else ""
        return f"{_TYPE_NAMES[self.dtype.str[1:]]}{length} {self.name};"


@dataclass(frozen=True)
class _Records:
    """Records of equal length with the times that order them."""

    timestamps: np.ndarray
    content: np.ndarray
    """(records, bytes) uint8."""


def write_ulog(path: str | os.PathLike[str], flight: Flight) -> None:
    """Write a flight as ULog.

    Topics become data messages in time order; array columns ``"q[0]"``, ``"q[1]"``… become one array field, and fields
    are ordered by size as PX4 does, so no padding is needed. A column's dtype gives the ULog type; int64 columns
    named ``timestamp*`` become ``uint64_t``. Dropouts, logged messages and changed parameters are put at their times,
    after the data of the same microsecond.

    Raises
    ------
    ValueError
        A topic has no `timestamp`, columns of different lengths, a dtype that ULog does not know, or nested fields.
    """
    formats, subscriptions, records = _data_section(flight.topics)
    parts = [_header(flight.start_timestamp), _flag_bits(flight)]
    parts += formats
    parts += _information(flight)
    parts += _parameters(flight)
    parts += subscriptions
    parts.append(_in_time_order([*records, *_events(flight)]))
    with atomic_path(path) as temporary:
        temporary.write_bytes(b"".join(parts))


def _record(kind: bytes, content: bytes) -> bytes:
    if len(content) > _LONGEST_RECORD:
        raise ValueError(f"ULog record of {len(content)} bytes is too long")
    return struct.pack("<Hc", len(content), kind) + content


def _header(start_timestamp: int) -> bytes:
    return _MAGIC + struct.pack("<BQ", _FILE_VERSION, start_timestamp)


def _flag_bits(flight: Flight) -> bytes:
    has_defaults = flight.parameters.default_system or flight.parameters.default_current_setup
    compatible = bytes([_HAS_DEFAULT_PARAMETERS if has_defaults else 0]) + bytes(7)
    return _record(b"B", compatible + bytes(8) + bytes(24))


def _key_value(key_type: str, key: str, value: bytes) -> bytes:
    name = f"{key_type} {key}".encode()
    return bytes([len(name)]) + name + value


def _information(flight: Flight) -> list[bytes]:
    records = [_record(b"I", _key_value(*_typed(key, value))) for key, value in sorted(flight.info.items())]
    for key, entries in sorted(flight.multi_info.items()):
        for entry in entries:
            text = entry.encode()
            records.append(_record(b"M", b"\0" + _key_value(f"char[{len(text)}]", key, text)))
    return records


def _typed(key: str, value: object) -> tuple[str, str, bytes]:
    """ULog type, key and bytes of an information value."""
    if isinstance(value, str):
        text = value.encode()
        return f"char[{len(text)}]", key, text
    if isinstance(value, bytes | bytearray):
        return f"uint8_t[{len(value)}]", key, bytes(value)
    if isinstance(value, bool):
        return "bool", key, struct.pack("<?", value)
    if isinstance(value, int):
        if 0 <= value < 1 << 32:
            return "uint32_t", key, struct.pack("<I", value)
        return ("uint64_t", key, struct.pack("<Q", value)) if value > 0 else ("int32_t", key, struct.pack("<i", value))
    if isinstance(value, float):
        return "float", key, struct.pack("<f", value)
    raise ValueError(f"information {key!r}: ULog has no type for {type(value).__name__}")


def _parameter(name: str, value: ParameterValue) -> bytes:
    if isinstance(value, int):
        return _key_value("int32_t", name, struct.pack("<i", value))
    return _key_value("float", name, struct.pack("<f", value))


def _parameters(flight: Flight) -> list[bytes]:
    history = flight.parameters
    records = [_record(b"P", _parameter(name, value)) for name, value in sorted(history.initial.items())]
    defaults = [(_SYSTEM_DEFAULT_BIT, history.default_system), (_CURRENT_SETUP_BIT, history.default_current_setup)]
    for bit, values in defaults:
        records += [_record(b"Q", bytes([bit]) + _parameter(name, value)) for name, value in sorted(values.items())]
    return records


def _data_section(topics: dict[TopicKey, TopicTable]) -> tuple[list[bytes], list[bytes], list[_Records]]:
    formats: dict[str, tuple[_Field, ...]] = {}
    subscriptions, records = [], []
    for message_id, ((topic, instance), table) in enumerate(sorted(topics.items())):
        fields = _fields(topic, table)
        if formats.setdefault(topic, fields) != fields:
            raise ValueError(f"topic {topic}: the fields of instance {instance} differ from those of another instance")
        subscriptions.append(_record(b"A", struct.pack("<BH", instance, message_id) + topic.encode()))
        records.append(_data_records(message_id, fields, table))
    definitions = [
        _record(b"F", f"{topic}:{''.join(field.definition for field in fields)}".encode())
        for topic, fields in formats.items()
    ]
    return definitions, subscriptions, records


def _fields(topic: str, table: TopicTable) -> tuple[_Field, ...]:
    """Fields of a topic in the order PX4 lays them out: `timestamp`, then from the largest type to the smallest."""
    if "timestamp" not in table:
        raise ValueError(f"topic {topic} has no timestamp")
    grouped: dict[str, list[str]] = {}
    for column in table:
        array = _ARRAY_FIELD.match(column)
        grouped.setdefault(array[1] if array else column, []).append(column)
    fields = [_field(topic, name, columns, table) for name, columns in grouped.items()]
    return tuple(sorted(fields, key=lambda field: (field.name != "timestamp", -field.dtype.itemsize)))


def _field(topic: str, name: str, columns: list[str], table: TopicTable) -> _Field:
    if not _FIELD_NAME.fullmatch(name):
        raise ValueError(f"topic {topic}: {name!r} is no plain field (nested message types are not written)")
    is_array = columns != [name]
    if is_array:
        columns = [f"{name}[{index}]" for index in range(len(columns))]
    dtypes = {table[column].dtype for column in columns if column in table}
    if len(dtypes) != 1 or any(column not in table for column in columns):
        raise ValueError(f"topic {topic}: the columns of {name} do not form one array")
    dtype = np.dtype(dtypes.pop()).newbyteorder("<")
    if dtype.kind == "i" and dtype.itemsize == 8 and name.startswith("timestamp"):
        dtype = np.dtype("<u8")
    if dtype.str[1:] not in _TYPE_NAMES:
        raise ValueError(f"topic {topic}: ULog has no type for {name} ({dtype})")
    return _Field(name, dtype, tuple(columns), is_array)


def _data_records(message_id: int, fields: tuple[_Field, ...], table: TopicTable) -> _Records:
    columns = {f"column {column}": field.dtype for field in fields for column in field.columns}
    dtype = np.dtype([("size", "<u2"), ("kind", "u1"), ("id", "<u2"), *columns.items()])
    rows = len(table["timestamp"])
    records = np.empty(rows, dtype)
    records["size"], records["kind"], records["id"] = dtype.itemsize - 3, ord("D"), message_id
    for field in fields:
        for column in field.columns:
            if table[column].shape != (rows,):
                raise ValueError(f"column {column} has shape {table[column].shape}, expected ({rows},)")
            records[f"column {column}"] = table[column]
    return _Records(np.asarray(table["timestamp"], np.int64), records.view(np.uint8).reshape(rows, dtype.itemsize))


def _events(flight: Flight) -> list[_Records]:
    """Dropouts, logged messages and changed parameters, one record each."""
    events = [
        (message.timestamp, _record(b"L", struct.pack("<BQ", _level(message.level), message.timestamp) + text))
        for message in flight.messages
        for text in [message.text.encode()]
    ]
    events += [(drop.timestamp, _record(b"O", struct.pack("<H", drop.duration_ms))) for drop in flight.dropouts]
    events += [
        (change.timestamp, _record(b"P", _parameter(change.name, change.value))) for change in flight.parameters.changed
    ]
    return [
        _Records(np.array([time], np.int64), np.frombuffer(content, np.uint8)[np.newaxis]) for time, content in events
    ]


def _level(name: str) -> int:
    return ord("0") + (_LEVELS.index(name) if name in _LEVELS else _LEVELS.index("INFO"))


def _in_time_order(groups: list[_Records]) -> bytes:
    """All records by time; equal times keep the order of the groups, so data comes before events."""
    groups = [group for group in groups if len(group.timestamps)]
    if not groups:
        return b""
    times = np.concatenate([group.timestamps for group in groups])
    lengths = np.repeat([group.content.shape[1] for group in groups], [len(group.timestamps) for group in groups])
    order = np.argsort(times, kind="stable")
    offsets = np.empty(len(times), np.int64)
    offsets[order] = np.cumsum(lengths[order]) - lengths[order]
    section = np.empty(int(lengths.sum()), np.uint8)
    first = 0
    for group in groups:
        _place(section, offsets[first : first + len(group.timestamps)], group.content)
        first += len(group.timestamps)
    return section.tobytes()


def _place(section: np.ndarray, offsets: np.ndarray, content: np.ndarray) -> None:
    """Copy records of equal length to their offsets, some thousand at a time to bound the index arrays."""
    within = np.arange(content.shape[1])
    for start in range(0, len(offsets), _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        section[offsets[rows, np.newaxis] + within] = content[rows]
