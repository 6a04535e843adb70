"""A vehicle's parameters by MAVLink's parameter protocol: all of them, one, its checksum of them, and saving.

Facts of the protocol: https://mavlink.io/en/services/parameter.html, and PX4's `mavlink_parameters.cpp`. A vehicle
answers PARAM_SET with PARAM_VALUE, the old value where it did not take the new one, and newer ones with PARAM_ERROR
besides; that of a name unknown to it PX4 answers with a text, if at all. PX4 begins a list with `_HASH_CHECK`, whose
value is a CRC-32 over names and values of all its parameters but those that it calls volatile.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fusetune.apply.upload import wire
from fusetune.apply.upload.conversation import Conversation
from fusetune.apply.upload.stops import NoAnswer, Stopped
from fusetune.apply.upload.values import Encoding, Value
from fusetune.apply.upload.wire import HASH_CHECK, common

_MOST_ASKED_AT_ONCE = 20
_ALL_BITS = 0xFFFFFFFF

VOLATILE = frozenset({
    "COM_FLIGHT_UUID", "LND_FLIGHT_T_HI", "LND_FLIGHT_T_LO", "EKF2_MAG_DECL", "EKF2_MAGBIAS_X", "EKF2_MAGBIAS_Y",
    "EKF2_MAGBIAS_Z", "EKF2_MAGBIAS_ID",
})  # fmt: skip
"""Parameters that PX4 itself writes in flight; some releases leave some of them out of their checksum."""


@dataclass
class Listing:
    """All parameters of a vehicle.

    Attributes
    ----------
    values : by name, in the vehicle's order
    checksum : the vehicle's own, `_HASH_CHECK`; None where it gives none
    """

    values: dict[str, Value] = field(default_factory=dict)
    checksum: int | None = None

    @property
    def agrees(self) -> bool | None:
        """Whether the vehicle's checksum is that of the values; None where that is not known."""
        return True if self._counted is not None else None

    def is_changed_only_by(self, changes: Mapping[str, Value], checksum: int | None) -> bool | None:
        """Whether a later checksum of the vehicle is that of these values with some changed; None where the values'
        own one was not understood."""
        if checksum is None or self._counted is None:
            return None
        return checksum == checksum_of(self._counted | dict(changes))

    @property
    def _counted(self) -> dict[str, Value] | None:
        """The values that the vehicle's checksum counts, where they make it."""
        stable = {name: value for name, value in self.values.items() if name not in VOLATILE}
        return next((one for one in (self.values, stable) if checksum_of(one) == self.checksum), None)


def checksum_of(values: Mapping[str, Value]) -> int:
    """PX4's `param_hash_check` of parameters in the vehicle's order: CRC-32 as NuttX's `crc32part` makes it, which
    inverts neither before nor after."""
    data = b"".join(name.encode() + value.bits.to_bytes(4, "little") for name, value in values.items())
    return zlib.crc32(data, _ALL_BITS) ^ _ALL_BITS


