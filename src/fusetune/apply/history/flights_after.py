"""Which flights came after a change: those that flew it, and nothing else new.

Imports no numerics: the workflow asks when it has listed the flights.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fusetune.apply.history.entries import DecisionEntry
from fusetune.px4.vehicle_identity import VehicleIdentity

NOT_OF_THE_FILTER = frozenset({"EKF2_MAG_DECL", "EKF2_LOG_VERBOSE"})
"""What PX4 itself writes back when it lands, and what changes the log alone."""
_ROUNDING = 1e-6


@dataclass(frozen=True)
class FlownFlight:
    """A flight, as its log tells.

    Attributes
    ----------
    recorded : UTC, ISO 8601; empty where the log does not tell
    parameters : of the estimator when the log ended, of the baseline release
    changed_in_flight : whether any of them changed between take-off and landing
    """

    flight: str
    checksum: str
    vehicle: VehicleIdentity
    recorded: str
    parameters: Mapping[str, float]
    changed_in_flight: bool = False


def change_flown(entries: Sequence[DecisionEntry], flight: FlownFlight) -> DecisionEntry | None:
    """The change that a flight flew: of all that fit the last one that was decided."""
    return next((one for one in reversed(entries) if why_not_after(one, flight) == ""), None)


def why_not_after(entry: DecisionEntry, flight: FlownFlight) -> str:
    """Why a flight says nothing of a change, in words; empty where it is one that came after it."""
    if not entry.is_change:
        return "nothing was changed"
    if not flight.vehicle.is_same(entry.vehicle):
        return "it is of another vehicle"
    if flight.checksum in entry.of_decision:
        return "the decision was made from it"
    if not flight.recorded or not entry.decided_after:
        return "the logs do not tell which of them came first"
    if flight.recorded <= entry.decided_after:
        return "it was flown before the decision"
    if flight.changed_in_flight:
        return "its parameters changed in flight"
    for name, value in entry.changes.items():
        if not _equal(flight.parameters.get(name), value):
            return f"it did not fly {name} = {value:g}"
    for name, value in entry.before.items():
        if name in entry.changes or name in NOT_OF_THE_FILTER or name not in flight.parameters:
            continue
        if not _equal(flight.parameters[name], value):
            return f"{name} was changed as well"
    return ""


def flew(flight: FlownFlight, parameters: Mapping[str, float]) -> bool:
    """Whether a flight had these parameters from its begin to its end, as far as its log names them."""
    return not flight.changed_in_flight and all(
        _equal(flight.parameters[name], value)
        for name, value in parameters.items()
        if name in flight.parameters and name not in NOT_OF_THE_FILTER
    )


def _equal(one: float | None, other: float) -> bool:
    return one is not None and math.isclose(one, other, rel_tol=_ROUNDING, abs_tol=1e-12)
