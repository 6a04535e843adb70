"""A ULog file as a list of records that can be changed and put together again."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np
from benchmarks.damage_cases import records_of

HEADER_BYTES = 16
_SIZES = {"uint8_t": 1, "bool": 1, "int32_t": 4, "uint32_t": 4, "float": 4, "uint64_t": 8, "double": 8}


def record(kind: str, payload: bytes) -> bytes:
    return struct.pack("<Hc", len(payload), kind.encode()) + payload


def definition(name: str, fields: str) -> bytes:
    return record("F", f"{name}:{fields}".encode())


def subscription(message_id: int, name: str, instance: int = 0) -> bytes:
    return record("A", struct.pack("<BH", instance & 0xFF, message_id & 0xFFFF) + name.encode())


def data(message_id: int, timestamp: int, rest: bytes = b"") -> bytes:
    return record("D", struct.pack("<HQ", message_id & 0xFFFF, timestamp & (1 << 64) - 1) + rest)


def key_value(kind: str, key: str, value: bytes, before: bytes = b"") -> bytes:
    return record(kind, before + bytes([len(key) & 0xFF]) + key.encode()[:255] + value)


def parameter(name: str, value: float | int) -> bytes:
    if isinstance(value, int):
        return key_value("P", f"int32_t {name}", struct.pack("<i", value))
    return key_value("P", f"float {name}", struct.pack("<f", value))


@dataclass
class Parts:
    """Header, and the records up to the first datum and from there on, each with its head."""

    header: bytes
    definitions: list[bytes]
    data: list[bytes]
    tail: bytes = b""
    """Bytes behind the last record."""
    formats: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    """Fields of the sound definitions: type and name, arrays by element."""
    topics: dict[int, str] = field(default_factory=dict)
    """Sound message ids."""

    @classmethod
    def of(cls, content: bytes) -> Parts:
        records = [content[begin:end] for begin, end in records_of(content)]
        first = next(index for index, one in enumerate(records) if one[2:3] == b"D")
        parts = cls(content[:HEADER_BYTES], records[:first], records[first:])
        for one in parts.definitions:
            if one[2:3] == b"F":
                name, _, fields = one[3:].decode().partition(":")
                parts.formats[name] = [(text.split()[0], text.split()[1]) for text in fields.split(";") if text]
            elif one[2:3] == b"A":
                parts.topics[int.from_bytes(one[4:6], "little")] = one[6:].decode()
        return parts

    def copy(self) -> Parts:
        return Parts(self.header, list(self.definitions), list(self.data), self.tail, self.formats, self.topics)

    def content(self) -> bytes:
        return b"".join([self.header, *self.definitions, *self.data, self.tail])

    def message_id(self, topic: str) -> int:
        return next(message_id for message_id, name in self.topics.items() if name == topic)

    def rows(self, message_id: int) -> list[int]:
        """Places of a topic's messages among the data."""
        head = message_id.to_bytes(2, "little")
        return [index for index, one in enumerate(self.data) if one[2:3] == b"D" and one[3:5] == head]

    def messages(self, message_id: int) -> tuple[list[int], np.ndarray]:
        """Places and contents, as a structured array, of a topic's messages of the sound length."""
        columns = []
        for type_name, name in self.formats[self.topics[message_id]]:
            base, _, length = type_name.rstrip("]").partition("[")
            code = {"float": "<f4", "double": "<f8", "bool": "u1"}.get(base) or f"<u{_SIZES[base]}"
            columns += [(f"{name}{index}" if length else name, code) for index in range(int(length or 1))]
        dtype = np.dtype(columns)
        places = [place for place in self.rows(message_id) if len(self.data[place]) == 5 + dtype.itemsize]
        return places, np.frombuffer(b"".join(self.data[place][5:] for place in places), dtype).copy()

    def replace(self, message_id: int, places: list[int], messages: np.ndarray) -> None:
        for place, message in zip(places, messages, strict=True):
            self.data[place] = record("D", message_id.to_bytes(2, "little") + message.tobytes())
