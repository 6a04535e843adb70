"""Proposals where the score is known to be a parabola: of delays and lever arms, near what is right.

What a lever arm that is wrong does to a velocity is proportional to how wrong it is (ω × Δr), and so, for small ones,
is what a delay does (a Δt); squares of errors are parabolas in both. A Gaussian process knows nothing of that, and with
few sets looks for the lowest point in far corners.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.apply.search.space import Space

Array = npt.NDArray[np.float64]

_NEAR, _LEAST_WEIGHT = 0.05, 0.01
"""Sets whose score is so much above the best, nat, count for a third, for far off the score is no parabola; and the
least that a set counts for, so that the slope is known."""

_RIDGE, _CROSS_RIDGE = 1e-4, 1e-2
"""A star says nothing of cross terms: without sets off its axes they are small."""
_STEP = 0.1
"""In half ranges: 10 ms of delay, 0.05 m of a lever arm."""


def propose_on_parabola(space: Space, points: Array, scores: Array, generation: int) -> list[dict[str, float]]:
    """The lowest point of the parabola through sets that were tried, and one beside it along each factor.

    Parameters
    ----------
    points, scores : (N, P), (N,) of the sets that were tried; lower is better
    generation : from 0; on which side the others lie changes with it
    """
    lowest = lowest_point(points, scores, space.bounds)
    found, known = [], {tuple(space.values(point).values()) for point in points}
    side = _STEP if generation % 2 == 0 else -_STEP
    for place in range(-1, len(space.factors)):
        point = lowest.copy()
        if place >= 0:
            point[place] = np.clip(point[place] + side, *space.bounds[place])
        values = space.values(point)
        if tuple(values.values()) not in known:
            known.add(tuple(values.values()))
            found.append(values)
    return found


def lowest_point(points: Array, scores: Array, bounds: Array) -> Array:
    """(P,) where a parabola with weights for good sets, all cross terms and a little ridge is lowest in the bounds."""
    from scipy.optimize import minimize

    best = points[np.argmin(scores)]
    weights = np.maximum(np.exp(-(scores - scores.min()) / _NEAR), _LEAST_WEIGHT)
    design = _terms(points - best)
    first, second = np.triu_indices(points.shape[1])
    ridge = np.diag(np.r_[np.zeros(1 + points.shape[1]), np.where(first == second, _RIDGE, _CROSS_RIDGE)])
    ridge += 1e-9 * np.eye(len(ridge))
    weighted = design * weights[:, None]
    coefficients = np.linalg.solve(weighted.T @ design + ridge, weighted.T @ scores)

    def value(point: Array) -> float:
        return float(_terms(point[None] - best)[0] @ coefficients)

    found = minimize(value, best, method="L-BFGS-B", bounds=[(float(low), float(high)) for low, high in bounds])
    return np.asarray(found.x)


def _terms(points: Array) -> Array:
    """(N, 1 + P + P (P + 1) / 2) of a full quadratic."""
    first, second = np.triu_indices(points.shape[1])
    return np.column_stack([np.ones(len(points)), points, points[:, first] * points[:, second]])
