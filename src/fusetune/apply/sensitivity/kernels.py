"""How alike the score is at two places of the parameters' coordinates: three assumptions, each richer than the last.

A kernel is the prior covariance of the score's difference to the present set, up to its amplitude. All vanish at the
present set, which lies at coordinate 0: there the difference is 0 by definition, whatever else is assumed.

References
----------
Rasmussen and Williams, "Gaussian Processes for Machine Learning", MIT Press 2006, chapters 2 and 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MAIN_EFFECTS, QUADRATIC, SMOOTH = "main effects", "quadratic", "smooth"


@dataclass(frozen=True, eq=False)
class Kernel:
    """Prior covariance over scaled coordinates.

    Attributes
    ----------
    name : `MAIN_EFFECTS` (a parabola in each factor, no interactions), `QUADRATIC` (a full quadratic) or `SMOOTH` (a
        full quadratic and what departs from it smoothly, as at kinks that gates and limits make)
    scales : (P,) coordinates are divided by these
    lengths : (P,) over which departures from the quadratic change, in scaled coordinates; of `SMOOTH` alone
    departure : prior variance of these departures where that of the quadratic's linear terms is 1
    """

    name: str
    scales: Array
    lengths: Array | None = None
    departure: float = 0.0

    def __call__(self, first: Array, second: Array) -> Array:
        """(M, N) between coordinates (M, P) and (N, P)."""
        one, other = first / self.scales, second / self.scales
        products = one @ other.T
        if self.name == MAIN_EFFECTS:
            return products + np.square(one) @ np.square(other).T
        covariance = products + np.square(products)
        if self.lengths is not None:
            covariance += self.departure * _pinned_gaussian(one / self.lengths, other / self.lengths)
        return covariance

    def variance(self, places: Array) -> Array:
        """(M,) prior variance at each of the coordinates (M, P)."""
        one = places / self.scales
        squares = np.square(one)
        if self.name == MAIN_EFFECTS:
            return np.asarray(squares.sum(axis=1) + np.square(squares).sum(axis=1))
        variance = squares.sum(axis=1) + np.square(squares.sum(axis=1))
        if self.lengths is not None:
            variance += self.departure * -np.expm1(-np.square(one / self.lengths).sum(axis=1))
        return np.asarray(variance)


def _pinned_gaussian(one: Array, other: Array) -> Array:
    """Squared exponential, given that the function is 0 at the origin."""
    of_one, of_other = np.square(one).sum(axis=1), np.square(other).sum(axis=1)
    apart = of_one[:, None] + of_other[None, :] - 2.0 * one @ other.T
    return np.exp(-0.5 * np.maximum(apart, 0.0)) - np.exp(-0.5 * of_one)[:, None] * np.exp(-0.5 * of_other)[None, :]
