"""Records of a ULog file that are no data: information, parameters, texts and dropouts."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import NamedTuple

from fusetune.px4.flight import ParameterValue
from fusetune.px4.ulog.records import Record, Scan
from fusetune.time_limit import Deadline

_LEVELS = ("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING", "NOTICE", "INFO", "DEBUG")
_CODES = {
    "int8_t": "<b",
    "uint8_t": "<B",
    "int16_t": "<h",
    "uint16_t": "<H",
    "int32_t": "<i",
    "uint32_t": "<I",
    "int64_t": "<q",
    "uint64_t": "<Q",
    "float": "<f",
    "double": "<d",
    "bool": "<?",
    "char": "<c",
}
_PARAMETER_TYPES = {"int32_t": struct.Struct("<i"), "float": struct.Struct("<f")}
_SYSTEM_DEFAULT_BIT, _CURRENT_SETUP_BIT = 1, 2


class KeyValue(NamedTuple):
    """A typed value with its name."""

    key: str
    value: object


class Text(NamedTuple):
    """A text that the firmware wrote; time in µs since boot."""

    timestamp: int
    level: str
    text: str


@dataclass
class LoggedValues:
    """All that a file holds beside data. Places are byte offsets in the file, by which the time is found."""

    info: dict[str, object] = field(default_factory=dict)
    multi_info: dict[str, list[list[object]]] = field(default_factory=dict)
    initial_parameters: dict[str, ParameterValue] = field(default_factory=dict)
    default_system: dict[str, ParameterValue] = field(default_factory=dict)
    default_current_setup: dict[str, ParameterValue] = field(default_factory=dict)
    changed_parameters: list[tuple[int, str, ParameterValue]] = field(default_factory=list)
    """Place, name and value."""
    dropouts: list[tuple[int, int]] = field(default_factory=list)
    """Place and duration in ms."""
    texts: list[Text] = field(default_factory=list)
    misfits: int = 0
    """Records whose content is not what their kind says."""


def logged_values(content: bytes, scan: Scan, deadline: Deadline | None = None) -> LoggedValues:
    """Interpret the records that a scan found."""
    values, deadline = LoggedValues(), deadline or Deadline()
    for record in scan.records:
        deadline.check()
        try:
            _interpret(values, chr(record.kind), content[record.begin : record.end], record, scan)
        except (ValueError, IndexError, struct.error):
            values.misfits += 1
    return values


def _interpret(values: LoggedValues, kind: str, payload: bytes, record: Record, scan: Scan) -> None:
    match kind:
        case "I":
            entry = _key_value(payload)
            values.info[entry.key] = entry.value
        case "M":
            entry = _key_value(payload[1:])
            parts = values.multi_info.setdefault(entry.key, [])
            if payload[0] and parts:
                parts[-1].append(entry.value)
            else:
                parts.append([entry.value])
        case "P":
            name, value = _parameter(payload)
            if record.begin < scan.data_begin:
                values.initial_parameters[name] = value
            else:
                values.changed_parameters.append((record.begin, name, value))
        case "Q":
            name, value = _parameter(payload[1:])
            if payload[0] & _SYSTEM_DEFAULT_BIT:
                values.default_system[name] = value
            if payload[0] & _CURRENT_SETUP_BIT:
                values.default_current_setup[name] = value
        case "O":
            values.dropouts.append((record.begin, *struct.unpack("<H", payload)))
        case "L":
            values.texts.append(_text(payload[0], payload[1:]))
        case "C":
            values.texts.append(_text(payload[0], payload[3:]))


def _key_value(payload: bytes) -> KeyValue:
    length = payload[0]
    type_name, _, key = payload[1 : 1 + length].decode("utf-8", "ignore").partition(" ")
    content = payload[1 + length :]
    if not key:
        raise ValueError("a value without a name")
    if type_name.startswith("char["):
        return KeyValue(key, content.decode("utf-8", "ignore"))
    if type_name in _CODES:
        return KeyValue(key, struct.unpack(_CODES[type_name], content)[0])
    return KeyValue(key, content)


def _parameter(payload: bytes) -> tuple[str, ParameterValue]:
    length = payload[0]
    type_name, _, name = payload[1 : 1 + length].decode("utf-8", "ignore").partition(" ")
    if type_name not in _PARAMETER_TYPES or not name:
        raise ValueError("a parameter that is neither INT32 nor FLOAT")
    return name, _PARAMETER_TYPES[type_name].unpack(payload[1 + length :])[0]


def _text(level: int, payload: bytes) -> Text:
    number = level - ord("0")
    name = _LEVELS[number] if 0 <= number < len(_LEVELS) else "UNKNOWN"
    return Text(struct.unpack_from("<Q", payload)[0], name, payload[8:].decode("utf-8", "ignore"))
