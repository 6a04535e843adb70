"""Checks the parameters of a set against the metadata of PX4's EKF2 parameters."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, SENSOR_RATES, ParameterError, check_by
from fusetune.px4.parameters.set_names import in_baseline_names, read_by
from fusetune.px4.releases import BASELINE, Release

PARAMETER_PATTERN = "^[A-Z0-9_]{1,16}$"
"""Of names of PX4 parameters."""


def parameter_problem(name: str, value: float, replayed: Release = BASELINE) -> str | None:
    """What is wrong with a parameter of a release and its value, and what was expected; `None` where nothing is."""
    try:
        check_by(read_by(name, replayed), value)
    except ParameterError as error:
        return f"{error.name}: {error.reason} – {error.remedy[0].lower()}{error.remedy[1:]}"
    return None


def typed_values(parameters: Mapping[str, float]) -> dict[str, float]:
    """Known parameters with `int` values where the type is INT32 and `float` values elsewhere."""
    return {
        name: int(value) if name not in SENSOR_RATES and ALL_PARAMETERS[name].type == "INT32" else float(value)
        for name, value in parameters.items()
    }


def checked_values(parameters: Mapping[str, float], told_of: str, replayed: Release = BASELINE) -> dict[str, float]:
    """EKF2 parameters with values that PX4 takes, of the type that it has them, in the names of the baseline release.

    Parameters
    ----------
    told_of : what the values are of, for the error
    replayed : the release whose estimator reads them

    Raises
    ------
    UserError
        The release has no such parameter, or forbids the value.
    """
    try:
        for name, value in parameters.items():
            check_by(read_by(name, replayed), value)
        return typed_values(in_baseline_names(parameters))
    except ParameterError as error:
        raise UserError(f"{told_of}: {error.name}", error.reason, error.remedy) from error
