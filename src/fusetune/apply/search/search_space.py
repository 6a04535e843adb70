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

_LONGEST_DELAY_MS = 300.0


def search_space(present: Mapping[str, float], names: Sequence[str], settings: SearchSettings) -> Space:
    """What is searched around what the vehicle flies.

    Parameters
    ----------
    present : its EKF2 parameters, name → value
    names : of those that are searched

    Raises
    ------
    UserError
        A parameter is none of those that are tuned, or a bound is out of its range.
    """
    try:
        # a longer delay brings a longer EKF2_DELAY_MAX along
        factors = factors_around({**present, DELAY_LIMIT: _LONGEST_DELAY_MS}, names, ratio=settings.ratio)
        bounded = tuple(_bounded(factor, settings.bounds.get(factor.parameter)) for factor in factors)
    except ParameterError as error:
        raise UserError(
            "search", str(error).removesuffix("."), "See docs/studies.md for all that can be searched"
        ) from error
    return Space(bounded, present.get(DELAY_LIMIT, PARAMETERS[DELAY_LIMIT].default))


def _bounded(factor: Factor, bounds: Sequence[float] | None) -> Factor:
    if bounds is None:
        return factor
    low, high = bounds
    for value in (low, high):
        check_value(factor.parameter, value)
    if not low < high:
        raise ParameterError(factor.parameter, f"its bounds {low:g} and {high:g} leave nothing between", "Mend them")
    return replace(factor, low=min(low, factor.origin), high=max(high, factor.origin))
