"""Values of parameters as callers give them."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.design.parameter_check import typed_values
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import ParameterError, check_value


def checked_values(parameters: Mapping[str, float], told_of: str) -> dict[str, float]:
    """EKF2 parameters with values that PX4 takes, of the type that it has them.

    Parameters
    ----------
    told_of : what the values are of, for the error

    Raises
    ------
    UserError
        PX4 has no such parameter, or forbids the value.
    """
    for name, value in parameters.items():
        try:
            check_value(name, value)
        except ParameterError as error:
            raise UserError(f"{told_of}: {error.name}", error.reason, error.remedy) from error
    return typed_values(parameters)
