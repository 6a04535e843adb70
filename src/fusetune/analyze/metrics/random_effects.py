"""The mean of figures that each have an error of their own and vary by more than these.

Random effects after DerSimonian and Laird (1986); the error of the mean after Hartung and Knapp (2001), never smaller
than what the figures' own errors give.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class RandomEffects(NamedTuple):
    """Mean, its standard error, the degrees of freedom behind that, and the standard deviation between the figures."""

    mean: float
    standard_error: float
    freedom: int
    between: float


def random_effects(values: Sequence[float], errors: npt.ArrayLike) -> RandomEffects:
    """Join figures; of a single one the error is its own and the freedom 0.

    Parameters
    ----------
    values : (N,)
    errors : (N,) standard errors, above 0
    """
    value, own = np.asarray(values, np.float64), np.asarray(errors, np.float64)
    weight = own**-2
    mean = float(np.sum(weight * value) / weight.sum())
    freedom = value.size - 1
    if not freedom:
        return RandomEffects(mean, float(own[0]), 0, 0.0)
    excess = float(np.sum(weight * (value - mean) ** 2)) - freedom
    between = max(excess / float(weight.sum() - np.sum(weight**2) / weight.sum()), 0.0)
    weight = 1.0 / (own**2 + between)
    mean = float(np.sum(weight * value) / weight.sum())
    promised = 1.0 / float(weight.sum())
    scatter = float(np.sum(weight * (value - mean) ** 2)) / freedom * promised
    return RandomEffects(mean, max(scatter, promised) ** 0.5, freedom, between**0.5)
