"""The changes of a decision on the vehicle that it is for: in the names, types and ranges of its own release."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fusetune.apply.parameter_changes import ParameterChange
from fusetune.apply.parameter_files.vehicle_parameters import VehicleParameters
from fusetune.px4.parameters.release_names import VehicleParameter, on_vehicle


@dataclass(frozen=True)
class RefusedChange:
    """A change that the vehicle cannot be given, with what to do about it."""

    name: str
    reason: str
    remedy: str


@dataclass(frozen=True)
class VehicleChanges:
    """What is written for the vehicle.

    Attributes
    ----------
    parameters : to be set, by name; none where any is refused, for the sets that were compared differ in all of them
        together, and some of them alone were not judged
    refused : why
    alone : of parameters, what each brings alone, in words
    """

    parameters: tuple[VehicleParameter, ...]
    refused: tuple[RefusedChange, ...] = ()
    alone: tuple[tuple[str, str], ...] = ()

    def sentence(self) -> str:
        """What a pilot has to know of it; empty where all is written as it was compared."""
        if self.refused:
            first = self.refused[0]
            more = f" So it is with {len(self.refused) - 1} more." if len(self.refused) > 1 else ""
            return (
                f"The parameter files hold nothing to load, as this vehicle cannot be given all that was compared: "
                f"{first.name}: {first.reason}. {first.remedy}.{more}"
            )
        renamed = [one for one in self.parameters if one.stands_for != (one.name,)]
        if not renamed:
            return ""
        told = ", ".join(f"{one.name} for {' and '.join(one.stands_for)}" for one in renamed)
        return f"The parameter files have the names of the vehicle's own release: {told}."

    def document(self) -> dict[str, Any]:
        """For `decision.json`."""
        return {
            "parameters": [asdict(one) for one in self.parameters],
            "refused": [asdict(one) for one in self.refused],
        }


def vehicle_changes(changes: Sequence[ParameterChange], vehicle: VehicleParameters) -> VehicleChanges:
    """Bring the changes of a decision to its vehicle; nothing is lost without a word."""
    found, errors = on_vehicle({one.name: one.value for one in changes}, vehicle.values, vehicle.release)
    refused = [RefusedChange(one.name, one.reason, one.remedy) for one in errors]
    for name in vehicle.unsound:
        for one in found:
            if name == one.name:
                reason = "the log holds a value that no vehicle can have, so what it has now is not known"
                refused.append(RefusedChange(name, reason, "Fly once more, or set it by hand"))
    alone = {one.name: one.alone for one in changes if one.alone}
    told = tuple((one.name, alone[name]) for one in found for name in one.stands_for if name in alone)
    return VehicleChanges(() if refused else found, tuple(refused), told)
