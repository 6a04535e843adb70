"""Which vehicles are on a link, and who one of them is."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from fusetune.apply.upload import wire
from fusetune.apply.upload.conversation import Conversation, Station
from fusetune.apply.upload.stops import LinkLost, NoAnswer, Refusal
from fusetune.apply.upload.values import Encoding
from fusetune.apply.upload.wire import common
from fusetune.px4.releases import name_of_version

_SIMULATED = ("1005", "1006")
"""How PX4's GUID begins where the board is a simulation (`PX4_SOC_ARCH_ID_SIM`, `…_SITL`)."""


@dataclass(frozen=True)
class Identity:
    """Who a vehicle is, by its AUTOPILOT_VERSION.

    Attributes
    ----------
    uuid : PX4's GUID of the board in hexadecimal, as logs have it in `sys_uuid`; empty where it tells none
    release : such as "v1.16.0"
    git : first digits of the firmware's git hash
    encoding : how it carries whole numbers
    """

    system: int
    component: int
    uuid: str
    release: str
    git: str
    encoding: Encoding

    @property
    def is_simulated(self) -> bool:
        """Whether the board is a simulation's, which all have one id."""
        return self.uuid.startswith(_SIMULATED)

    @property
    def in_words(self) -> str:
        """For people."""
        return f"system {self.system}, PX4 {self.release} (git {self.git}), board {self.uuid or 'that tells no id'}"


def find_vehicles(talk: Conversation) -> list[Station]:
    """The vehicles whose heartbeats come; no ground stations, companions, cameras or gimbals.

    Raises
    ------
    Refusal
        None comes, or none that is a vehicle.
    """
    until, found = time.monotonic() + talk.pace.patience_s, list[Station]()
    while not found:
        for _ in talk.listen(talk.pace.search_s):
            pass
        found = [one for one in talk.stations.values() if one.is_vehicle]
        if not found and time.monotonic() > until:
            break
    if not talk.stations:
        raise Refusal("no heartbeat came", "Is the vehicle powered, and does it send to this address")
    if not found:
        raise Refusal(
            "heartbeats came, but none of a vehicle, only of ground stations or companions",
            "Connect to the autopilot, or have the companion pass its messages on",
        )
    return sorted(found, key=lambda one: (one.system, str(one.source)))


def choose_vehicle(found: Sequence[Station], system: int | None) -> Station:
    """The vehicle that is meant.

    Raises
    ------
    Refusal
        There are several, and none or several of them are meant; it says which there are.
    """
    meant = [one for one in found if system is None or one.system == system]
    if len(meant) == 1:
        return meant[0]
    there = ", ".join(f"system {one.system} at {one.source}" for one in found)
    if not meant:
        raise Refusal(f"there is no vehicle with system id {system}, only {there}", "Name one of these with --system")
    if len({one.system for one in meant}) < len(meant):
        raise Refusal(f"several vehicles have the same system id: {there}", "Connect one at a time")
    raise Refusal(f"there are several vehicles: {there}", "Say which with --system")


def identify(talk: Conversation) -> Identity:
    """Ask the vehicle that is talked with who it is.

    Raises
    ------
    Refusal
        It is no PX4.
    NoAnswer, LinkLost
        It does not say.
    """
    partner = talk.partner
    if partner.autopilot != common.MAV_AUTOPILOT_PX4:
        raise Refusal("the vehicle's autopilot is no PX4", "Upload to a vehicle that flies PX4")
    message = _autopilot_version(talk)
    uuid = bytes(message.uid2).hex()
    if not any(message.uid2):
        uuid = f"{message.uid:016x}" if message.uid else ""
    capabilities = message.capabilities
    bytewise = capabilities & common.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    cast = capabilities & common.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
    return Identity(
        partner.system,
        partner.component,
        uuid,
        name_of_version(message.flight_sw_version),
        bytes(message.flight_custom_version)[::-1].hex()[:10],
        "cast" if cast and not bytewise else "bytewise",
    )


def learn_state(talk: Conversation) -> None:
    """See that it is known whether the vehicle is on the ground, and when it booted; what it does not say stays
    unknown."""
    partner = talk.partner
    for number, known in (
        (common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, lambda message: partner.landed is not None),
        (common.MAVLINK_MSG_ID_SYSTEM_TIME, lambda message: partner.booted_s is not None),
    ):
        if not known(None):
            with suppress(NoAnswer):
                talk.request_message(number, known, f"message {number}", attempts=5)


def see_boot_time(talk: Conversation) -> None:
    """Have the vehicle tell its time since boot anew, so that a reboot is noticed.

    Raises
    ------
    NoAnswer, LinkLost
        It does not.
    """
    talk.catch_up()
    talk.request_message(
        common.MAVLINK_MSG_ID_SYSTEM_TIME, lambda message: message.get_type() == "SYSTEM_TIME", "its time since boot"
    )


def _autopilot_version(talk: Conversation) -> Any:
    def is_answer(message: Any) -> bool:
        return message.get_type() == "AUTOPILOT_VERSION"

    try:
        return talk.request_message(common.MAVLINK_MSG_ID_AUTOPILOT_VERSION, is_answer, "who it is", attempts=5)
    except LinkLost:
        raise
    except NoAnswer:
        # what PX4 of before v1.12 knows
        number = common.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES
        system, component = talk.partner.system, talk.partner.component
        return talk.ask(lambda: wire.command(system, component, number, 1.0), is_answer, "who it is")
