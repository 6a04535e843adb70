"""The space of a search around what a vehicle flies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fusetune.apply.search.space import Space
from fusetune.design.factors import Factor, factors_around
from fusetune.design.search_settings import SearchSettings
from fusetune.design.tunable_parameters import DELAY_LIMIT
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, check_value
from fusetune.storage.files import AnyPath

_LONGEST_DELAY_MS = 300.0


def search_space(
    present: Mapping[str, float], names: Sequence[str], settings: SearchSettings, asked_in: AnyPath = "search"
) -> Space:
    """What is searched around what the vehicle flies.

    Parameters
    ----------
    present : its EKF2 parameters, name → value
    names : of those that are searched
    asked_in : file that the settings come from, for errors

    Raises
    ------
    UserError
        A parameter is none of those that are tuned, a bound is out of its range or of a parameter that is not searched.
    """
    idle = [name for name in settings.bounds if name not in names]
    if idle:
        raise UserError(
            asked_in,
            f"gives bounds of {', '.join(idle)}, of which these flights cannot tell, or which is not to be searched",
            f"Searched are {', '.join(names)}; leave out the others' bounds",
        )
    try:
        # a longer delay brings a longer EKF2_DELAY_MAX along
        factors = factors_around({**present, DELAY_LIMIT: _LONGEST_DELAY_MS}, names, ratio=settings.ratio)
        bounded = tuple(_bounded(factor, settings.bounds.get(factor.parameter)) for factor in factors)
    except ParameterError as error:
        raise _parameter_error(error, asked_in) from error
    return Space(bounded, present.get(DELAY_LIMIT, PARAMETERS[DELAY_LIMIT].default))


def demand_searchable(settings: SearchSettings, asked_in: AnyPath) -> None:
    """See that all parameters and bounds are of those that can be tuned, before anything is begun.

    Raises
    ------
    UserError
        One is not.
    """
    for name in (*settings.parameters, *settings.bounds):
        try:
            factors_around({}, [name])
        except ParameterError as error:
            raise _parameter_error(error, asked_in) from error


def _parameter_error(error: ParameterError, asked_in: AnyPath) -> UserError:
    remedy = f"{error.remedy.removesuffix('.')}; docs/studies.md lists all that can be searched"
    return UserError(asked_in, f"{error.name}: {error.reason}", remedy)


def _bounded(factor: Factor, bounds: Sequence[float] | None) -> Factor:
    if bounds is None:
        return factor
    low, high = bounds
    for value in (low, high):
        check_value(factor.parameter, value)
    if not low < high:
        raise ParameterError(factor.parameter, f"its bounds {low:g} and {high:g} leave nothing between", "Mend them")
    return replace(factor, low=min(low, factor.origin), high=max(high, factor.origin))
