"""A vehicle as its ground station sees it: what PX4 does with MAVLink's parameter protocol, and what may go wrong.

It saves changed parameters by itself as PX4 does, 0.3 s after a change and at most every 2 s, and a reboot takes it
back to what was saved.
"""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from benchmarks.upload_trials.air import Air, Schedule
from pymavlink.dialects.v20 import common

TYPES = {"INT32": common.MAV_PARAM_TYPE_INT32, "FLOAT": common.MAV_PARAM_TYPE_REAL32}
_LISTED_AT_ONCE = 10
_UP_BEFORE_S = 100.0


@dataclass
class Faults:
    """What goes wrong; times are the vehicle's own, before `Vehicle.pace`.

    Attributes
    ----------
    armed, in_air : from the start; the landed state is left out where `landed_unknown`
    arm_after_sets, arm_at_s, disarm_after_s : it arms at the PARAM_SET of the n-th parameter or at a time, and disarms
        so much later; 0: never
    reboot_after_sets, reboot_at_s : likewise
    silent_after_sets, silent_s : the link is gone from a PARAM_SET on for so long
    exchanged : another vehicle comes back after the first reboot
    refused : values beyond this size are not taken: the old one is echoed
    refused_name : alone it applies to; empty for all
    error : PARAM_ERROR is sent besides
    no_save_ack : saving is not acknowledged
    no_request_message : MAV_CMD_REQUEST_MESSAGE is not known
    meddle_after_sets, meddled : at a PARAM_SET somebody else gives this parameter the value 0.123
    """

    armed: bool = False
    in_air: bool = False
    landed_unknown: bool = False
    arm_after_sets: int = 0
    arm_at_s: float = 0.0
    disarm_after_s: float = 0.0
    reboot_after_sets: int = 0
    reboot_at_s: float = 0.0
    silent_after_sets: int = 0
    silent_s: float = 0.0
    exchanged: bool = False
    refused: float = float("inf")
    refused_name: str = ""
    error: bool = False
    no_save_ack: bool = False
    no_request_message: bool = False
    meddle_after_sets: int = 0
    meddled: str = ""


@dataclass
class Traits:
    """What a vehicle is.

    Attributes
    ----------
    values : bits of each parameter, with its type
    """

    values: dict[str, tuple[str, int]]
    system: int = 1
    uid: str = "00010000000020343457544e5015003a0043"
    version: int = 0x011000FF
    autopilot: int = common.MAV_AUTOPILOT_PX4
    type: int = common.MAV_TYPE_QUADROTOR
    cast: bool = False
    faults: Faults = field(default_factory=Faults)


class _ParamValue(common.MAVLink_param_value_message):
    """PARAM_VALUE whose value is given as bits."""

    unpacker = struct.Struct("<IHH16sB")


