"""A talk with one vehicle over a link: messages go out and come in, and the vehicle's state is watched all the while.

Whoever waits for an answer waits here, so that no heartbeat passes unseen: while the talk is guarded, one that says
armed, or a word that the vehicle is in the air, ends whatever was waited for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from fusetune.apply.upload import wire
from fusetune.apply.upload.links import Link, Source
from fusetune.apply.upload.pace import Pace
from fusetune.apply.upload.stops import Armed, LinkLost, NoAnswer
from fusetune.apply.upload.transcript import Transcript
from fusetune.apply.upload.wire import common

_TOLD = frozenset({"AUTOPILOT_VERSION", "COMMAND_ACK", "HEARTBEAT", "PARAM_ERROR", "PARAM_VALUE", "STATUSTEXT"})
"""Messages of the vehicle whose arrival the transcript holds."""
_ADDRESSES = ("target_system", "target_component", "confirmation")
_IN_THE_AIR = {
    common.MAV_LANDED_STATE_IN_AIR: "is in the air",
    common.MAV_LANDED_STATE_TAKEOFF: "takes off",
    common.MAV_LANDED_STATE_LANDING: "lands",
}


@dataclass
class Station:
    """A component that sends heartbeats.

    Attributes
    ----------
    source, system, component : where it is heard, and its MAVLink ids
    type, autopilot : MAV_TYPE, MAV_AUTOPILOT
    heard_s : when its last heartbeat came, by `time.monotonic`
    landed : MAV_LANDED_STATE of the last EXTENDED_SYS_STATE; None before one came
    booted_s : when it booted, by `time.monotonic`; None before it was told
    reboots : how often that moved
    """

    source: Source
    system: int
    component: int
    type: int
    autopilot: int
    armed: bool
    heard_s: float
    heartbeats: int = 0
    landed: int | None = None
    booted_s: float | None = None
    reboots: int = 0

    @property
    def is_vehicle(self) -> bool:
        """Whether it is an autopilot: no ground station, companion, camera or gimbal."""
        return (
            self.component == common.MAV_COMP_ID_AUTOPILOT1
            and self.autopilot != common.MAV_AUTOPILOT_INVALID
            and self.type not in (common.MAV_TYPE_GCS, common.MAV_TYPE_ONBOARD_CONTROLLER)
        )

    @property
    def flies(self) -> str:
        """What speaks against writing: in words, empty where nothing does."""
        return "is armed" if self.armed else _IN_THE_AIR.get(self.landed or 0, "")


class Conversation:
    """See the module.

    Parameters
    ----------
    link : is closed by who opened it

    Attributes
    ----------
    retries : how often something was asked again
    notes_values : whether the transcript holds the values that come; not while all of them are listed
    """

    def __init__(self, link: Link, pace: Pace, transcript: Transcript) -> None:
        self.pace = pace
        self.transcript = transcript
        self.stations: dict[tuple[Source, int, int], Station] = {}
        self.retries = 0
        self.notes_values = True
        self._link = link
        self._coder = wire.coder()
        self._parsers: dict[Source, Any] = {}
        self._partner: Station | None = None
        self._guarded = False
        self._beaten_s = float("-inf")

    @property
    def partner(self) -> Station:
        """The vehicle that is talked with."""
        if self._partner is None:
            raise RuntimeError("no vehicle is chosen")
        return self._partner

    def talk_to(self, station: Station) -> None:
        """Choose the vehicle: from now on only its messages count, and only it is written to."""
        self._partner = station

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Within, `Armed` is raised as soon as a message says that the vehicle is armed or flies."""
        self._guarded = True
        try:
            self._guard()
            yield
        finally:
            self._guarded = False

    def send(self, message: Any) -> None:
        """Send to the vehicle."""
        self.transcript.note(f"> {_words(message)}")
        self._link.send(wire.packed(message, self._coder), self.partner.source)

    def catch_up(self) -> None:
        """Take what has come and waits to be read, so that what comes next is news."""
        for _ in range(100):
            if not self._receive(0.0):
                return

    def listen(self, duration_s: float) -> Iterator[Any]:
        """Messages of the vehicle, or of all while none is chosen, as they come for so long."""
        until = time.monotonic() + duration_s
        while True:
            self._beat()
            left = until - time.monotonic()
            received = self._receive(min(max(left, 0.0), self.pace.heartbeat_s))
            self._guard()
            yield from received
            if left <= 0.0:
                return

    def ask(self, make: Callable[[], Any], is_answer: Callable[[Any], bool], what: str, attempts: int = 0) -> Any:
        """Send a message until one comes that answers it.

        Parameters
        ----------
        make : makes the message anew for each attempt
        what : was asked for, in words
        attempts : those of the pace if 0; only those count during which the vehicle is heard

        Raises
        ------
        NoAnswer
            None came, though the vehicle is heard.
        LinkLost
            It is not heard either.
        """
        wait_s, in_vain = self.pace.answer_s, 0
        while in_vain < (attempts or self.pace.attempts):
            heard = self.partner.heartbeats
            self.send(make())
            for message in self.listen(wait_s):
                if is_answer(message):
                    return message
            self.see_that_it_is_there(what)
            self.retries += 1
            # while nothing at all comes it is no wonder that no answer does
            in_vain += self.partner.heartbeats > heard
            wait_s = min(wait_s * self.pace.longer, self.pace.longest_answer_s)
        raise NoAnswer(f"the vehicle does not answer: {what}")

    def see_that_it_is_there(self, what: str) -> None:
        """Raises `LinkLost` where no heartbeat came for too long."""
        silence_s = time.monotonic() - self.partner.heard_s
        if silence_s > self.pace.lost_s:
            raise LinkLost(f"nothing came from the vehicle for {silence_s:.1f} s ({what})")

    def request_message(self, number: int, is_answer: Callable[[Any], bool], what: str, attempts: int = 0) -> Any:
        """Ask for a message by MAV_CMD_REQUEST_MESSAGE; one that comes by itself will do."""
        system, component = self.partner.system, self.partner.component
        return self.ask(
            lambda: wire.command(system, component, wire.MAV_CMD_REQUEST_MESSAGE, float(number)),
            is_answer,
            what,
            attempts,
        )

    def wait_for_return(self) -> bool:
        """After the link was lost: wait until the vehicle, or one with its ids, is heard again, and talk to that."""
        began_s, lost = time.monotonic(), self.partner
        while time.monotonic() - began_s < self.pace.patience_s:
            for _ in self.listen(self.pace.heartbeat_s):
                pass
            ids = (lost.system, lost.component)
            heard = [one for one in self.stations.values() if one.heard_s > began_s]
            same = [one for one in heard if (one.system, one.component) == ids]
            if same:
                self.talk_to(lost if lost in same else same[0])
                return True
        return False

    def see_that_it_is_disarmed(self) -> None:
        """Wait for a heartbeat that is sent from now on; raises `Armed`, in a guarded talk, where it says so."""
        self.catch_up()
        self.see_that_it_is_there("a heartbeat")
        heard = self.partner.heartbeats
        self.request_message(
            common.MAVLINK_MSG_ID_HEARTBEAT, lambda message: self.partner.heartbeats > heard, "whether it is armed"
        )

    def _guard(self) -> None:
        if self._guarded and self.partner.flies:
            raise Armed(f"the vehicle {self.partner.flies}")

    def _beat(self) -> None:
        now = time.monotonic()
        if now - self._beaten_s >= self.pace.heartbeat_s:
            self._beaten_s = now
            data = wire.packed(wire.our_heartbeat(), self._coder)
            for source in list(self._link.sources):
                self._link.send(data, source)

    def _receive(self, timeout_s: float) -> list[Any]:
        """Messages of the vehicle that is talked with, the state of all taken from what came."""
        received = []
        for source, data in self._link.receive(timeout_s):
            parser = self._parsers.setdefault(source, wire.coder())
            for message in parser.parse_buffer(data) or ():
                if self._heard(source, message):
                    received.append(message)
        return received

    def _heard(self, source: Source, message: Any) -> bool:
        """Take from a message what it says of its sender; whether that is who is talked with."""
        kind, key = message.get_type(), (source, message.get_srcSystem(), message.get_srcComponent())
        if kind == "BAD_DATA":
            return False
        if kind == "HEARTBEAT":
            self._heartbeat(key, message)
        station = self.stations.get(key)
        is_ours = self._partner is None or (station is not None and station is self._partner)
        if station is None:
            return is_ours
        if kind == "EXTENDED_SYS_STATE":
            station.landed = message.landed_state
        elif kind == "SYSTEM_TIME":
            self._boot(station, message.time_boot_ms)
        is_told = kind in _TOLD and (self.notes_values or kind != "PARAM_VALUE")
        if is_ours and is_told and self._partner is not None:
            self.transcript.note(f"< {_words(message)}")
        return is_ours

    def _heartbeat(self, key: tuple[Source, int, int], message: Any) -> None:
        armed = bool(message.base_mode & common.MAV_MODE_FLAG_SAFETY_ARMED)
        station = self.stations.get(key)
        if station is None:
            station = self.stations[key] = Station(*key, message.type, message.autopilot, armed, 0.0)
            self.transcript.note(f"heard system {key[1]} component {key[2]} at {_place(key[0])}: {_words(message)}")
        if station is self._partner and armed != station.armed:
            self.transcript.note("the vehicle is armed" if armed else "the vehicle is disarmed")
        station.armed, station.type, station.autopilot = armed, message.type, message.autopilot
        station.heard_s = time.monotonic()
        station.heartbeats += 1

    def _boot(self, station: Station, uptime_ms: int) -> None:
        booted_s = time.monotonic() - uptime_ms * 1e-3
        if station.booted_s is None:
            station.booted_s = booted_s
        elif abs(booted_s - station.booted_s) > self.pace.reboot_margin_s:
            self.transcript.note(f"the vehicle has rebooted: it counts {uptime_ms * 1e-3:.1f} s since its start")
            station.booted_s = booted_s
            station.reboots += 1


def _words(message: Any) -> str:
    fields = []
    for name in message.get_fieldnames():
        value = getattr(message, name)
        if name in _ADDRESSES or (message.get_type() == "COMMAND_LONG" and value == 0 and name != "param1"):
            continue
        if name == "param_value":
            value = f"0x{_bits(message):08x}"
        elif isinstance(value, list | tuple | bytes | bytearray):
            value = bytes(value).hex()
        fields.append(f"{name}={value}")
    return f"{message.get_type()} {' '.join(fields)}"


def _bits(message: Any) -> int:
    value = message.param_value
    return value if isinstance(value, int) else wire.field_bits(message)


def _place(source: Source) -> str:
    return ":".join(map(str, source)) if isinstance(source, tuple) else str(source)
