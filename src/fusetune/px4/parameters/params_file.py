"""QGroundControl's parameter files (``.params``), to the byte as QGroundControl writes them."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import as_float32
from fusetune.storage.files import atomic_path

_MAV_PARAM_TYPE = {"INT32": 6, "FLOAT": 9}
_TYPE_OF_CODE = {code: name for name, code in _MAV_PARAM_TYPE.items()}
_LONGEST_NAME = 16
PARAMETER_NAME = re.compile(f"[A-Z0-9_]{{1,{_LONGEST_NAME}}}")
"""Names that PX4's parameters have."""
_DECIMALS = 18
_COLUMNS = "# Vehicle-Id Component-Id Name Value Type"


@dataclass(frozen=True)
class ParamEntry:
    """One line of a parameter file, with the comment lines above it."""

    name: str
    value: float | int
    type: Literal["INT32", "FLOAT"]
    comments: tuple[str, ...] = ()


@dataclass(frozen=True)
class ParamsHeader:
    """What the head of a parameter file tells about the vehicle."""

    version: str = ""
    """Firmware version without ``v``, e.g. ``1.16.0``."""
    stage: str = ""
    """``dev``, ``alpha``, ``beta``, ``rc``; empty for a release."""
    git_revision: str = ""
    vehicle: str = "Multi-Rotor"
    stack: str = "PX4 Pro"
    comments: tuple[str, ...] = ()
    """Further comment lines between the head and the column names."""


@dataclass(frozen=True)
class VehicleAddress:
    """MAVLink system and component that the parameters belong to."""

    vehicle_id: int = 1
    component_id: int = 1


def write_params(
    path: str | os.PathLike[str],
    entries: Sequence[ParamEntry],
    header: ParamsHeader | None = None,
    address: VehicleAddress | None = None,
) -> None:
    """Write a parameter file that QGroundControl loads.

    Raises
    ------
    ValueError
        A name is longer than 16 characters or appears twice, a value is not finite, not whole for INT32, or a comment
        holds a line break.
    """
    lines = [*_head(header or ParamsHeader(), address or VehicleAddress())]
    names = [entry.name for entry in entries]
    if len(set(names)) != len(names):
        raise ValueError("a parameter appears twice")
    for entry in entries:
        lines += [_comment(text) for text in entry.comments]
        lines.append(_line(entry, address or VehicleAddress()))
    with atomic_path(path) as temporary:
        temporary.write_bytes("".join(line + "\n" for line in lines).encode())


def read_params(path: str | os.PathLike[str]) -> list[ParamEntry]:
    """Read a parameter file; comment lines directly above a parameter become its comments.

    Raises
    ------
    UserError
        The file cannot be read, or a line is not ``vehicle component name value type`` with tabs between.
    """
    file = Path(path)
    try:
        text = file.read_bytes().decode()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(file, f"cannot be read ({error})", "Save the parameters from QGroundControl again") from error
    entries: list[ParamEntry] = []
    comments: list[str] = []
    # only what ends lines for QGroundControl does: comments may hold what else Python takes for an end
    for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), start=1):
        if line.startswith("#"):
            comments.append(line[1:].strip())
        elif line.strip():
            entries.append(_entry(file, number, line, tuple(comments) if entries else _below_head(comments)))
            comments = []
    return entries


def _head(header: ParamsHeader, address: VehicleAddress) -> list[str]:
    lines = [
        f"# Onboard parameters for Vehicle {address.vehicle_id}",
        "#",
        f"# Stack: {header.stack}",
        f"# Vehicle: {header.vehicle}",
    ]
    if header.version:
        # QGroundControl puts a blank before the stage even where there is none
        lines.append(f"# Version: {header.version} {header.stage}")
    if header.git_revision:
        lines.append(f"# Git Revision: {header.git_revision}")
    if header.comments:
        lines += ["#", *(_comment(text) for text in header.comments)]
    return [*lines, "#", _COLUMNS]


def _below_head(comments: list[str]) -> tuple[str, ...]:
    """Comments after the column names: those of the first parameter."""
    columns = _COLUMNS[1:].strip()
    return tuple(comments[comments.index(columns) + 1 :]) if columns in comments else ()


def _comment(text: str) -> str:
    if "\n" in text or "\r" in text:
        raise ValueError("a comment holds a line break")
    return f"# {text}".rstrip()


def _line(entry: ParamEntry, address: VehicleAddress) -> str:
    if len(entry.name) > _LONGEST_NAME:
        raise ValueError(f"parameter name {entry.name} is longer than {_LONGEST_NAME} characters")
    fields = (address.vehicle_id, address.component_id, entry.name, _value_text(entry), _MAV_PARAM_TYPE[entry.type])
    return "\t".join(str(field) for field in fields)


def _value_text(entry: ParamEntry) -> str:
    if not math.isfinite(entry.value):
        raise ValueError(f"parameter {entry.name} has the value {entry.value}")
    if entry.type == "INT32":
        if entry.value != int(entry.value):
            raise ValueError(f"parameter {entry.name} is an INT32 but has the value {entry.value}")
        return str(int(entry.value))
    stored, decimals = as_float32(entry.value), _DECIMALS
    text = f"{stored:.{decimals}f}"
    while as_float32(float(text)) != stored:
        # below a billionth QGroundControl's own files lose digits; its reader takes any number of them
        decimals += _DECIMALS
        text = f"{stored:.{decimals}f}"
    return text


def _entry(file: Path, number: int, line: str, comments: tuple[str, ...]) -> ParamEntry:
    fields = line.split("\t")
    try:
        _, _, name, value, code = fields
        type_name = _TYPE_OF_CODE[int(code)]
        number_value: float | int = int(value) if type_name == "INT32" else as_float32(float(value))
    except (ValueError, KeyError, OverflowError) as error:
        raise UserError(
            file,
            f"line {number} is not a parameter: {line[:60]!r}",
            "Expected vehicle, component, name, value and type (6 for INT32, 9 for FLOAT), separated by tabs",
        ) from error
    return ParamEntry(name, number_value, "INT32" if type_name == "INT32" else "FLOAT", comments)
