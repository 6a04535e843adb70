"""Fixed-interval smoothing of a linear Gaussian model: what a Kalman filter and the Rauch-Tung-Striebel pass find.

    x_{k+1} = Φ_k x_k + Γ_k g + u_k + w_k    w_k ~ N(0, diag Q_k)
    z_k     = H x_k + D_k g + e_k            e_k ~ N(0, diag R_k)

with x_0 and the constants g normal around 0. The most probable course is a least-squares problem whose normal
equations are block tridiagonal in the states, with a border for the constants: one banded Cholesky factor instead of a
recursion. Its determinant gives the likelihood, the same that the innovations of the filter give.

References
----------
Rauch, Tung and Striebel, "Maximum likelihood estimates of linear dynamic systems", 1965; Bell, "The iterated Kalman
smoother as a Gauss-Newton method", 1994.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbtrf, dpotrf, dpotrs, dtbtrs

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LinearModel:
    """The model for N epochs, n states, m constants and p measurements an epoch.

    Attributes
    ----------
    transition : (N − 1, n, n) Φ
    of_constants : (N − 1, n, m) Γ
    known : (N − 1, n) u
    process_variance : (N − 1, n) diagonals of Q, all above 0
    observation : (p, n) H
    observed_constants : (N, p, m) D
    measured : (N, p) z
    measurement_variance : (N, p) diagonals of R; infinite where there is no measurement, of which z is anything finite
    first_variance : (n,) of x_0
    constant_variance : (m,) of g
    """

    transition: Array
    of_constants: Array
    known: Array
    process_variance: Array
    observation: Array
    observed_constants: Array
    measured: Array
    measurement_variance: Array
    first_variance: Array
    constant_variance: Array


@dataclass(frozen=True)
class Likelihood:
    """How probable the measurements are: −2 ln L = `cost` + `log_determinant` + M ln 2π.

    Attributes
    ----------
    cost : sum of all squared residuals of the most probable course, each divided by its variance
    log_determinant : of the covariance of all M measurements
    """

    cost: float
    log_determinant: float


@dataclass(frozen=True)
class Smoothed:
    """The most probable course: `states` (N, n) and `constants` (m,), and the likelihood of the measurements.

    `constant_covariance` (m, m) is that of the errors of the constants, under the variances of the model.
    """

    states: Array
    constants: Array
    constant_covariance: Array
    likelihood: Likelihood


@dataclass(frozen=True)
class Equations:
    """Normal equations of states x, constants g and the number 1, in all of which the residuals are linear.

    They are linear in the inverse variances, so those of several noises add up.

    Attributes
    ----------
    banded : (2 n, N n) of x, in LAPACK's lower banded form
    border : (N n, m + 1) between x and the others, the 1 last
    corner : (m + 1, m + 1) of the others
    """

    banded: Array
    border: Array
    corner: Array

    @property
    def arrays(self) -> tuple[Array, Array, Array]:
        """All three."""
        return self.banded, self.border, self.corner


def equations(model: LinearModel, process: Array, measurement: Array) -> Equations:
    """Those of a model's residuals, without what is known of x_0 and g.

    Parameters
    ----------
    process, measurement : (N − 1, n) and (N, p) inverse variances, 0 for residuals that do not count
    """
    epochs, size = model.measured.shape[0], model.observation.shape[1]
    left = np.swapaxes(model.transition, 1, 2) * process[:, None, :]
    seen = model.observation.T[None] * measurement[:, None, :]
    diagonal = seen @ model.observation
    diagonal[:-1] += left @ model.transition
    diagonal[1:] += np.eye(size) * process[:, None, :]
    moves = np.concatenate([model.of_constants, model.known[:, :, None]], axis=2)
    sights = np.concatenate([-model.observed_constants, model.measured[:, :, None]], axis=2)
    border = -(seen @ sights)
    border[:-1] += left @ moves
    border[1:] -= process[:, :, None] * moves
    corner = _summed(sights, measurement) + _summed(moves, process)
    # as LAPACK wants them in memory, or it is given copies
    banded = np.asfortranarray(_banded(diagonal, -np.swapaxes(left, 1, 2)))
    return Equations(banded, np.asfortranarray(border.reshape(epochs * size, -1)), corner)


class Solved:
    """x is eliminated by A = L Lᵀ of its part, g from what is left; what is left then, of the 1, is the cost.

    LAPACK is called as it is: a search asks for some hundred of these, and what else its callers do takes as long.

    Attributes
    ----------
    constants : (m,)
    cost : of the most probable course
    log_determinant : of the equations of x and g
    """

    def __init__(self, given: Equations) -> None:
        """`given` is used up."""
        self._factor = _positive(dpbtrf(given.banded, lower=1, overwrite_ab=1))
        self._halved, info = dtbtrs(self._factor, given.border, uplo="L")
        assert info == 0, "a Cholesky factor has no zeros on its diagonal"
        # not by a matrix product: its order of summation could change with the number of cores
        corner = given.corner - np.einsum("ki,kj->ij", self._halved, self._halved)
        self._schur = _positive(dpotrf(corner[:-1, :-1], lower=1, clean=0))
        self.constants: Array = -dpotrs(self._schur, corner[:-1, -1], lower=1)[0]
        self.cost = float(corner[-1, -1] + corner[-1, :-1] @ self.constants)
        logarithms = np.log(self._factor[0]).sum() + np.log(self._schur.diagonal()).sum()
        self.log_determinant = 2.0 * float(logarithms)

    @cached_property
    def constant_covariance(self) -> Array:
        """(m, m)"""
        return np.asarray(dpotrs(self._schur, np.eye(self.constants.size), lower=1)[0])

    def states(self) -> Array:
        """(N n,) by the other half of the factor."""
        right = -self._halved[:, -1] - self._halved[:, :-1] @ self.constants
        found, info = dtbtrs(self._factor, right[:, None], uplo="L", trans="T")
        assert info == 0, "a Cholesky factor has no zeros on its diagonal"
        return np.asarray(found)[:, 0]


def _positive(found: tuple[Array, int]) -> Array:
    """A Cholesky factor, of LAPACK's answer."""
    factor, info = found
    if info:
        raise np.linalg.LinAlgError(f"the equations are not positive definite, from row {info} on")
    return factor


