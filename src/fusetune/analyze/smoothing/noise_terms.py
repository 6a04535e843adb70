"""The likelihood of a linear model for many noises: what does not depend on them is added up once for each.

The normal equations are linear in the inverse variances. So for each noise, which stands for some rows of the model,
they are made once with a variance of 1, and for given noises only summed. A correlated error's own equations are so
few that they are written down anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.smoothing.linear_smoother import Equations, Likelihood, LinearModel, Solved, equations

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GaussMarkov:
    """The last states of a model as Gauss-Markov processes: their number, variance, and share that each step keeps."""

    states: int
    variance: float
    kept: Array


class NoiseTerms:
    """The likelihood of a model whose variances are those given, each times a factor for its noise.

    Parameters
    ----------
    model : as it would be with all factors 1; the last `markov` states are given with the noises
    process, measurement : rows of the noises, as slices of the states and of the measured axes
    markov : how many of the last states are Gauss-Markov processes
    """

    def __init__(
        self, model: LinearModel, process: Sequence[slice], measurement: Sequence[slice], markov: int = 0
    ) -> None:
        q, r = 1.0 / model.process_variance, 1.0 / model.measurement_variance
        self._terms = [equations(model, _only(q, rows), 0.0 * r) for rows in process]
        self._terms += [equations(model, 0.0 * q, _only(r, rows)) for rows in measurement]
        self._size = model.first_variance.size
        moving = self._size - markov
        self._first, self._constants = model.first_variance[:moving], model.constant_variance
        weights = [_known(q[:, rows]) for rows in process] + [_known(r[:, rows]) for rows in measurement]
        self._counts = np.array([one.size for one in weights])
        fixed = [np.log(self._first), np.log(self._constants), *(-np.log(one) for one in weights)]
        self._log_variances = sum(float(np.sum(one)) for one in fixed)

    def likelihood(self, factors: Sequence[float], markov: GaussMarkov | None = None) -> Likelihood:
        """Of all measurements.

        Parameters
        ----------
        factors : on the variances of the process noises, then of the measurement noises
        """
        given = self._summed(factors)
        given.banded[0, : self._first.size] += 1.0 / self._first
        given.corner.ravel()[: -given.corner.shape[0] : given.corner.shape[0] + 1] += 1.0 / self._constants
        log_variances = self._log_variances + float(self._counts @ np.log(factors))
        if markov is not None:
            log_variances += self._add_markov(given.banded, markov)
        solved = Solved(given)
        return Likelihood(solved.cost, solved.log_determinant + log_variances)

    def _summed(self, factors: Sequence[float]) -> Equations:
        first, *others = zip(self._terms, factors, strict=True)
        banded, border, corner = (values / first[1] for values in first[0].arrays)
        for term, factor in others:
            banded += term.banded / factor
            border += term.border / factor
            corner += term.corner / factor
        return Equations(banded, border, corner)

    def _add_markov(self, banded: Array, markov: GaussMarkov) -> float:
        """Their equations; the logarithms of their variances."""
        new = markov.variance * (1.0 - np.square(markov.kept))
        for state in range(self._size - markov.states, self._size):
            banded[0, state] += 1.0 / markov.variance
            banded[0, state :: self._size][:-1] += np.square(markov.kept) / new
            banded[0, state :: self._size][1:] += 1.0 / new
            banded[self._size, state :: self._size][:-1] -= markov.kept / new
        return markov.states * float(np.log(markov.variance) + np.sum(np.log(new)))


def _only(weights: Array, rows: slice) -> Array:
    """Weights of some columns, the others 0."""
    found = np.zeros_like(weights)
    found[:, rows] = weights[:, rows]
    return found


def _known(weights: Array) -> Array:
    return weights[weights > 0.0]
