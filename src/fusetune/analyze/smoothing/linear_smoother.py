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

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, cho_solve_banded, cholesky_banded

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

    @property
    def measurements(self) -> int:
        """How many there are, M."""
        return int(np.count_nonzero(np.isfinite(self.measurement_variance)))


@dataclass(frozen=True)
class Smoothed:
    """The most probable course.

    Attributes
    ----------
    states : (N, n)
    constants : (m,)
    cost : sum of all squared residuals, each divided by its variance, at the course
    log_determinant : of the covariance of all M measurements, so that −2 ln L = cost + log_determinant + M ln 2π
    """

    states: Array
    constants: Array
    cost: float
    log_determinant: float


def smooth(model: LinearModel) -> Smoothed:
    """The most probable states and constants, given all measurements, and the likelihood of these."""
    epochs, size = model.measured.shape[0], model.observation.shape[1]
    q, r = 1.0 / model.process_variance, 1.0 / model.measurement_variance
    left = np.swapaxes(model.transition, 1, 2) * q[:, None, :]
    seen = model.observation.T[None] * r[:, None, :]

    diagonal = seen @ model.observation
    diagonal[0] += np.diag(1.0 / model.first_variance)
    diagonal[:-1] += left @ model.transition
    diagonal[1:] += np.eye(size) * q[:, None, :]
    factor = cholesky_banded(
        _banded(diagonal, -np.swapaxes(left, 1, 2)), overwrite_ab=True, lower=True, check_finite=False
    )

    border = seen @ model.observed_constants
    border[:-1] += left @ model.of_constants
    border[1:] -= q[:, :, None] * model.of_constants
    corner = np.diag(1.0 / model.constant_variance)
    corner += np.einsum("kpi,kp,kpj->ij", model.observed_constants, r, model.observed_constants)
    corner += np.einsum("kni,kn,knj->ij", model.of_constants, q, model.of_constants)

    right = np.einsum("knp,kp->kn", seen, model.measured)
    right[:-1] -= np.einsum("kij,kj->ki", left, model.known)
    right[1:] += q * model.known
    right_constants = np.einsum("kpi,kp,kp->i", model.observed_constants, r, model.measured)
    right_constants -= np.einsum("kni,kn,kn->i", model.of_constants, q, model.known)

    flat = border.reshape(epochs * size, -1)
    solved = cho_solve_banded((factor, True), np.column_stack([right.ravel(), flat]), check_finite=False)
    schur = cho_factor(corner - flat.T @ solved[:, 1:], lower=True, check_finite=False)
    constants = cho_solve(schur, right_constants - flat.T @ solved[:, 0], check_finite=False)
    states = (solved[:, 0] - solved[:, 1:] @ constants).reshape(epochs, size)

    information = 2.0 * float(np.sum(np.log(factor[0])) + np.sum(np.log(np.diag(schur[0]))))
    there = model.measurement_variance[np.isfinite(model.measurement_variance)]
    variances = (model.process_variance, there, model.first_variance, model.constant_variance)
    log_determinant = information + sum(float(np.sum(np.log(one))) for one in variances)
    return Smoothed(states, constants, _cost(model, states, constants), log_determinant)


def process_residuals(model: LinearModel, states: Array, constants: Array) -> Array:
    """(N − 1, n) w of a course."""
    predicted = np.einsum("kij,kj->ki", model.transition, states[:-1]) + model.of_constants @ constants + model.known
    return np.asarray(states[1:] - predicted)


def measurement_residuals(model: LinearModel, states: Array, constants: Array) -> Array:
    """(N, p) e of a course."""
    return np.asarray(model.measured - states @ model.observation.T - model.observed_constants @ constants)


def _cost(model: LinearModel, states: Array, constants: Array) -> float:
    parts = (
        (process_residuals(model, states, constants), model.process_variance),
        (measurement_residuals(model, states, constants), model.measurement_variance),
        (states[0], model.first_variance),
        (constants, model.constant_variance),
    )
    return sum(float(np.sum(np.square(residual) / variance)) for residual, variance in parts)


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
