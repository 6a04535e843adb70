"""EKF2 parameters: metadata per release, validation, and the way of old parameter sets to the baseline release.

Imports nothing but the standard library, so that reading a study stays cheap.
"""

from __future__ import annotations

import csv
import difflib
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Literal

from fusetune.px4.parameters.parameter_migration import OLDER_NAMES, SENSOR_PARAMETERS, migrate_names
from fusetune.px4.releases import (
    BASELINE,
    CONTROL_BY_SOURCE,
    FIRST,
    MAG_TYPES_GIVEN_UP,
    SENSOR_RATES_UNREAD,
    Release,
    name_of,
    number_of_name,
)

_FLOAT = struct.Struct("<f")

_OLDER_VALUES: Mapping[str, tuple[Release, Mapping[int, str]]] = {
    "EKF2_MAG_TYPE": ((1, 14), {2: "3-axis", 4: "3-axis, indoors only with aiding"}),
    "EKF2_DECL_TYPE": ((1, 14), {2: "always fuse declination"}),
}
"""Values, or bits, that a parameter could have until a release, beside those of the baseline."""


class ParameterError(ValueError):
    """A parameter or its value is not acceptable.

    Attributes
    ----------
    name, reason, remedy
        The parameter as given, what is wrong, and what to do about it.
    """

    def __init__(self, name: str, reason: str, remedy: str) -> None:
        self.name, self.reason, self.remedy = name, reason, remedy
        super().__init__(name, reason, remedy)

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}. {self.remedy}."


@dataclass(frozen=True)
class ParameterMetadata:
    """What PX4 says about one parameter."""

    name: str
    type: Literal["INT32", "FLOAT"]
    kind: Literal["float", "int32", "boolean", "enum", "bitmask"]
    default_history: tuple[tuple[tuple[int, int], float], ...]
    """(release, default) at each change, oldest first."""
    first_release: tuple[int, int]
    last_release: tuple[int, int]
    minimum: float | None
    maximum: float | None
    unit: str
    reboot_required: bool
    values: Mapping[int, str]
    """Meaning of each value (enum) or bit (bitmask)."""
    became: tuple[str, ...]
    """What stands for it in the baseline release, where that has it under other names."""
    description: str

    @property
    def default(self) -> float:
        """Default in the baseline release, or the last one it had."""
        return self.default_in(BASELINE)

    @property
    def renamed_from(self) -> tuple[str, ...]:
        """Parameters of older releases that this one took over from."""
        return tuple(name for name, other in ALL_PARAMETERS.items() if self.name in other.became)

    def default_in(self, release: Release) -> float:
        """Default in a release, as the float32 (or whole number) that PX4 holds.

        Releases before the first or after the last one known take the nearest known default.
        """
        known = [value for since, value in self.default_history if since <= release[:2]]
        return known[-1] if known else self.default_history[0][1]

    def exists_in(self, release: Release) -> bool:
        """Whether a release has this parameter."""
        return self.first_release <= release[:2] <= self.last_release


def as_float32(value: float) -> float:
    """The value as PX4 stores it: rounded to single precision."""
    return float(_FLOAT.unpack(_FLOAT.pack(value))[0])


def check_value(name: str, value: object, replayed: Release = BASELINE) -> None:
    """Refuse a parameter that the estimator of a release does not read, or a value of the wrong type or out of range.

    Raises
    ------
    ParameterError
        With the reason and the remedy in words.
    """
    check_by(parameters_of(replayed).get(name) or metadata_of(name), value)


def check_by(metadata: ParameterMetadata, value: object) -> None:
    """Refuse a value that the metadata of its parameter, of any release, does not allow; raises `ParameterError`."""
    number = number_of(metadata, value)
    if metadata.kind == "bitmask":
        _check_bits(metadata, int(number))
    elif metadata.values and int(number) not in metadata.values:
        choices = ", ".join(f"{key} ({meaning})" for key, meaning in metadata.values.items())
        raise ParameterError(metadata.name, f"{value} is none of its values", f"Choose one of {choices}")
    _check_range(metadata, number)


def metadata_of(name: str) -> ParameterMetadata:
    """Metadata of a parameter of the baseline release.

    Raises
    ------
    ParameterError
        The baseline release has no such parameter; names the closest one, or what took over from it.
    """
    if name in PARAMETERS:
        return PARAMETERS[name]
    baseline = name_of(BASELINE)
    old = ALL_PARAMETERS.get(name)
    if old is not None and old.became:
        raise ParameterError(name, f"{baseline} no longer has it", f"Use {' / '.join(old.became)} instead")
    if old is not None:
        raise ParameterError(name, f"{baseline} does not have it, only other releases do", "Leave it out")
    close = difflib.get_close_matches(str(name).upper(), PARAMETERS, n=1, cutoff=0.6)
    remedy = f"Use {close[0]} if you mean that one" if close else "Look the name up in QGroundControl's parameter list"
    raise ParameterError(str(name), "unknown EKF2 parameter", remedy)


