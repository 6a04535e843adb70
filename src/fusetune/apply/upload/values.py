"""A parameter's value as PX4 holds it and as MAVLink carries it: 32 bits, compared bit by bit.

MAVLink has one float field for the values of all types. PX4 puts the four bytes of an INT32 into it as they are
(MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE); others convert the number (…_C_CAST), which holds whole numbers up to
2^24. Nothing here goes through a Python float where bits count: one made of a float32 that is a signalling NaN, as the
bytes of some INT32 are, comes back as another.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Literal

Type = Literal["INT32", "FLOAT"]
Encoding = Literal["bytewise", "cast"]

MAV_PARAM_TYPES: dict[Type, int] = {"INT32": 6, "FLOAT": 9}
"""MAVLink's MAV_PARAM_TYPE of the two types that PX4 has."""
_EXACT_CAST = 2**24
_UINT, _INT, _FLOAT = struct.Struct("<I"), struct.Struct("<i"), struct.Struct("<f")


@dataclass(frozen=True)
class Value:
    """One value; two are equal where all bits are.

    Attributes
    ----------
    bits : as an unsigned number
    """

    type: Type
    bits: int

    @classmethod
    def of(cls, type_name: Type, number: float | int) -> Value:
        """The value of a number, rounded to a float32 where it is one; raises `struct.error` or `OverflowError` where
        it does not fit."""
        packed = _INT.pack(int(number)) if type_name == "INT32" else _FLOAT.pack(number)
        return cls(type_name, _UINT.unpack(packed)[0])

    @property
    def number(self) -> float | int:
        """What it means."""
        packed = _UINT.pack(self.bits)
        return _INT.unpack(packed)[0] if self.type == "INT32" else _FLOAT.unpack(packed)[0]

    def is_number(self, other: Value) -> bool:
        """Whether both mean the same: as equal bits, but for the two zeros of a float."""
        return self == other or (self.type == other.type == "FLOAT" and self.number == other.number)

    def __str__(self) -> str:
        return str(self.number) if self.type == "INT32" else f"{self.number:.7g}"


def bits_to_send(value: Value, encoding: Encoding) -> int:
    """Bits of MAVLink's float field for a value; raises `ValueError` where a cast would change it."""
    if value.type == "FLOAT" or encoding == "bytewise":
        return value.bits
    if abs(value.number) > _EXACT_CAST:
        raise ValueError(f"{value} has no exact float32")
    return Value.of("FLOAT", value.number).bits


def value_received(mav_type: int, field_bits: int, encoding: Encoding) -> Value | None:
    """The value in MAVLink's float field; None where it is of no type that PX4 has, or no whole number."""
    if mav_type == MAV_PARAM_TYPES["FLOAT"]:
        return Value("FLOAT", field_bits)
    if mav_type != MAV_PARAM_TYPES["INT32"]:
        return None
    if encoding == "bytewise":
        return Value("INT32", field_bits)
    number = Value("FLOAT", field_bits).number
    if not math.isfinite(number) or number != int(number) or not -(2**31) <= number < 2**31:
        return None
    return Value.of("INT32", number)
