"""Values of parameters as callers give them."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.design.parameter_check import typed_values
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import ParameterError, check_by
from fusetune.px4.parameters.set_names import in_baseline_names, read_by
from fusetune.px4.releases import BASELINE, Release


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
