"""Flight modes and arming states by the numbers of `vehicle_status`.

Source: `msg/VehicleStatus.msg` of v1.16. From v1.8 on numbers mean the same, but for some that were given to no mode,
or to one that is gone.
"""

from __future__ import annotations

from collections.abc import Mapping

FLIGHT_MODES: Mapping[int, str] = {
    0: "Manual",
    1: "Altitude",
    2: "Position",
    3: "Mission",
    4: "Hold",
    5: "Return",
    6: "Position slow",
    8: "Altitude cruise",
    10: "Acro",
    12: "Descend",
    13: "Termination",
    14: "Offboard",
    15: "Stabilized",
    17: "Take-off",
    18: "Land",
    19: "Follow target",
    20: "Precision land",
    21: "Orbit",
    22: "VTOL take-off",
    **{23 + number: f"External {number + 1}" for number in range(8)},
}
"""`vehicle_status.nav_state`."""

ARMED = 2
"""`vehicle_status.arming_state` of a vehicle that is armed, in every release."""


def flight_mode(nav_state: int) -> str:
    """The name of a flight mode; of one that has none its number."""
    return FLIGHT_MODES.get(nav_state, f"mode {nav_state}")
