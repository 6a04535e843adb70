"""What a vehicle has by the log of a flight: all its parameters, its release, its address."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from fusetune.px4.flight import Flight, ParameterValue
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.px4.parameters.logged_parameters import is_read, typed_value
from fusetune.px4.parameters.parameter_migration import SENSOR_PARAMETERS
from fusetune.px4.parameters.params_file import PARAMETER_NAME, ParamsHeader, VehicleAddress
from fusetune.px4.releases import BASELINE, Release, name_of
from fusetune.save.flight_folder import load_flight
from fusetune.storage.files import AnyPath

_QGC_VEHICLES: Mapping[int, str] = {1: "Fixed Wing", 10: "Rover", 11: "Boat", 12: "Sub"} | dict.fromkeys(
    range(19, 26), "VTOL"
)
"""MAV_TYPE → what QGroundControl calls it in the head of its files; all others are Multi-Rotor there."""
_HIGHEST_ID = 255
_SAVES_DECLINATION = 1 << 1


@dataclass(frozen=True)
class VehicleParameters:
    """All parameters that a log tells of its vehicle, as they were when the log ended.

    Attributes
    ----------
    values : name → value, `int` for INT32 and `float` (a float32) for FLOAT; by name
    unsound : names of parameters that the log holds with what cannot be: damage, which nobody should load
    release : that flew; None where the log does not tell
    firmware : the same in words, with its stage
    """

    values: Mapping[str, ParameterValue]
    unsound: tuple[str, ...] = ()
    release: Release | None = None
    firmware: str = "unknown"
    git_revision: str = ""
    address: VehicleAddress = field(default_factory=VehicleAddress)
    kind: str = "Multi-Rotor"
    log_start_us: int | None = None

    @property
    def judged(self) -> dict[str, ParameterValue]:
        """What a decision rests on: the estimator's parameters, in the names of the vehicle's release.

        Without the declination where PX4 itself saves what it found whenever the vehicle is disarmed (bit 1 of
        EKF2_DECL_TYPE).
        """
        found = {
            name: value for name, value in self.values.items() if name.startswith("EKF2_") or name in SENSOR_PARAMETERS
        }
        kind = found.get("EKF2_DECL_TYPE", PARAMETERS["EKF2_DECL_TYPE"].default)
        if int(kind) & _SAVES_DECLINATION:
            found.pop("EKF2_MAG_DECL", None)
        return found

    def header(self, comments: tuple[str, ...]) -> ParamsHeader:
        """Head of a file of QGroundControl for this vehicle."""
        version, _, stage = self.firmware.removeprefix("v").partition("-")
        known = "" if self.firmware == "unknown" else version
        return ParamsHeader(known, stage, self.git_revision, self.kind, comments=comments)


def vehicle_parameters(flight_folder: AnyPath) -> VehicleParameters:
    """Read what the vehicle of a saved flight has, `results/save/<flight>`.

    Raises
    ------
    UserError
        The folder is not one of a saved flight.
    """
    return parameters_of(load_flight(flight_folder, topics=()))


def parameters_of(flight: Flight) -> VehicleParameters:
    """What the vehicle of a flight has."""
    logged = flight.parameters.at_end()
    sound = {name: value for name, value in sorted(logged.items()) if _is_sound(name, value)}
    kind = sound.get("MAV_TYPE")
    return VehicleParameters(
        values=sound,
        unsound=tuple(sorted(set(logged) - set(sound))),
        release=flight.release,
        firmware=flight.release_name,
        git_revision=_git_revision(flight),
        address=VehicleAddress(_id(sound.get("MAV_SYS_ID")), _id(sound.get("MAV_COMP_ID"))),
        kind=_QGC_VEHICLES.get(int(kind), "Multi-Rotor") if kind is not None else "Multi-Rotor",
        log_start_us=flight.start_timestamp,
    )


def of_replayed(parameters: Mapping[str, float]) -> VehicleParameters:
    """What is known of a vehicle of which there are only the parameters that were replayed, of the baseline release."""
    values: dict[str, ParameterValue] = {
        name: int(value) if PARAMETERS[name].type == "INT32" else float(value)
        for name, value in sorted(parameters.items())
        if name in PARAMETERS
    }
    return VehicleParameters(values, release=BASELINE, firmware=f"{name_of(BASELINE)}.0")


def _is_sound(name: str, value: ParameterValue) -> bool:
    """Whether a vehicle can have had it; of parameters that no room reads, whether it is a name and a number."""
    if not PARAMETER_NAME.fullmatch(name) or not math.isfinite(value):
        return False
    return not is_read(name) or typed_value(name, value) is not None


def _git_revision(flight: Flight) -> str:
    """The ten digits that QGroundControl shows; a simulation has none."""
    version = flight.info.get("ver_sw")
    is_known = isinstance(version, str) and re.fullmatch(r"[0-9a-f]{7,40}", version) and set(version) != {"0"}
    return str(version)[:10] if is_known else ""


def _id(value: ParameterValue | None) -> int:
    """MAVLink system or component; QGroundControl refuses the file of another one."""
    return int(value) if value is not None and 1 <= value <= _HIGHEST_ID else 1
