"""Is the best of many candidates better than the present set, or only the luckiest?

If a set is no better than the present one, its difference on a flight is as likely to be of either sign. Flipping the
signs of whole flights, alike for all candidates, shows what the best of these candidates reaches by luck. Candidates
that resemble each other cost little, unlike with Holm's correction, which takes them for unrelated.
"""

import itertools
import math

import numpy as np
import numpy.typing as npt

from fusetune.apply.statistics.rounding import without_rounding

Array = npt.NDArray[np.float64]

MOST_ENUMERATED = 12
"""Up to this number of flights all flips are tried; beyond, `RANDOM_FLIPS` of them."""

RANDOM_FLIPS = 4096


def family_p_values(differences: Array, seed: int) -> Array:
    """Probability that by luck the best of the candidates is as much better as each of them is.

    Parameters
    ----------
    differences : (F, C) score of each candidate less that of the present set on each flight; below 0 is better
    seed : of the flips, where there are too many to try all

    Returns
    -------
    (C,) one-sided p-values that hold for all candidates together (single-step max-t). NaN, not known, with fewer than
    two flights. 1 for candidates that are equal to the present set, and for those that are clearly worse: they are not
    rivals, and do not count in the family either.

    References
    ----------
    Westfall and Young, "Resampling-Based Multiple Testing", 1993 (max-t); Hansen, "A Test for Superior Predictive
    Ability", Journal of Business & Economic Statistics 23(4), 2005 (leaving out clearly worse candidates).
    """
    flights, candidates = differences.shape
    if flights < 2:
        return np.full(candidates, np.nan)
    differences = without_rounding(differences)
    p_values = np.ones(candidates)
    found = _statistics(differences.mean(axis=0), np.square(differences).sum(axis=0), flights)
    rivals = (found <= math.sqrt(2.0 * math.log(math.log(max(flights, 3))))) & (differences != 0.0).any(axis=0)
    if not rivals.any():
        return p_values
    own = differences[:, rivals]
    flipped = _statistics(_signs(flights, seed) @ own / flights, np.square(own).sum(axis=0), flights)
    luckiest = flipped.min(axis=1)
    # The unflipped signs are one of the flips; equal values must not be told apart by rounding.
    p_values[rivals] = (luckiest[:, None] <= found[rivals] + 1e-9).mean(axis=0)
    return p_values


def _statistics(mean: Array, sum_of_squares: Array, flights: int) -> Array:
    """Student's t of mean differences; flipping signs leaves the sum of squares."""
    variance = np.maximum(sum_of_squares - flights * np.square(mean), 0.0) / (flights - 1)
    error = np.sqrt(variance / flights)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mean == 0.0, 0.0, mean / error)


def _signs(flights: int, seed: int) -> Array:
    """(K, F) signs, the first row all +1."""
    if flights <= MOST_ENUMERATED:
        return np.array(list(itertools.product((1.0, -1.0), repeat=flights)))
    generator = np.random.Generator(np.random.PCG64(seed))
    signs = generator.choice((1.0, -1.0), size=(RANDOM_FLIPS, flights))
    signs[0] = 1.0
    return signs