def migrate(
    logged: Mapping[str, float | int], release: Release | None = None, replayed: Release = BASELINE
) -> dict[str, float]:
    """Logged parameters under the names, and in the meaning, of the baseline release.

    Parameters
    ----------
    logged
        All parameters of a log.
    release
        Firmware release of the log; `None` where unknown. Decides nothing where the log already holds the new name.
    replayed
        Whose estimator reads them: beside the baseline's also those that only this release has, see `parameters_of`.

    Returns
    -------
    dict
        Only parameters that the log determines; values rounded to float32. Values that are no numbers count as missing.
    """
    read = parameters_of(replayed)
    known = (name for name in logged if name in read or name in BECAME)
    sound = {name: logged[name] for name in known if math.isfinite(logged[name])}
    migrated = as_read_by(sound, replayed)
    return {name: as_float32(float(value)) for name, value in migrated.items() if name in read}


@cache
def parameters_of(replayed: Release) -> Mapping[str, ParameterMetadata]:
    """Parameters that the estimator of a release reads, by name: the baseline's, and those that are its alone.

    What newer releases only call otherwise than the baseline stands here under the baseline's name (`migrate`). Those
    of v1.13 that later became others, and the rates of sensors by which the buffers were sized until v1.14, stand here
    beside what they tell.
    """
    others = ALL_PARAMETERS if replayed >= SENSOR_RATES_UNREAD else {**ALL_PARAMETERS, **SENSOR_RATES}
    own = {
        name: metadata
        for name, metadata in others.items()
        if metadata.exists_in(replayed) and (not metadata.became or name in older_names(replayed))
    }
    changed = {name: _as_in(metadata, replayed) for name, metadata in PARAMETERS.items() if name in _OLDER_VALUES}
    return MappingProxyType(dict(PARAMETERS) | own | changed)


def older_names(replayed: Release) -> tuple[str, ...]:
    """Parameters that a release's estimator reads though the baseline has others in their place."""
    return OLDER_NAMES if replayed[:2] < CONTROL_BY_SOURCE else ()


def is_had_by(name: str, replayed: Release) -> bool:
    """Whether a release has a parameter of `parameters_of`, under this name or those that it became another of."""
    known = parameters_of(replayed)[name]
    return known.exists_in(replayed) or any(
        name in told and (old in SENSOR_PARAMETERS or ALL_PARAMETERS[old].exists_in(replayed))
        for old, told in BECAME.items()
    )


def _as_in(metadata: ParameterMetadata, replayed: Release) -> ParameterMetadata:
    """Metadata of a parameter with the values that older releases allow beside those of the baseline."""
    last, older = _OLDER_VALUES[metadata.name]
    if replayed[:2] > last:
        return metadata
    values = dict(sorted({**metadata.values, **older}.items()))
    high = metadata.maximum
    if metadata.kind == "bitmask" and high is not None:
        high = float((1 << max(values) + 1) - 1)
    return replace(metadata, values=MappingProxyType(values), maximum=high)


@cache
def defaults_of(replayed: Release) -> Mapping[str, float]:
    """The defaults of `parameters_of` a release: its own, under whatever name it has them."""
    own = {name: one.default_in(replayed) for name, one in ALL_PARAMETERS.items() if one.exists_in(replayed)}
    if replayed[:2] >= CONTROL_BY_SOURCE:
        own = {name: value for name, value in own.items() if name not in OLDER_NAMES}  # left over, and read by nothing
    nearest = {name: one.default_in(replayed) for name, one in parameters_of(replayed).items()}
    told = {name: value for name, value in as_read_by(own, replayed).items() if name in nearest}
    return MappingProxyType(nearest | {name: as_float32(value) for name, value in told.items()})


def as_read_by(values: Mapping[str, float | int], replayed: Release) -> dict[str, float | int]:
    """Parameters of a vehicle as the estimator of a release takes them, under the names of the baseline."""
    return migrate_names(values, BECAME, keep_mag_type=replayed < MAG_TYPES_GIVEN_UP)