class Vehicle:
    """See the module.

    Parameters
    ----------
    pace : factor of all its times
    down, up : the ways to and from the ground station
    send : gives bytes to the ground station
    """

    def __init__(
        self, traits: Traits, schedule: Schedule, pace: float, down: Air, up: Air, send: Callable[[bytes], None]
    ) -> None:
        self.traits, self.pace = traits, pace
        self.values = dict(sorted(traits.values.items()))
        self.saved = dict(self.values)
        self.sets: list[dict[str, Any]] = []
        self.history: dict[str, list[int]] = {name: [bits] for name, (_, bits) in self.values.items()}
        self.reboots = 0
        self._schedule, self._down, self._up, self._send = schedule, down, up, send
        self._coder = common.MAVLink(None, srcSystem=traits.system, srcComponent=1)
        self._booted_s = time.monotonic() - _UP_BEFORE_S
        self._armed, self._running = traits.faults.armed, True
        self._armed_at_s = time.monotonic()
        self._saved_s, self._saving = float("-inf"), False
        self._uid = traits.uid
        self._life = 0
        self._schedule.after(0.0, self._beat)
        for when_s, do in ((traits.faults.arm_at_s, self._arm), (traits.faults.reboot_at_s, self._reboot)):
            if when_s:
                self._schedule.after(when_s * pace, do)

    def take(self, message: Any) -> None:
        """A message comes from the ground station, if it gets through."""
        self._up.carry(lambda: self._taken(message))

    def _taken(self, message: Any) -> None:
        kind = message.get_type()
        if not self._running or getattr(message, "target_system", 0) != self.traits.system:
            return
        if kind == "PARAM_REQUEST_LIST":
            self._tell_hash()
            self._tell_some(0, self._life)
        elif kind == "PARAM_REQUEST_READ":
            self._asked_for(message)
        elif kind == "PARAM_SET":
            self._set(message)
        elif kind == "COMMAND_LONG":
            self._command(message)

    def _tell(self, message: Any) -> None:
        data = bytes(message.pack(self._coder))
        self._coder.seq = (self._coder.seq + 1) % 256
        self._down.carry(lambda: self._send(data))

    def _beat(self) -> None:
        if self._running:
            for number in (common.MAVLINK_MSG_ID_HEARTBEAT, 2, 245):
                self._tell_message(number)
        self._schedule.after(self.pace, self._beat)

    def _tell_message(self, number: int) -> bool:
        faults = self.traits.faults
        if number == common.MAVLINK_MSG_ID_HEARTBEAT:
            mode = common.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0
            state = common.MAV_STATE_ACTIVE if self._armed else common.MAV_STATE_STANDBY
            self._tell(common.MAVLink_heartbeat_message(self.traits.type, self.traits.autopilot, mode, 0, state, 3))
        elif number == common.MAVLINK_MSG_ID_SYSTEM_TIME:
            uptime_ms = int((time.monotonic() - self._booted_s) * 1e3)
            self._tell(common.MAVLink_system_time_message(0, uptime_ms))
        elif number == common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE and not faults.landed_unknown:
            self._tell(common.MAVLink_extended_sys_state_message(0, 2 if faults.in_air else 1))
        elif number == common.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            bits = common.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST if self.traits.cast else 0
            bits |= 0 if self.traits.cast else common.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
            git, none = list(bytes.fromhex("7766554433221100")), [0] * 8
            uid = list(bytes.fromhex(self._uid).ljust(18, b"\0"))
            version = self.traits.version
            self._tell(common.MAVLink_autopilot_version_message(bits, version, 0, 0, 0, git, none, none, 0, 0, 0, uid))
        else:
            return False
        return True

    def _field(self, name: str) -> int:
        kind, bits = self.values[name]
        if kind == "FLOAT" or not self.traits.cast:
            return bits
        number = struct.unpack("<i", struct.pack("<I", bits))[0]
        return struct.unpack("<I", struct.pack("<f", float(number)))[0]

    def _tell_value(self, name: str) -> None:
        kind, index = TYPES[self.values[name][0]], list(self.values).index(name)
        self._tell(_ParamValue(name.encode(), self._field(name), kind, len(self.values), index))

    def _tell_hash(self) -> None:
        data = b"".join(name.encode() + struct.pack("<I", bits) for name, (_, bits) in self.values.items())
        crc = zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
        kind = common.MAV_PARAM_TYPE_UINT32
        self._tell(_ParamValue(b"_HASH_CHECK", crc, kind, len(self.values), 0xFFFF))

    def _tell_some(self, first: int, life: int) -> None:
        """Values of the list from one on, some at once, as the link takes them."""
        if life != self._life or not self._running:
            return
        for name in list(self.values)[first : first + _LISTED_AT_ONCE]:
            self._tell_value(name)
        if first + _LISTED_AT_ONCE < len(self.values):
            self._schedule.after(0.02 * self.pace, lambda: self._tell_some(first + _LISTED_AT_ONCE, life))

    def _asked_for(self, message: Any) -> None:
        if message.param_index >= 0:
            if message.param_index < len(self.values):
                self._tell_value(list(self.values)[message.param_index])
        elif message.param_id == "_HASH_CHECK":
            self._tell_hash()
        elif message.param_id in self.values:
            self._tell_value(message.param_id)

    def _set(self, message: Any) -> None:
        name, faults = message.param_id, self.traits.faults
        frame = bytes(message.get_msgbuf())
        field_bits = int.from_bytes(frame[10 : 10 + min(frame[1], 4)].ljust(4, b"\0"), "little")
        kind, _ = self.values.get(name, ("FLOAT", 0))
        bits = field_bits
        if kind == "INT32" and self.traits.cast:
            bits = struct.unpack("<I", struct.pack("<i", int(struct.unpack("<f", struct.pack("<I", bits))[0])))[0]
        armed_s = (time.monotonic() - self._armed_at_s) / self.pace if self._armed else 0.0
        sent = {"name": name, "bits": bits, "armed": self._armed, "armed_s": armed_s, "uid": self._uid}
        self.sets.append(sent)
        if name in self.values and message.param_type == TYPES[kind]:
            if self._is_refused(name, bits):
                if faults.error:
                    error = common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
                    self._tell(common.MAVLink_param_error_message(255, 190, name.encode(), -1, error))
            else:
                self._give(name, bits)
            self._tell_value(name)
        self._count_sets()

    def _is_refused(self, name: str, bits: int) -> bool:
        number = struct.unpack("<f", struct.pack("<I", bits))[0]
        return self.traits.faults.refused_name in ("", name) and abs(number) > self.traits.faults.refused

    def _give(self, name: str, bits: int) -> None:
        self.values[name] = (self.values[name][0], bits)
        self.history[name].append(bits)
        if not self._saving:
            self._saving = True
            life, wait_s = self._life, max(0.3, 2.0 - (time.monotonic() - self._saved_s) / self.pace)
            self._schedule.after(wait_s * self.pace, lambda: self._save(life))

    def _save(self, life: int) -> None:
        if life == self._life:
            self._saving = False
            self._saved_s = time.monotonic()
            self.saved = dict(self.values)

    def _count_sets(self) -> None:
        """What happens at the n-th parameter; one that is sent again is the same."""
        names = [one["name"] for one in self.sets]
        if names[-1] in names[:-1]:
            return
        faults, count = self.traits.faults, len(set(names))
        if count == faults.arm_after_sets:
            self._arm()
        if count == faults.meddle_after_sets:
            self._give(faults.meddled, struct.unpack("<I", struct.pack("<f", 0.123))[0])
        if count == faults.silent_after_sets:
            self._down.silent = self._up.silent = True
            self._schedule.after(faults.silent_s * self.pace, self._speak)
        if count == faults.reboot_after_sets:
            self._reboot()

    def _speak(self) -> None:
        self._down.silent = self._up.silent = False

    def _arm(self) -> None:
        self._armed, self._armed_at_s = True, time.monotonic()
        if self.traits.faults.disarm_after_s:
            self._schedule.after(self.traits.faults.disarm_after_s * self.pace, self._disarm)

    def _disarm(self) -> None:
        self._armed = False

    def _reboot(self) -> None:
        self.reboots += 1
        self._life += 1
        self._running, self._saving = False, False
        for name, (_, bits) in self.saved.items():
            if self.values[name][1] != bits:
                self.history[name].append(bits)
        self.values = dict(self.saved)
        self._schedule.after(8.0 * self.pace, self._start)

    def _start(self) -> None:
        self._booted_s = time.monotonic()
        self._running = True
        if self.traits.faults.exchanged:
            self._uid = "ff" * 18

    def _command(self, message: Any) -> None:
        faults, result = self.traits.faults, common.MAV_RESULT_UNSUPPORTED
        if message.command == common.MAV_CMD_REQUEST_MESSAGE and not faults.no_request_message:
            known = self._tell_message(int(message.param1))
            result = common.MAV_RESULT_ACCEPTED if known else common.MAV_RESULT_UNSUPPORTED
        elif message.command == common.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
            self._tell_message(common.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
            result = common.MAV_RESULT_ACCEPTED
        elif message.command == common.MAV_CMD_PREFLIGHT_STORAGE:
            if faults.no_save_ack:
                return
            result = common.MAV_RESULT_TEMPORARILY_REJECTED if self._armed else common.MAV_RESULT_ACCEPTED
            if not self._armed and message.param1 == 1.0:
                life = self._life
                self._schedule.after(0.2 * self.pace, lambda: self._save(life))
        self._tell(common.MAVLink_command_ack_message(message.command, result))
