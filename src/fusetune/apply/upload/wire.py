"""MAVLink's messages by pymavlink, and the one thing that it cannot do: a float field of given bits.

The module cannot be imported where pymavlink is missing; `require_pymavlink` says so first.
"""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import common

from fusetune.apply.upload.values import MAV_PARAM_TYPES, Encoding, Value, bits_to_send, value_received

OUR_SYSTEM, OUR_COMPONENT = 255, common.MAV_COMP_ID_MISSIONPLANNER
"""A ground station's ids, as QGroundControl has them."""
HASH_CHECK = "_HASH_CHECK"
"""Under this name PX4 gives a CRC-32 of all its parameters."""
MAV_CMD_REQUEST_MESSAGE = common.MAV_CMD_REQUEST_MESSAGE
_VALUE_BYTES = 4
_HEADER_BYTES = {0xFE: 6, 0xFD: 10}
"""By the first byte of MAVLink 1 and 2; the second is the length of what follows."""


class _ParamSet(common.MAVLink_param_set_message):
    """PARAM_SET whose value is given as bits."""

    unpacker = struct.Struct("<IBB16sB")


class _NoStream:
    def write(self, data: bytes) -> None:
        """Messages are packed by hand."""


def coder() -> Any:
    """What packs our messages, and parses others'; each source of bytes takes one of its own."""
    made = common.MAVLink(_NoStream(), srcSystem=OUR_SYSTEM, srcComponent=OUR_COMPONENT)
    made.robust_parsing = True
    return made


def packed(message: Any, by: Any) -> bytes:
    """A message's bytes, with the next sequence number."""
    data = bytes(message.pack(by))
    by.seq = (by.seq + 1) % 256
    return data


def our_heartbeat() -> Any:
    """That of a ground station."""
    return common.MAVLink_heartbeat_message(common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)


def param_set(system: int, component: int, name: str, value: Value, encoding: Encoding) -> Any:
    """PARAM_SET; raises `ValueError` where the encoding would change the value."""
    return _ParamSet(system, component, name.encode(), bits_to_send(value, encoding), MAV_PARAM_TYPES[value.type])


def param_request_read(system: int, component: int, name: str = "", index: int = -1) -> Any:
    """PARAM_REQUEST_READ, by name or by index."""
    return common.MAVLink_param_request_read_message(system, component, name.encode(), index)


def param_request_list(system: int, component: int) -> Any:
    """PARAM_REQUEST_LIST."""
    return common.MAVLink_param_request_list_message(system, component)


def command(system: int, component: int, number: int, *parameters: float) -> Any:
    """COMMAND_LONG."""
    seven = [*parameters, *[0.0] * (7 - len(parameters))]
    return common.MAVLink_command_long_message(system, component, number, 0, *seven)


def field_bits(message: Any) -> int:
    """Bits of the value of a PARAM_VALUE, whose trailing zero bytes MAVLink 2 leaves out."""
    frame = bytes(message.get_msgbuf())
    start = _HEADER_BYTES[frame[0]]
    value = frame[start : start + min(frame[1], _VALUE_BYTES)]
    return int.from_bytes(value.ljust(_VALUE_BYTES, b"\0"), "little")


def received_value(message: Any, encoding: Encoding) -> Value | None:
    """The value of a PARAM_VALUE; None where it is of no type that PX4 has."""
    return value_received(message.param_type, field_bits(message), encoding)


def word(enumeration: str, number: int) -> str:
    """The name that MAVLink has for a number, in plain letters: "value out of range"."""
    entry = common.enums[enumeration].get(number)
    if entry is None:
        return f"{enumeration} {number}"
    return str(entry.name).removeprefix(f"{enumeration}_").replace("_", " ").lower()
