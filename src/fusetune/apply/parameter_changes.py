"""What changes on the vehicle, and the two files: the new values and the way back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.px4.parameters.params_file import ParamEntry, ParamsHeader, write_params
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class ParameterChange:
    """One parameter that the decision changes."""

    name: str
    previous: float
    value: float
    type: Literal["INT32", "FLOAT"]
    unit: str
    reboot_required: bool
    alone: str = ""
    """What it brings alone, in words, where that is known."""


def parameter_changes(
    overrides: Mapping[str, float], previous: Mapping[str, float], alone: Mapping[str, str] | None = None
) -> tuple[ParameterChange, ...]:
    """Parameters of a set whose value differs, as float32, from what the vehicle has now, in order of name.

    `alone` says in words what one brings alone.
    """
    changes = []
    for name, value in sorted(overrides.items()):
        before = previous[name]
        if np.float32(value) != np.float32(before):
            metadata = PARAMETERS[name]
            told = (alone or {}).get(name, "")
            changes.append(
                ParameterChange(name, before, value, metadata.type, metadata.unit, metadata.reboot_required, told)
            )
    return tuple(changes)


def write_parameter_files(
    folder: AnyPath, changes: Sequence[ParameterChange], reason: str, firmware: str, origin: Sequence[str]
) -> list[Path]:
    """Write `best_params.params` and `rollback.params`; returns the two files.

    Parameters
    ----------
    reason : why the values change, written above each
    firmware : release of the vehicle, e.g. "v1.16.0"; "unknown" leaves it out of the head
    origin : comment lines for the head of both files: where the decision comes from

    Notes
    -----
    Where the present set is kept both files hold no parameter, and say so.
    """
    folder = Path(folder)
    forward = [
        _entry(change, change.value, (_was(change), *_alone(change), reason, *_reboot(change))) for change in changes
    ]
    back = [_entry(change, change.previous, (f"back from {_number(change.value, change)}",)) for change in changes]
    kept = () if changes else ("The present parameters are kept: there is nothing to load.",)
    written = []
    for name, entries, purpose in (
        ("best_params.params", forward, "fusetune: parameters to load"),
        ("rollback.params", back, "fusetune: the values before, to go back"),
    ):
        write_params(folder / name, entries, _header(firmware, (purpose, *origin, *kept)))
        written.append(folder / name)
    return written


def _header(firmware: str, comments: tuple[str, ...]) -> ParamsHeader:
    version, _, stage = firmware.removeprefix("v").partition("-")
    return ParamsHeader(version="" if firmware == "unknown" else version, stage=stage, comments=comments)


def _entry(change: ParameterChange, value: float, comments: tuple[str, ...]) -> ParamEntry:
    return ParamEntry(change.name, int(value) if change.type == "INT32" else value, change.type, comments)


def _number(value: float, change: ParameterChange) -> str:
    text = f"{int(value)}" if change.type == "INT32" else f"{value:.6g}"
    return f"{text} {change.unit}".rstrip()


def _was(change: ParameterChange) -> str:
    return f"previous value {_number(change.previous, change)}, new value {_number(change.value, change)}"


def _reboot(change: ParameterChange) -> tuple[str, ...]:
    return ("takes effect after a reboot",) if change.reboot_required else ()


def _alone(change: ParameterChange) -> tuple[str, ...]:
    return (change.alone,) if change.alone else ()
