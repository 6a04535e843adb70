"""Parameters of the baseline release as the release of a vehicle has them: names, values, or why it cannot have them.

The way back from `parameter_migration`, and proved by it: what is set on the vehicle must come out of the migration as
it was wanted, and all else as it was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from fusetune.px4.flight import ParameterValue
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    BECAME,
    PARAMETERS,
    ParameterError,
    ParameterMetadata,
    as_float32,
    check_by,
    migrate,
)
from fusetune.px4.parameters.parameter_migration import SENSOR_PARAMETERS, value_before
from fusetune.px4.releases import DEVELOPMENT, Release, name_of

_ROUNDING = 1e-6
"""Share by which a value may differ that went to another unit and back as a float32."""


@dataclass(frozen=True)
class VehicleParameter:
    """A parameter to be set on a vehicle, in the names of its release.

    Attributes
    ----------
    stands_for : parameters of the baseline release that it sets; itself where it has the same name
    previous : what the vehicle has; the default of its release where `is_logged` says that the log does not tell
    type : on the vehicle, by which it is written
    is_logged : whether the log names it; PX4 logs the parameters that are in use
    """

    name: str
    stands_for: tuple[str, ...]
    previous: ParameterValue
    value: ParameterValue
    type: Literal["INT32", "FLOAT"]
    unit: str
    reboot_required: bool
    is_logged: bool = True


def on_vehicle(
    wanted: Mapping[str, float], logged: Mapping[str, ParameterValue], release: Release | None
) -> tuple[tuple[VehicleParameter, ...], tuple[ParameterError, ...]]:
    """Bring parameters of the baseline release to a vehicle of another one.

    Parameters
    ----------
    wanted : parameters of the baseline and their new values
    logged : all parameters of the vehicle's log, in its own names and types
    release : that the vehicle flies; None where its log does not tell

    Returns
    -------
    What to set, by name, and what cannot be set, with reason and remedy. Parameters that the vehicle already has at the
    wanted value are left out.
    """
    refused: list[ParameterError] = []
    targets: dict[str, dict[str, float]] = {}
    for name, value in sorted(wanted.items()):
        try:
            targets.setdefault(_name_on_vehicle(name, logged, release), {})[name] = value
        except ParameterError as error:
            refused.append(error)
    found = []
    for old, values in sorted(targets.items()):
        try:
            one = _to_set(old, values, logged, release)
            _demand_nothing_else(one, values, logged, release)
        except ParameterError as error:
            refused.append(error)
            continue
        if one.value != one.previous or not one.is_logged:
            found.append(one)
    return tuple(found), tuple(refused)


def _name_on_vehicle(name: str, logged: Mapping[str, ParameterValue], release: Release | None) -> str:
    """The vehicle's own name of a parameter: what its log has, else what its release has."""
    others = [other for other, told in BECAME.items() if name in told]
    for one in (name, *others):
        if one in logged:
            return one
    if release is None:
        reason = "the log does not name it, and does not say which release the vehicle flies"
        raise ParameterError(name, reason, "Look it up on the vehicle and set it by hand")
    for one in (name, *others):
        if _exists_in(one, release):
            return one
    metadata = ALL_PARAMETERS[name]
    when = f"came with {name_of(metadata.first_release)}"
    if release[:2] > metadata.last_release:
        when = f"went after {name_of(metadata.last_release)}"
    reason = f"{name_of(release)}, which the vehicle flies, has no such parameter: it {when}"
    raise ParameterError(name, reason, "Leave it out of the study, or bring the vehicle to another release")


def _exists_in(name: str, release: Release) -> bool:
    if name in SENSOR_PARAMETERS:
        return release[:2] >= DEVELOPMENT
    return ALL_PARAMETERS[name].exists_in(release)


def _metadata(name: str) -> ParameterMetadata:
    """Of a parameter of any release; one that is none of EKF2's has the meaning of the one that it took over from."""
    return ALL_PARAMETERS[SENSOR_PARAMETERS[name][0]] if name in SENSOR_PARAMETERS else ALL_PARAMETERS[name]


def _to_set(
    old: str, values: Mapping[str, float], logged: Mapping[str, ParameterValue], release: Release | None
) -> VehicleParameter:
    metadata = _metadata(old)
    default = metadata.default_in(release) if release is not None else metadata.default
    value = values[old] if old in values else value_before(old, values, {old: default, **logged})
    told = _told(values)
    if value is None:
        raise ParameterError(old, f"no value of it sets {told}", "Leave these out of the study")
    type_name: Literal["INT32", "FLOAT"] = metadata.type
    if old in logged:
        type_name = "INT32" if isinstance(logged[old], int) else "FLOAT"
    typed = _typed(old, value, type_name)
    try:
        check_by(metadata, typed)
    except ParameterError as error:
        what = f"it would have to be {typed:g} for {told}, which" if old not in values else "it"
        raise ParameterError(old, f"{what} is refused: {error.reason}", error.remedy) from error
    previous = logged.get(old, _typed(old, default, type_name))
    needs_reboot = metadata.reboot_required or any(ALL_PARAMETERS[name].reboot_required for name in values)
    return VehicleParameter(
        old, tuple(values), previous, typed, type_name, metadata.unit, needs_reboot, is_logged=old in logged
    )


def _typed(name: str, value: float, type_name: str) -> ParameterValue:
    if type_name == "FLOAT":
        return as_float32(float(value))
    if value != int(value):
        raise ParameterError(
            name, f"{value:g} is no whole number, and the vehicle holds it as one", "Choose a whole one"
        )
    return int(value)


def _demand_nothing_else(
    one: VehicleParameter,
    values: Mapping[str, float],
    logged: Mapping[str, ParameterValue],
    release: Release | None,
) -> None:
    """See that the vehicle, read as its logs are, then has what is wanted and else what it had."""
    before, after = migrate(logged, release), migrate({**logged, one.name: one.value}, release)
    defaults = {name: PARAMETERS[name].default for name in after}
    for name, value in after.items():
        if name in values and not math.isclose(value, as_float32(values[name]), rel_tol=_ROUNDING):
            reason = f"with {one.value:g} the vehicle would have {name} = {value:g}, not {values[name]:g}"
            raise ParameterError(one.name, reason, f"Leave {name} out of the study")
        if name not in values and value != before.get(name, defaults[name]):
            reason = f"it would change {name} to {value:g} as well, as {_told(values)} is set by the same parameter"
            raise ParameterError(one.name, reason, f"Give {name} the same value in the study")


def _told(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())