class ParameterServer:
    """The parameters of the vehicle that is talked with.

    Parameters
    ----------
    encoding : how it puts whole numbers into the float field
    """

    def __init__(self, talk: Conversation, encoding: Encoding) -> None:
        self._talk = talk
        self.encoding = encoding

    @property
    def _address(self) -> tuple[int, int]:
        return self._talk.partner.system, self._talk.partner.component

    def read(self, name: str) -> Value:
        """The present value of a parameter, asked for by name.

        Raises
        ------
        NoAnswer
            There is no such parameter, or it is of a type that PX4 does not have.
        """
        self._talk.catch_up()
        answer = self._talk.ask(
            lambda: wire.param_request_read(*self._address, name),
            lambda message: _is_about(message, name) and not _is_about_writing(message),
            f"the value of {name}",
        )
        if answer.get_type() == "PARAM_ERROR":
            raise NoAnswer(f"the vehicle refuses to tell {name}: {wire.word('MAV_PARAM_ERROR', answer.error)}")
        value = wire.received_value(answer, self.encoding)
        if value is None:
            raise NoAnswer(f"the vehicle tells {name} in a type that is not known")
        return value

    def set_once(self, name: str, value: Value, wait_s: float) -> str | None:
        """Send one PARAM_SET, and wait for what the vehicle says to it.

        Returns
        -------
        str or None
            What speaks against the value; None where it took it, or said nothing. What it holds is only known by
            reading it: an answer may be a late one to another question.
        """
        against = None
        self._talk.send(wire.param_set(*self._address, name, value, self.encoding))
        for message in self._talk.listen(wait_s):
            if not _is_about(message, name):
                continue
            if message.get_type() == "PARAM_ERROR":
                return wire.word("MAV_PARAM_ERROR", message.error)
            echoed = wire.received_value(message, self.encoding)
            if echoed == value:
                return None
            against = f"it answers with {echoed}"
        return against

    def checksum(self) -> int | None:
        """PX4's checksum of all parameters; None where the vehicle gives none."""
        try:
            answer = self._talk.ask(
                lambda: wire.param_request_read(*self._address, HASH_CHECK),
                lambda message: message.get_type() == "PARAM_VALUE" and message.param_id == HASH_CHECK,
                "its checksum of all parameters",
                attempts=5,
            )
        except Stopped:
            return None
        return wire.field_bits(answer)

    def save(self) -> None:
        """Have the parameters written to the vehicle's storage.

        PX4 does so by itself after a change, and says yes before it has done it.

        Raises
        ------
        NoAnswer
            It does not say that it will.
        """
        number = common.MAV_CMD_PREFLIGHT_STORAGE
        answer = self._talk.ask(
            lambda: wire.command(*self._address, number, 1.0, -1.0, -1.0),
            lambda message: (
                message.get_type() == "COMMAND_ACK"
                and message.command == number
                and message.result != common.MAV_RESULT_IN_PROGRESS
            ),
            "that it saves its parameters",
        )
        if answer.result != common.MAV_RESULT_ACCEPTED:
            raise NoAnswer(f"the vehicle does not save its parameters: {wire.word('MAV_RESULT', answer.result)}")

    def all(self) -> Listing:
        """Every parameter: listed, and what got lost asked for by its place in the list.

        Raises
        ------
        NoAnswer
            Some cannot be had, or the list keeps changing.
        """
        for _ in range(self._talk.pace.passes):
            before = self.checksum()
            self._talk.notes_values = False
            try:
                listed = self._list()
            finally:
                self._talk.notes_values = True
            if listed is not None and self.checksum() == before:
                return Listing(listed, before)
        raise NoAnswer("the vehicle's parameters keep changing while they are read")

    def _list(self) -> dict[str, Value] | None:
        """One listing; None where the vehicle's number of parameters changed meanwhile."""
        gathered = _Gathered(self.encoding)
        self._talk.send(wire.param_request_list(*self._address))
        self._gather(gathered, self._talk.pace.quiet_s)
        in_vain = 0
        while not gathered.is_whole:
            if gathered.changed:
                return None
            if in_vain > self._talk.pace.attempts:
                raise NoAnswer(f"{len(gathered.missing()) or 'all'} of the vehicle's parameters cannot be had")
            self._talk.see_that_it_is_there("its parameters")
            self._talk.retries += 1
            before, heard = len(gathered.values), self._talk.partner.heartbeats
            if gathered.count == 0:
                self._talk.send(wire.param_request_list(*self._address))
            for index in gathered.missing()[:_MOST_ASKED_AT_ONCE]:
                self._talk.send(wire.param_request_read(*self._address, index=index))
            self._gather(gathered, self._talk.pace.answer_s)
            in_vain = 0 if len(gathered.values) > before else in_vain + (self._talk.partner.heartbeats > heard)
        return None if gathered.changed else gathered.in_order()

    def _gather(self, gathered: _Gathered, quiet_s: float) -> None:
        """Take values until none is missing, or none came for so long."""
        last_s = time.monotonic()
        while time.monotonic() - last_s < quiet_s:
            for message in self._talk.listen(quiet_s / 4):
                if message.get_type() == "PARAM_VALUE" and gathered.take(message):
                    last_s = time.monotonic()
                    if gathered.is_whole:
                        return


class _Gathered:
    """What of a list has come: values by index."""

    def __init__(self, encoding: Encoding) -> None:
        self._encoding = encoding
        self.count = 0
        self.values: dict[int, tuple[str, Value]] = {}
        self.changed = False

    def take(self, message: Any) -> bool:
        """Take a PARAM_VALUE; whether it was one that was missing."""
        name, index = message.param_id, message.param_index
        if name == HASH_CHECK or index >= message.param_count:
            return False
        if self.count and message.param_count != self.count:
            self.changed = True
        self.count = message.param_count
        value = wire.received_value(message, self._encoding)
        if value is None:
            raise NoAnswer(f"the vehicle tells {name} in a type that PX4 does not have")
        known = self.values.get(index)
        if known is not None and known != (name, value):
            self.changed = True
        self.values[index] = (name, value)
        return known is None

    @property
    def is_whole(self) -> bool:
        """Whether none is missing."""
        return 0 < self.count <= len(self.values)

    def missing(self) -> list[int]:
        """Indices that have not come."""
        return [index for index in range(self.count) if index not in self.values]

    def in_order(self) -> dict[str, Value]:
        """By name, in the order of the list."""
        return {name: value for _, (name, value) in sorted(self.values.items())}


def _is_about_writing(message: Any) -> bool:
    """Whether it is an error that no reading has: a late one, of a PARAM_SET before."""
    return message.get_type() == "PARAM_ERROR" and message.error != common.MAV_PARAM_ERROR_DOES_NOT_EXIST


def _is_about(message: Any, name: str) -> bool:
    return message.get_type() in ("PARAM_VALUE", "PARAM_ERROR") and message.param_id == name