def number_of(metadata: ParameterMetadata, value: object) -> float:
    """The value of a parameter as a finite number, whole where its type is INT32; raises `ParameterError`."""
    expected = "a whole number" if metadata.type == "INT32" else "a number"
    if metadata.kind == "boolean" and isinstance(value, bool):
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(metadata.name, f"{value!r} is not {expected}", f"Give {expected}, {_range_text(metadata)}")
    if not math.isfinite(value) or (metadata.type == "INT32" and value != int(value)):
        raise ParameterError(metadata.name, f"{value!r} is not {expected}", f"Give {expected}, {_range_text(metadata)}")
    return float(value)


def _check_bits(metadata: ParameterMetadata, value: int) -> None:
    if value < 0 or value >> (max(metadata.values) + 1):
        bits = ", ".join(f"{1 << bit} ({meaning})" for bit, meaning in metadata.values.items())
        raise ParameterError(metadata.name, f"{value} sets bits that do not exist", f"Add up some of {bits}")


def _check_range(metadata: ParameterMetadata, value: float) -> None:
    low = -math.inf if metadata.minimum is None else metadata.minimum
    high = math.inf if metadata.maximum is None else metadata.maximum
    if metadata.kind == "boolean":
        low, high = 0.0, 1.0
    # a limit that was rounded to a float32 is that limit
    if not min(low, as_float32(low)) <= value <= max(high, as_float32(high)):
        raise ParameterError(metadata.name, f"{value:g} is out of range", f"Give {_range_text(metadata)}")


def _range_text(metadata: ParameterMetadata) -> str:
    unit = f" {metadata.unit}" if metadata.unit else ""
    if metadata.kind == "boolean":
        return "0 or 1"
    if metadata.minimum is not None and metadata.maximum is not None:
        return f"between {metadata.minimum:g} and {metadata.maximum:g}{unit}"
    if metadata.minimum is not None:
        return f"at least {metadata.minimum:g}{unit}"
    if metadata.maximum is not None:
        return f"at most {metadata.maximum:g}{unit}"
    return f"the default is {metadata.default:g}{unit}"


def _metadata_from(row: dict[str, str]) -> ParameterMetadata:
    changes = [change.split("=") for change in row["defaults"].split()]
    labels = [entry.split("=", 1) for entry in row["values"].split(";") if entry]
    return ParameterMetadata(
        name=row["name"],
        type="INT32" if row["type"] == "INT32" else "FLOAT",
        kind=row["kind"],  # type: ignore[arg-type]
        default_history=tuple((number_of_name(since), as_float32(float(value))) for since, value in changes),
        first_release=number_of_name(row["first_release"]),
        last_release=number_of_name(row["last_release"]),
        minimum=float(row["minimum"]) if row["minimum"] else None,
        maximum=float(row["maximum"]) if row["maximum"] else None,
        unit=row["unit"],
        reboot_required=row["reboot_required"] == "1",
        values=MappingProxyType({int(key): meaning for key, meaning in labels}),
        became=tuple(row["became"].split()),
        description=row["description"],
    )


def _sensor_rate(name: str, default: float) -> ParameterMetadata:
    return ParameterMetadata(
        name=name,
        type="FLOAT",
        kind="float",
        default_history=((FIRST, default),),
        first_release=FIRST,
        last_release=(1, 14),
        minimum=1.0,
        maximum=200.0,
        unit="Hz",
        reboot_required=True,
        values=MappingProxyType({}),
        became=(),
        description="Rate of the driver, by which EKF2 sizes its buffers until v1.14",
    )


def _read_metadata() -> dict[str, ParameterMetadata]:
    file = resources.files(__package__) / "ekf2_parameters.csv"
    lines = file.read_text(encoding="utf-8").splitlines()
    return {row["name"]: _metadata_from(row) for row in csv.DictReader(lines)}


ALL_PARAMETERS: Mapping[str, ParameterMetadata] = MappingProxyType(_read_metadata())
"""EKF2 parameters of every release that is read."""

PARAMETERS: Mapping[str, ParameterMetadata] = MappingProxyType(
    {name: metadata for name, metadata in ALL_PARAMETERS.items() if metadata.exists_in(BASELINE)}
)
"""EKF2 parameters of the baseline release, by name in alphabetical order."""

SENSOR_RATES: Mapping[str, ParameterMetadata] = MappingProxyType(
    {name: _sensor_rate(name, default) for name, default in (("SENS_BARO_RATE", 20.0), ("SENS_MAG_RATE", 15.0))}
)
"""Parameters that are none of EKF2's own, and by which its buffers are sized until v1.14."""

BECAME: Mapping[str, tuple[str, ...]] = {
    **{name: metadata.became for name, metadata in ALL_PARAMETERS.items() if metadata.became},
    **SENSOR_PARAMETERS,
}
"""Parameters of other releases → those of the baseline that they tell."""
