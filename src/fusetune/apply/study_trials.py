"""Trials out of the sets of a study and the flights that decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fusetune.apply.evidence import AIMS, AnalyzedFlight
from fusetune.apply.trials import Trials
from fusetune.design.factors import Factor
from fusetune.design.tunable_parameters import DELAY_SUFFIX
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, as_float32

_DOUBLING = 2.0


def trials_of_study(
    flights: Sequence[AnalyzedFlight], newest: AnalyzedFlight | None, present: str, vetoed: Sequence[str] = ()
) -> Trials | None:
    """The sets of a study as trials; None where no flight has evidence, or no set changes a parameter that has a scale.

    Factors are the parameters that any set has otherwise than the present one, without switches and selections, and
    without those that could not act on any of the flights. Their bounds are what was tried.

    Parameters
    ----------
    newest : the flight by whose log the present values are known
    vetoed : sets that something other than the score speaks against
    """
    counted = [flight for flight in flights if flight.evidence is not None]
    if not counted or newest is None or present not in newest.summary["sets"]:
        return None
    sets: Mapping[str, Any] = newest.summary["sets"]
    now = {**sets[present]["parameters"], **sets[present]["overrides"]}
    overrides = {name: one["overrides"] for name, one in sets.items() if _is_scored(name, counted)}
    names = tuple(overrides)
    factors = tuple(
        _factor(parameter, now[parameter], [one.get(parameter, now[parameter]) for one in overrides.values()])
        for parameter in _varied(overrides, now)
        if not _never_acts(parameter, now[parameter], overrides, counted)
    )
    if not factors:
        return None
    values = [[overrides[name].get(one.parameter, one.origin) for one in factors] for name in names]
    allowed = np.array([[name not in vetoed] * len(counted) for name in names])
    return Trials(
        factors,
        names,
        np.array(values, dtype=np.float64),
        tuple(flight.name for flight in counted),
        _differences(counted, names, present, None),
        {aim: _differences(counted, names, present, aim) for aim in AIMS},
        allowed,
    )


def _is_scored(name: str, flights: Sequence[AnalyzedFlight]) -> bool:
    return any(flight.evidence is not None and name in flight.evidence.row for flight in flights)


def _varied(overrides: Mapping[str, Mapping[str, float]], now: Mapping[str, float]) -> list[str]:
    """Parameters on a scale that some set has otherwise than the present one."""
    named = sorted({parameter for one in overrides.values() for parameter in one if parameter in now})
    return [
        parameter
        for parameter in named
        if parameter in PARAMETERS
        and PARAMETERS[parameter].kind == "float"
        and any(_differs(one.get(parameter, now[parameter]), now[parameter]) for one in overrides.values())
    ]


def _never_acts(
    parameter: str, now: float, overrides: Mapping[str, Mapping[str, float]], flights: Sequence[AnalyzedFlight]
) -> bool:
    """Whether no set that changes the parameter could act by it on any flight."""
    return all(
        parameter in flight.summary["sets"].get(name, {}).get("inactive", {})
        for flight in flights
        for name, one in overrides.items()
        if _differs(one.get(parameter, now), now)
    )


def _differs(value: float, now: float) -> bool:
    """Whether PX4 holds another value."""
    return as_float32(value) != as_float32(now)


def _factor(parameter: str, now: float, values: Sequence[float]) -> Factor:
    """A factor whose bounds are what was tried: on a logarithmic scale where ratios have a meaning."""
    low, high = min(now, *values), max(now, *values)
    if low > 0.0 and not parameter.endswith(DELAY_SUFFIX):
        return Factor(parameter, "log", low, high, now, _DOUBLING)
    return Factor(parameter, "linear", low, high, now, max(high - now, now - low))


def _differences(flights: Sequence[AnalyzedFlight], names: Sequence[str], present: str, aim: str | None) -> np.ndarray:
    """(N, F) scores less the present set's; NaN where a flight has no score of a set or does not have the aim."""
    table = np.full((len(names), len(flights)), np.nan)
    for column, flight in enumerate(flights):
        evidence = flight.evidence
        if evidence is None or (aim is not None and evidence.aim(aim) is None):
            continue
        rows = [row for row, name in enumerate(names) if name in evidence.row]
        table[rows, column] = evidence.differences([present, *(names[row] for row in rows)], aim)[1:]
    return table