def smooth(model: LinearModel) -> Smoothed:
    """The most probable states and constants, given all measurements, and the likelihood of these."""
    given = equations(model, 1.0 / model.process_variance, 1.0 / model.measurement_variance)
    size = model.first_variance.size
    given.banded[0, :size] += 1.0 / model.first_variance
    given.corner[:-1, :-1] += np.diag(1.0 / model.constant_variance)
    solved = Solved(given)
    there = model.measurement_variance[np.isfinite(model.measurement_variance)]
    variances = (model.process_variance, there, model.first_variance, model.constant_variance)
    log_determinant = solved.log_determinant + sum(float(np.sum(np.log(one))) for one in variances)
    states = solved.states().reshape(-1, size)
    return Smoothed(states, solved.constants, solved.constant_covariance, Likelihood(solved.cost, log_determinant))


def _summed(columns: Array, weights: Array) -> Array:
    """Σ cᵀ W c over the epochs."""
    rows = (columns * weights[:, :, None]).reshape(-1, columns.shape[2])
    return np.asarray(np.einsum("ki,kj->ij", rows, columns.reshape(rows.shape)))


def process_residuals(model: LinearModel, states: Array, constants: Array) -> Array:
    """(N − 1, n) w of a course."""
    predicted = np.einsum("kij,kj->ki", model.transition, states[:-1]) + model.of_constants @ constants + model.known
    return np.asarray(states[1:] - predicted)


def measurement_residuals(model: LinearModel, states: Array, constants: Array) -> Array:
    """(N, p) e of a course."""
    return np.asarray(model.measured - states @ model.observation.T - model.observed_constants @ constants)


def _banded(diagonal: Array, below: Array) -> Array:
    """Symmetric block tridiagonal matrix in LAPACK's lower banded form.

    Parameters
    ----------
    diagonal : (N, n, n)
    below : (N − 1, n, n) blocks below the diagonal
    """
    epochs, size, _ = diagonal.shape
    banded = np.zeros((2 * size, epochs * size))
    for row in range(size):
        for column in range(size):
            if row >= column:
                banded[row - column, column::size] = diagonal[:, row, column]
            banded[size + row - column, column::size][:-1] = below[:, row, column]
    return banded
