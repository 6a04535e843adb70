"""Parameter sets that people give as files, one `SET.json` each, beside the study: for single replays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from fusetune.ekf2.filter.common.parameters import parameters_beside
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    PARAMETERS,
    ParameterError,
    ParameterMetadata,
    metadata_of,
    number_of,
)
from fusetune.px4.parameters.logged_parameters import flown_limits, typed_value
from fusetune.px4.releases import number_of_name
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

WRITTEN_BACK = "EKF2_MAG_DECL"
"""The estimator writes this one back once it knows its place, so a recorded set holds the value at the end."""

OF_DRIVERS = "SENS_"
"""So parameters of the sensors' drivers begin, some of which took over from EKF2's; no estimator reads them."""

FORM = 'Expected {"params": {NAME: number, …}, "overrides": {NAME: number, …}}'

SetValues = tuple[dict[str, float], dict[str, float]]
"""EKF2 parameters used, and those that differ from the log."""


def existing_folder(folder: AnyPath, remedy: str) -> Path:
    """A folder that is there; else raises `UserError`, which tells nothing there from something else there."""
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(folder, "is no folder" if folder.exists() else "does not exist", remedy)
    return folder


def read_set_files(folder: AnyPath, release: str = BASELINE) -> dict[str, SetValues]:
    """Read every `SET.json` of a folder, in order of name; they may name parameters that a release has.

    Raises
    ------
    UserError
        There is no such folder, it holds no set, or a file is no set of parameters that the baseline release has.
    """
    folder = existing_folder(folder, "Name the folder that holds the parameter sets")
    files = sorted(folder.glob("*.json"))
    if not files:
        raise UserError(folder, "holds no parameter set", "Put one SET.json with a params object per set there")
    return {file.stem: read_set_file(file, release) for file in files}


def read_set_file(file: AnyPath, release: str = BASELINE) -> SetValues:
    """Read one set; a summary that a replay wrote is one, too.

    What the release has beside the baseline's, and its estimator does not read, is left out.

    Raises
    ------
    UserError
        The file is no set of parameters that the baseline release has.
    """
    content = read_document(file, remedy=FORM, sealed=False)
    params, overrides = (_numbers(file, content.get(part, {}), release) for part in ("params", "overrides"))
    params.pop(WRITTEN_BACK, None)
    return params, overrides


def _numbers(file: AnyPath, values: object, release: str) -> dict[str, float]:
    if not isinstance(values, Mapping):
        raise UserError(file, "is no parameter set: it holds something else than names and numbers", FORM)
    try:
        known = {name: _metadata(name, release) for name in values}
        numbers = {name: number_of(metadata, values[name]) for name, metadata in known.items() if metadata}
    except (ParameterError, OverflowError) as error:
        reason, remedy = (error.reason, error.remedy) if isinstance(error, ParameterError) else (str(error), FORM)
        name = f"{error.name}: " if isinstance(error, ParameterError) else ""
        raise UserError(file, f"{name}{reason}", remedy) from error
    for name, number in numbers.items():
        if name in PARAMETERS and typed_value(name, number) is None:
            low, high = flown_limits(name)
            raise UserError(
                file, f"{name} = {number:g} is nothing that can be flown", f"Give a number from {low:g} to {high:g}"
            )
    return numbers


def _metadata(name: str, release: str) -> ParameterMetadata | None:
    """Metadata of a parameter; None where the release has it beside the baseline, and does not read it."""
    if release != BASELINE and name.startswith(OF_DRIVERS):
        return None
    if name in PARAMETERS or name not in ALL_PARAMETERS or not ALL_PARAMETERS[name].exists_in(number_of_name(release)):
        return metadata_of(name)
    return ALL_PARAMETERS[name] if name in parameters_beside(release) else None
