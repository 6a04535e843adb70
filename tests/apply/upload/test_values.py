"""Bits of parameters, through pymavlink's own packing and parsing."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from fusetune.apply.upload import wire
from fusetune.apply.upload.values import MAV_PARAM_TYPES, Type, Value


class Told(common.MAVLink_param_value_message):
    """PARAM_VALUE of given bits."""

    unpacker = struct.Struct("<IHH16sB")


@given(st.integers(0, 2**32 - 1), st.sampled_from(["INT32", "FLOAT"]), st.booleans())
def test_every_pattern_of_bits_arrives_as_it_was_sent(bits: int, type_name: Type, old_protocol: bool) -> None:
    """Both ways, in MAVLink 1 and 2; 0x7f800001, a signalling NaN, is what a Python float does not carry."""
    for one in (Value(type_name, bits), Value(type_name, 0x7F800001), Value(type_name, bits & 0xFF)):
        sent = wire.param_set(1, 1, "EKF2_GPS_CHECK", one, "bytewise")
        data = sent.pack(common.MAVLink(None), force_mavlink1=old_protocol)
        [parsed] = wire.coder().parse_buffer(data)
        assert (parsed.param_id, parsed.param_type) == ("EKF2_GPS_CHECK", MAV_PARAM_TYPES[type_name])
        assert wire.field_bits(parsed) == one.bits
        told = Told(b"EKF2_GPS_CHECK", one.bits, MAV_PARAM_TYPES[type_name], 9, 3)
        [parsed] = wire.coder().parse_buffer(told.pack(common.MAVLink(None), force_mavlink1=old_protocol))
        assert wire.received_value(parsed, "bytewise") == one


@given(st.integers(-(2**24), 2**24))
def test_a_cast_holds_whole_numbers_up_to_two_to_the_24(number: int) -> None:
    [parsed] = wire.coder().parse_buffer(
        wire.param_set(1, 1, "EKF2_HGT_REF", Value.of("INT32", number), "cast").pack(common.MAVLink(None))
    )
    assert parsed.param_value == float(number)
    assert wire.received_value(parsed, "cast") == Value.of("INT32", number)


def test_a_cast_that_would_change_a_number_is_refused() -> None:
    """2^24 + 1 is the first whole number without a float32."""
    with pytest.raises(ValueError, match="16777217"):
        wire.param_set(1, 1, "EKF2_MAGBIAS_ID", Value.of("INT32", 2**24 + 1), "cast")


def test_equal_is_to_the_bit_and_the_same_number_is_not() -> None:
    plus, minus = Value.of("FLOAT", 0.0), Value.of("FLOAT", -0.0)
    assert plus != minus
    assert plus.is_number(minus)
    nan = Value("FLOAT", 0x7FC00000)
    assert nan == Value("FLOAT", 0x7FC00000)
    assert nan.is_number(nan)
    assert Value.of("FLOAT", 0.1) == Value.of("FLOAT", 0.100000001)
    assert Value.of("FLOAT", 0.1) != Value.of("FLOAT", 0.10000001)
    assert not Value.of("INT32", 0).is_number(plus)
