"""What `search.json` says: what was found, what it is worth on flights that the search did not see, and every set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fusetune.apply.ranking import improvement_percent
from fusetune.apply.search.objective import objective
from fusetune.apply.search.rounds import ON_ALL, AskedRound, Searched
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Found

_AT_BOUND = 0.02
"""In half ranges: nearer to a bound a value is not told from it."""


def parameter_documents(found: Found, space: Space) -> dict[str, Any]:
    """By parameter of the search: from where to where, what it brings alone, and whether it ran into a bound."""
    return {
        factor.parameter: {
            "present": factor.origin,
            "found": found.values[factor.parameter],
            "before_putting_back": found.before_putting_back[factor.parameter],
            "is_changed": factor.parameter in found.changed,
            "alone_percent": alone_percent(found, factor.parameter),
            "at_bound": bound_of(factor.parameter, found.values, space),
            "scale": factor.scale,
            "low": factor.low,
            "high": factor.high,
        }
        for factor in space.factors
    }


def alone_percent(found: Found, parameter: str) -> float | None:
    """By how much errors would be larger with it alone put back to the present value."""
    return 100.0 * math.expm1(found.costs[parameter]) if parameter in found.costs else None


def bound_of(parameter: str, values: Mapping[str, float], space: Space) -> str:
    """ "lowest" or "highest" where a value lies at that bound, empty elsewhere."""
    place = space.parameters.index(parameter)
    point, (low, high) = space.point(values)[place], space.bounds[place]
    if abs(point) <= _AT_BOUND:
        return ""
    return "lowest" if point <= low + _AT_BOUND else "highest" if point >= high - _AT_BOUND else ""


def gain_percent(differences: Sequence[float]) -> float | None:
    """By how much errors are smaller, of mean score differences in nat; None where nothing is known."""
    known = [one for one in differences if math.isfinite(one)]
    return improvement_percent(float(np.mean(known))) if known else None


def search_documents(
    studied: Sequence[Searched],
    found: Sequence[Found],
    on_seen: Sequence[Sequence[float]],
    aside: Mapping[str, float],
) -> list[dict[str, Any]]:
    """Of each search: what it saw, what was kept aside, what it found, and what that is worth on both.

    Parameters
    ----------
    on_seen : of each search, the score differences of what it found on the flights that it saw, nat
    aside : by flight, those of what was found without it
    """
    return [
        {
            "search": one.name,
            "flights": list(one.flights),
            "kept_aside": list(one.aside),
            "values": result.values,
            "changed": list(result.changed),
            "gain_in_search_percent": gain_percent(seen),
            "gain_kept_aside_percent": gain_percent([aside[name] for name in one.aside]),
        }
        for one, result, seen in zip(studied, found, on_seen, strict=True)
    ]


def candidate_documents(asked: Sequence[AskedRound]) -> list[dict[str, Any]]:
    """Every set that was tried, in the order in which it was asked for; those of the search on all flights first."""
    ordered = sorted(asked, key=lambda one: (one.search.name != ON_ALL, one.search.name, one.number))
    rows = []
    for one in ordered:
        scores = objective(one.compared, one.ask.stage)
        for values, score, mean, objections in zip(
            one.ask.sets, scores, one.compared.means, one.compared.objections, strict=True
        ):
            rows.append(
                {
                    "search": one.search.name,
                    "round": one.number,
                    "stage": one.ask.stage,
                    "values": dict(values),
                    "objective": float(score),
                    "difference": float(mean) if math.isfinite(mean) else None,
                    "objections": list(objections),
                }
            )
    return rows
