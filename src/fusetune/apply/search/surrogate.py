"""A cheap stand-in for the score: a Gaussian process over the sets tried so far.

It halves the error of a quadratic on the sets of three worlds that were kept aside (docs/search.md): gates and caps of
the estimator bend the score where no quadratic does.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FEWEST = 8
"""With fewer sets nothing is said about others."""

_FAR = 0.5
"""Scores beyond so many nat above the median say no more than that they are bad: one that is far off would bend the
surface where it matters."""


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Scores expected at points (N, P), and how uncertain they are, nat."""

    process: object
    offset: float
    scale: float

    def predict(self, points: Array) -> tuple[Array, Array]:
        """Mean and standard deviation (N,)."""
        mean, spread = self.process.predict(points, return_std=True)  # type: ignore[attr-defined]
        return self.offset + self.scale * mean, self.scale * spread

    def believing(self, point: Array) -> Surrogate:
        """The same, as if a set at a point (P,) had scored as expected: where it is asked next is elsewhere."""
        process = self.process
        mean = process.predict(point[None])  # type: ignore[attr-defined]
        points = np.vstack([process.X_train_, point])  # type: ignore[attr-defined]
        scores = np.r_[process.y_train_, mean]  # type: ignore[attr-defined]
        return Surrogate(_process(process.kernel_, fit=False).fit(points, scores), self.offset, self.scale)  # type: ignore[attr-defined]


def fit_surrogate(points: Array, scores: Array) -> Surrogate:
    """Fit the scores (N,) of sets at points (N, P), N at least `FEWEST`: Matérn 5/2, a length for each factor."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    clipped = np.minimum(scores, np.median(scores) + _FAR)
    offset, scale = float(np.mean(clipped)), float(np.std(clipped)) or 1.0
    kernel = ConstantKernel(1.0, (0.05, 50.0)) * Matern(
        np.full(points.shape[1], 1.5), (0.3, 15.0), nu=2.5
    ) + WhiteKernel(1e-3, (1e-5, 0.3))
    with warnings.catch_warnings():
        # a length at its bound is a factor that does not matter, or matters everywhere
        warnings.simplefilter("ignore", ConvergenceWarning)
        process = _process(kernel, fit=True).fit(points, (clipped - offset) / scale)
    return Surrogate(process, offset, scale)


def _process(kernel: object, *, fit: bool):  # type: ignore[no-untyped-def]
    from sklearn.gaussian_process import GaussianProcessRegressor

    return GaussianProcessRegressor(kernel, alpha=1e-8, optimizer="fmin_l_bfgs_b" if fit else None)
