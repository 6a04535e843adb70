"""Parameter sets that people give as files, one `SET.json` each, beside the study: for single replays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    ParameterError,
    ParameterMetadata,
    number_of,
    parameters_of,
)
from fusetune.px4.parameters.logged_parameters import flown_limits, typed_value
from fusetune.px4.parameters.set_names import in_baseline_names, of_vehicle, read_by
from fusetune.px4.releases import BASELINE, Release
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

WRITTEN_BACK = "EKF2_MAG_DECL"
"""The estimator writes this one back once it knows its place, so a recorded set holds the value at the end."""

_OF_SENSORS = "SENS_"
"""How parameters begin that a vehicle of another release has beside EKF2's, and some of which took over from them."""

FORM = 'Expected {"params": {NAME: number, …}, "overrides": {NAME: number, …}}'

WITHOUT_EFFECT = "overrides_without_parameter"
"""Where a recorded set names the overrides that its release has no parameter for."""

_Known = Callable[[str, Release], ParameterMetadata]

SetValues = tuple[dict[str, float], dict[str, float]]
"""EKF2 parameters used, and those that differ from the log."""


def existing_folder(folder: AnyPath, remedy: str) -> Path:
    """A folder that is there; else raises `UserError`, which tells nothing there from something else there."""
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(folder, "is no folder" if folder.exists() else "does not exist", remedy)
    return folder


def read_set_files(folder: AnyPath, replayed: Release = BASELINE) -> dict[str, SetValues]:
    """Read every `SET.json` of a folder, in order of name.

    Parameters
    ----------
    replayed : the release whose estimator is to have them

    Raises
    ------
    UserError
        There is no such folder, it holds no set, or a file is no set of parameters that this release has.
    """
    folder = existing_folder(folder, "Name the folder that holds the parameter sets")
    files = sorted(folder.glob("*.json"))
    if not files:
        raise UserError(folder, "holds no parameter set", "Put one SET.json with a params object per set there")
    return {file.stem: read_set_file(file, replayed) for file in files}


def read_set_file(file: AnyPath, replayed: Release = BASELINE) -> SetValues:
    """Read one set; a summary that a replay wrote is one, too.

    Raises
    ------
    UserError
        The file is no set of parameters that the release has.
    """
    content = read_document(file, remedy=FORM, sealed=False)
    params = of_vehicle(_numbers(file, content.get("params", {}), replayed, _of_whole_set), replayed)
    overrides = _numbers(file, _with_effect(content), replayed, read_by)
    params.pop(WRITTEN_BACK, None)
    try:
        return params, in_baseline_names(overrides)
    except ParameterError as error:
        raise UserError(file, f"{error.name} {error.reason}", error.remedy) from error


def _with_effect(content: Mapping[str, Any]) -> object:
    """The overrides without those of which the file itself says that the release has no such parameter."""
    overrides, without = content.get("overrides", {}), content.get(WITHOUT_EFFECT, ())
    if not isinstance(overrides, Mapping) or not isinstance(without, Sequence):
        return overrides
    return {name: value for name, value in overrides.items() if name not in without}


def _numbers(file: AnyPath, values: object, replayed: Release, known: _Known) -> dict[str, float]:
    if not isinstance(values, Mapping):
        raise UserError(file, "is no parameter set: it holds something else than names and numbers", FORM)
    try:
        numbers = {name: _number(name, value, known, replayed) for name, value in values.items()}
    except (ParameterError, OverflowError) as error:
        reason, remedy = (error.reason, error.remedy) if isinstance(error, ParameterError) else (str(error), FORM)
        name = f"{error.name}: " if isinstance(error, ParameterError) else ""
        raise UserError(file, f"{name}{reason}", remedy) from error
    for name, number in numbers.items():
        if name in ALL_PARAMETERS and typed_value(name, number) is None:
            low, high = flown_limits(name)
            raise UserError(
                file, f"{name} = {number:g} is nothing that can be flown", f"Give a number from {low:g} to {high:g}"
            )
    return numbers


def _of_whole_set(name: str, replayed: Release) -> ParameterMetadata:
    """Metadata of a parameter of a vehicle, which may be of another release: what this one lacks has no effect."""
    own = ALL_PARAMETERS.get(name)
    if own is not None and replayed != BASELINE and own.exists_in(replayed):
        return own
    return parameters_of(replayed).get(name) or read_by(name, replayed)


def _number(name: str, value: Any, known: _Known, replayed: Release) -> float:
    is_of_sensors = known is _of_whole_set and name not in ALL_PARAMETERS and name.startswith(_OF_SENSORS)
    if is_of_sensors and replayed != BASELINE and isinstance(value, int | float):
        return float(value)
    return number_of(known(name, replayed), value)
