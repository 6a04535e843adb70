"""Faults that can be switched on for a simulated flight."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from fusetune.settings.checking import read_checked, validate
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of

if TYPE_CHECKING:
    import numpy as np

Vector = tuple[float, float, float]
F = TypeVar("F")

_FINITE: dict[str, Any] = {"low": -100_000, "high": 100_000}


@dataclass(frozen=True)
class TimedFault:
    """A fault with a beginning and an end."""

    start_s: float = required("start, after take-off (negative: before)", unit="s", low=-600, high=3600)
    duration_s: float = required("duration", unit="s", above=0, high=3600)

    def holds(self, time_after_takeoff_s: np.ndarray) -> np.ndarray:
        """Whether the fault is on at the given times; (N,) bool."""
        return (time_after_takeoff_s >= self.start_s) & (time_after_takeoff_s < self.start_s + self.duration_s)


@dataclass(frozen=True)
class GnssOutage(TimedFault):
    """No GNSS: the receiver reports no fix, or sends nothing when `silent`."""

    silent: bool = setting(False, "true when the receiver sends nothing, false when it reports no fix")


@dataclass(frozen=True)
class GnssGlitch(TimedFault):
    """GNSS is off by a constant while its reported accuracy stays good."""

    offset_m: Vector = required("position error: north, east, down", unit="m", **_FINITE)
    velocity_offset_m_s: Vector = setting((0.0, 0.0, 0.0), "velocity error: north, east, down", unit="m/s", **_FINITE)


@dataclass(frozen=True)
class MagneticDisturbance(TimedFault):
    """An additional field, as of steel or a power line, that comes and goes smoothly."""

    field_gauss: Vector = required("additional field: north, east, down", unit="Gauss", **_FINITE)


@dataclass(frozen=True)
class StrongVibration(TimedFault):
    """The vehicle's vibration multiplied."""

    factor: float = required("vibration is multiplied by this", above=0, high=100)


@dataclass(frozen=True)
class Clipping(TimedFault):
    """Shaking beyond the range of the accelerometer."""

    amplitude_m_s2: float = setting(220.0, "amplitude of the shaking", unit="m/s²", above=0, high=1000)
    frequency_hz: float = setting(61.0, "frequency of the shaking", unit="Hz", low=5, high=400)


@dataclass(frozen=True)
class LoggerDropout(TimedFault):
    """The logger loses everything for a while and says so."""


@dataclass(frozen=True)
class DefaultProfile:
    """The log holds what PX4's default logging profile keeps: thinned topics, some IMU samples missing."""

    imu_loss: float = setting(0.03, "share of missing sensor_combined messages", low=0, high=0.5)
    from_arming: bool = setting(True, "true when the log starts at arming, false from boot")


Fault = GnssOutage | GnssGlitch | MagneticDisturbance | StrongVibration | Clipping | LoggerDropout | DefaultProfile

KINDS: dict[str, type[Any]] = {
    "gnss_outage": GnssOutage,
    "gnss_glitch": GnssGlitch,
    "magnetic_disturbance": MagneticDisturbance,
    "vibration": StrongVibration,
    "clipping": Clipping,
    "logger_dropout": LoggerDropout,
    "default_profile": DefaultProfile,
}


def load_faults(path: str | os.PathLike[str]) -> tuple[Fault, ...]:
    """Read a YAML file that holds a list `faults`.

    Raises
    ------
    UserError
        The file is broken; the message names the entry, the key and what was expected.
    """
    return parse_faults(read_checked(path, _SCHEMA | {"additionalProperties": False})["faults"], path)


def parse_faults(entries: Sequence[Mapping[str, Any]], file: str | os.PathLike[str] = "faults") -> tuple[Fault, ...]:
    """Faults from the list of mappings that a configuration file holds.

    Parameters
    ----------
    entries
        Each with `kind`, a name of `KINDS`, and the settings of that class.
    file
        Named in messages.

    Raises
    ------
    UserError
        An entry is broken; the message names the entry, the key and what was expected.
    """
    validate({"faults": list(entries)}, _SCHEMA, file)
    return tuple(
        built(KINDS[entry["kind"]], {key: value for key, value in entry.items() if key != "kind"}) for entry in entries
    )


def _schema_of_kind(name: str, kind: type) -> dict[str, Any]:
    """What holds of an entry of this kind."""
    schema = schema_of(kind)
    return {
        "if": {"properties": {"kind": {"const": name}}, "required": ["kind"]},
        "then": schema | {"properties": {"kind": {}} | schema["properties"]},
    }


_SCHEMA: dict[str, Any] = {
    "type": "object",
    "required": ["faults"],
    "properties": {
        "faults": {
            "type": "array",
            "description": "list of faults",
            "items": {
                "type": "object",
                "required": ["kind"],
                "properties": {"kind": {"enum": list(KINDS), "description": "what goes wrong"}},
                "allOf": [_schema_of_kind(name, kind) for name, kind in KINDS.items()],
            },
        }
    },
}


def of_kind(faults: Sequence[Fault], kind: type[F]) -> list[F]:
    """The faults of one kind."""
    return [fault for fault in faults if isinstance(fault, kind)]
