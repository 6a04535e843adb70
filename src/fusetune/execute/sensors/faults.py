"""Faults that can be switched on for a simulated flight."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from fusetune.design.config_file import load_schema, validate
from fusetune.design.yaml_reader import read_yaml

Vector = tuple[float, float, float]
F = TypeVar("F")


@dataclass(frozen=True)
class TimedFault:
    """A fault with a beginning and an end."""

    start_s: float
    """Seconds after take-off."""
    duration_s: float

    def holds(self, time_after_takeoff_s: np.ndarray) -> np.ndarray:
        """Whether the fault is on at the given times; (N,) bool."""
        return (time_after_takeoff_s >= self.start_s) & (time_after_takeoff_s < self.start_s + self.duration_s)


@dataclass(frozen=True)
class GnssOutage(TimedFault):
    """No GNSS: the receiver reports no fix, or sends nothing when `silent`."""

    silent: bool = False


@dataclass(frozen=True)
class GnssGlitch(TimedFault):
    """GNSS is off by a constant while its reported accuracy stays good."""

    offset_m: Vector = (0.0, 0.0, 0.0)
    """North, east, down."""
    velocity_offset_m_s: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class MagneticDisturbance(TimedFault):
    """An additional field, as of steel or a power line, that comes and goes smoothly."""

    field_gauss: Vector = (0.0, 0.0, 0.0)
    """North, east, down."""


@dataclass(frozen=True)
class StrongVibration(TimedFault):
    """The vehicle's vibration multiplied."""

    factor: float = 1.0


@dataclass(frozen=True)
class Clipping(TimedFault):
    """Shaking beyond the range of the accelerometer."""

    amplitude_m_s2: float = 220.0
    frequency_hz: float = 61.0


@dataclass(frozen=True)
class LoggerDropout(TimedFault):
    """The logger loses everything for a while and says so."""


@dataclass(frozen=True)
class DefaultProfile:
    """The log holds what PX4's default logging profile keeps: thinned topics, some IMU samples missing."""

    imu_loss: float = 0.03
    from_arming: bool = True


Fault = GnssOutage | GnssGlitch | MagneticDisturbance | StrongVibration | Clipping | LoggerDropout | DefaultProfile

_KINDS: dict[str, type[Any]] = {
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
    document = read_yaml(path)
    schema = {
        "type": "object",
        "additionalProperties": False,
        "required": ["faults"],
        "properties": {"faults": {"type": "array", "description": "list of faults"}},
    }
    validate(document, schema, path)
    return parse_faults(document["faults"], path)


def parse_faults(entries: Sequence[dict[str, Any]], file: str | os.PathLike[str] = "faults") -> tuple[Fault, ...]:
    """Faults from the list of mappings that a configuration file holds.

    Parameters
    ----------
    entries
        Each with `kind` and the keys of that kind, see ``schemas/faults.schema.yaml``.
    file
        Named in messages.

    Raises
    ------
    UserError
        An entry is broken; the message names the entry, the key and what was expected.
    """
    document = {"faults": list(entries)}
    schema = {"type": "object", "properties": {"faults": load_schema("fusetune.execute", "faults")}}
    schema["$defs"] = load_schema("fusetune.execute", "faults")["$defs"]
    validate(document, schema, file)
    faults = []
    for entry in entries:
        values = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
        del values["kind"]
        faults.append(_KINDS[entry["kind"]](**values))
    return tuple(faults)


def of_kind(faults: Sequence[Fault], kind: type[F]) -> list[F]:
    """The faults of one kind."""
    return [fault for fault in faults if isinstance(fault, kind)]
