"""Which vehicle a log is of, by what the log says of board, airframe and simulation.

Imports no numerics: the workflow asks for the present set whenever it starts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from fusetune.px4.flight import Flight

Kind = Literal["real", "SITL", "HITL"]

OWN_SIMULATOR = "FUSETUNE_SIM"
"""`ver_hw` of the flights that the execute room simulates; their `sys_uuid` is the name of the simulated vehicle."""

_SIMULATORS = ("PX4_SITL", OWN_SIMULATOR)
_LONGEST_WHOLE_UUID, _TAIL = 16, 8
"""The ids of boards of one make begin alike, so the end of a long one is shown."""

_MAV_TYPES: Mapping[int, str] = {
    1: "fixed wing", 2: "quadrotor", 3: "coaxial", 4: "helicopter", 7: "airship", 10: "rover", 11: "boat",
    12: "submarine", 13: "hexarotor", 14: "octorotor", 15: "tricopter",
} | dict.fromkeys(range(19, 26), "VTOL")  # fmt: skip
"""MAVLink's MAV_TYPE, which PX4 has in the parameter of that name and in `vehicle_status.system_type`."""
_VEHICLE_TYPES: Mapping[int, str] = {1: "rotary wing", 2: "fixed wing", 3: "rover"}
"""`vehicle_status.vehicle_type`."""


@dataclass(frozen=True)
class VehicleIdentity:
    """Who flew.

    Attributes
    ----------
    uuid : of the board, `sys_uuid`; empty where the log has none, as of simulations and of old releases
    hardware : `ver_hw`
    airframe : SYS_AUTOSTART; empty where the log lacks it, or where no airframe was chosen (0)
    type : such as "quadrotor"; it tells vehicles apart where there is no airframe
    kind : "real", or what was simulated: all ("SITL"), or the world of a real board ("HITL")
    """

    uuid: str = ""
    hardware: str = ""
    airframe: str = ""
    type: str = ""
    kind: Kind = "real"

    @property
    def is_real(self) -> bool:
        """Whether something flew."""
        return self.kind == "real"

    @property
    def name(self) -> str:
        """A short name, such as `PX4_FMU_V4-003a0043-4011`: board, end of its id, airframe."""
        board = self.uuid if len(self.uuid) <= _LONGEST_WHOLE_UUID else self.uuid[-_TAIL:]
        frame = self.airframe or self.type.replace(" ", "_")
        parts = (self.hardware or "unknown", board, frame, "HITL" if self.kind == "HITL" else "")
        return "-".join(filter(None, parts))

    @property
    def in_words(self) -> str:
        """The name with what it is."""
        simulated = "" if self.is_real else f"simulated ({self.kind}) "
        return f"{simulated}{self.type or 'vehicle'} {self.name}"

    def is_same(self, other: VehicleIdentity) -> bool:
        """Whether nothing in the two logs speaks for different vehicles.

        Without an id of the board all logs of one hardware and airframe are taken for one vehicle, and are not taken
        for one whose board is known.
        """
        return self._key == other._key

    @property
    def _key(self) -> tuple[str, ...]:
        return self.uuid, self.hardware, self.airframe or self.type, self.kind

    def is_called(self, asked: str) -> bool:
        """Whether a name, a whole id, or the beginning of either means this vehicle; letters in either case."""
        asked = asked.casefold()
        return any(one.casefold().startswith(asked) for one in (self.name, self.uuid) if one)

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> VehicleIdentity:
        """Read it from a row that has it in columns `vehicle_<attribute>`, see `columns`."""
        found = {one.name: row.get(f"vehicle_{one.name}") for one in fields(cls)}
        return cls(**{name: value for name, value in found.items() if value})

    def columns(self) -> dict[str, str]:
        """The name as `vehicle` and the attributes as `vehicle_<attribute>`."""
        return {"vehicle": self.name} | {f"vehicle_{one.name}": getattr(self, one.name) for one in fields(self)}


def vehicle_identity(flight: Flight) -> VehicleIdentity:
    """Who flew, from a flight with its topic `vehicle_status`, raw or canonical; what the log lacks stays empty."""
    parameters = flight.parameters.initial
    airframe = _whole(parameters.get("SYS_AUTOSTART"))
    hardware = _text(flight.info.get("ver_hw"))
    return VehicleIdentity(
        uuid=_text(flight.info.get("sys_uuid")),
        hardware=hardware,
        airframe=str(airframe) if airframe else "",
        type=_type(flight),
        kind=_kind(flight, hardware),
    )


def _type(flight: Flight) -> str:
    mav_type = _whole(flight.parameters.initial.get("MAV_TYPE"))
    for known, number in (
        (_MAV_TYPES, mav_type),
        (_MAV_TYPES, _most_frequent(flight, "system_type")),
        (_VEHICLE_TYPES, _most_frequent(flight, "vehicle_type")),
    ):
        if number is not None and number in known:
            return known[number]
    return ""


def _kind(flight: Flight, hardware: str) -> Kind:
    if hardware in _SIMULATORS:
        return "SITL"
    # 1 is HITL, 2 a simulator on the board itself, -1 an external one
    is_simulated = _whole(flight.parameters.initial.get("SYS_HITL")) or _most_frequent(flight, "hil_state")
    return "HITL" if is_simulated else "real"


def _most_frequent(flight: Flight, field: str) -> int | None:
    """Value that `vehicle_status` has most often."""
    table = flight.topic("vehicle_status")
    if table is None or field not in table or not len(table[field]):
        return None
    return _whole(Counter(table[field].tolist()).most_common(1)[0][0])


def _whole(value: object) -> int | None:
    return int(value) if isinstance(value, int | float) and value == value and abs(value) < 2**31 else None


def _text(value: object) -> str:
    """A text of the log in one line; damage can make anything of it."""
    return "".join(letter for letter in value if letter.isprintable()).strip() if isinstance(value, str) else ""
