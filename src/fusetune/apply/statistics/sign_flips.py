"""Is the best of many candidates better than the present set, or only the luckiest?

If a set is no better than the present one, its difference on a flight is as likely to be of either sign. Flipping the
signs of whole flights, alike for all candidates, shows what the best of these candidates reaches by luck. Candidates
that resemble each other cost little, unlike with Holm's correction, which takes them for unrelated.

By Student's t a gain of 3 % that hardly varies stands before one of 30 % that varies with how the vehicle was flown; by
the mean difference alone, a large set that is lucky hides a small one that is sure. Candidates are therefore measured
twice between the two, by their mean difference over a power of the size (root mean square) of their differences, which
flipping leaves as it is: 0 would be the mean difference, 1 is Student's t but for a monotone change. The better of the
two places counts, for the flips as for the candidates.
"""

import itertools
import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from fusetune.apply.statistics.rounding import without_rounding

Array = npt.NDArray[np.float64]

RANDOM_FLIPS = 4096
"""Flips that are tried where there are more; up to twelve flights all are."""

POWERS_OF_SIZE = (0.25, 0.75)
"""Powers of the size that mean differences are divided by."""

_EQUAL = 1e-9


def family_p_values(differences: Array, seed: int, most_flips: int = RANDOM_FLIPS) -> Array:
    """Probability that by luck the best of the candidates is as much better as each of them is.

    Parameters
    ----------
    differences : (F, C) score of each candidate less that of the present set on each flight; below 0 is better
    seed : of the flips, where there are too many to try all
    most_flips : how many are tried at most

    Returns
    -------
    (C,) one-sided p-values that hold for all candidates together (single-step, min-p over the two measures). Of the
    flips that reach just as far, the unflipped one among them, half count (mid-p), or five flights could hardly ever
    show anything. NaN, not known, with fewer than two flights. 1 for candidates that are equal to the present set, and
    for those that are clearly worse: they are not rivals, and do not count in the family either.

    References
    ----------
    Westfall and Young, "Resampling-Based Multiple Testing", 1993 (min-p); Hansen, "A Test for Superior Predictive
    Ability", Journal of Business & Economic Statistics 23(4), 2005 (leaving out clearly worse candidates); Lancaster,
    "Significance Tests in Discrete Distributions", JASA 56, 1961 (mid-p).
    """
    flights, candidates = differences.shape
    if flights < 2:
        return np.full(candidates, np.nan)
    differences = without_rounding(differences)
    p_values = np.ones(candidates)
    mean, size = differences.mean(axis=0), np.sqrt(np.square(differences).mean(axis=0))
    worse = _students_t(mean, size, flights) > math.sqrt(2.0 * math.log(math.log(max(flights, 3))))
    rivals = ~worse & (size > 0.0)
    if not rivals.any():
        return p_values
    signs = _signs(flights, seed, most_flips)
    places, flipped_places = [], []
    for power in POWERS_OF_SIZE:
        scale = size[rivals] ** power
        luckiest = (signs @ (differences[:, rivals] / scale) / flights).min(axis=1)
        ordered = np.sort(luckiest)
        places.append(_share_up_to(ordered, mean[rivals] / scale))
        flipped_places.append(_share_up_to(ordered, luckiest))
    place, luckiest_place = np.min(places, axis=0), np.sort(np.min(flipped_places, axis=0))
    further = np.searchsorted(luckiest_place, place - _EQUAL)
    as_far = np.searchsorted(luckiest_place, place + _EQUAL, side="right")
    p_values[rivals] = 0.5 * (further + as_far) / len(signs)
    return p_values


def _share_up_to(ordered: Array, values: Array) -> Array:
    """Share of the ordered values that are at most as large; equal ones must not be told apart by rounding."""
    return np.asarray(np.searchsorted(ordered, values + _EQUAL, side="right") / ordered.size)


def _students_t(mean: Array, size: Array, flights: int) -> Array:
    variance = np.maximum(np.square(size) - np.square(mean), 0.0) / (flights - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mean == 0.0, 0.0, mean / np.sqrt(variance))


@lru_cache(maxsize=32)
def _signs(flights: int, seed: int, most: int) -> Array:
    """(K, F) signs, the first row all +1; read-only, as they are kept for the next call."""
    if 2**flights <= most:
        signs = np.array(list(itertools.product((1.0, -1.0), repeat=flights)))
    else:
        generator = np.random.Generator(np.random.PCG64(seed))
        signs = generator.choice((1.0, -1.0), size=(most, flights))
        signs[0] = 1.0
    signs.setflags(write=False)
    return signs
