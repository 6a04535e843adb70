"""Against the two textbook ways to the same figures: dense least squares, and Kalman filter with the RTS pass."""

import numpy as np
import pytest
from tests.analyze.smoothing.made_models import random_model

from fusetune.analyze.smoothing.linear_smoother import (
    LinearModel,
    measurement_residuals,
    process_residuals,
    smooth,
)


def dense_least_squares(model: LinearModel) -> tuple[np.ndarray, np.ndarray]:
    """States and constants as the solution of all weighted equations, written out as one matrix."""
    epochs, states = len(model.measured), model.observation.shape[1]
    constants = model.constant_variance.size
    unknowns = epochs * states + constants
    rows, right = [], []

    def equation(parts: list[tuple[slice, np.ndarray]], value: np.ndarray, variance: np.ndarray) -> None:
        row = np.zeros((variance.size, unknowns))
        for place, block in parts:
            row[:, place] += block
        rows.append(row / np.sqrt(variance)[:, None])
        right.append(value / np.sqrt(variance))

    at = [slice(k * states, (k + 1) * states) for k in range(epochs)]
    last = slice(epochs * states, unknowns)
    equation([(at[0], np.eye(states))], np.zeros(states), model.first_variance)
    equation([(last, np.eye(constants))], np.zeros(constants), model.constant_variance)
    for k in range(epochs):
        parts = [(at[k], model.observation), (last, model.observed_constants[k])]
        equation(parts, model.measured[k], model.measurement_variance[k])
    for k in range(epochs - 1):
        parts = [(at[k + 1], np.eye(states)), (at[k], -model.transition[k]), (last, -model.of_constants[k])]
        equation(parts, model.known[k], model.process_variance[k])
    found = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
    return found[:-constants].reshape(epochs, states), found[-constants:]


def kalman_and_rts(model: LinearModel) -> tuple[np.ndarray, np.ndarray, float]:
    """States, constants and −2 ln L of the recursion, with the constants as states that do not move."""
    epochs, states = len(model.measured), model.observation.shape[1]
    size = states + model.constant_variance.size
    x, P = np.zeros(size), np.diag(np.r_[model.first_variance, model.constant_variance])
    filtered, predicted, moves = [], [], []
    minus_two_ln = 0.0
    for k in range(epochs):
        if k:
            F = np.eye(size)
            F[:states] = np.hstack([model.transition[k - 1], model.of_constants[k - 1]])
            x = F @ x
            x[:states] += model.known[k - 1]
            P = F @ P @ F.T
            P[:states, :states] += np.diag(model.process_variance[k - 1])
            predicted.append((x, P))
            moves.append(F)
        H = np.hstack([model.observation, model.observed_constants[k]])
        S = H @ P @ H.T + np.diag(model.measurement_variance[k])
        innovation = model.measured[k] - H @ x
        minus_two_ln += innovation @ np.linalg.solve(S, innovation) + np.log(np.linalg.det(2.0 * np.pi * S))
        gain = P @ H.T @ np.linalg.inv(S)
        x, P = x + gain @ innovation, P - gain @ S @ gain.T
        filtered.append((x, P))
    smoothed = [filtered[-1][0]]
    for k in range(epochs - 2, -1, -1):
        (x, P), (ahead, ahead_P) = filtered[k], predicted[k]
        smoothed.insert(0, x + P @ moves[k].T @ np.linalg.solve(ahead_P, smoothed[0] - ahead))
    course = np.array(smoothed)
    return course[:, :states], course[0, states:], minus_two_ln


@pytest.mark.parametrize("seed", range(5))
def test_states_and_constants_are_those_of_dense_least_squares(seed: int) -> None:
    model = random_model(seed)
    found = smooth(model)
    states, constants = dense_least_squares(model)
    np.testing.assert_allclose(found.states, states, atol=1e-9)
    np.testing.assert_allclose(found.constants, constants, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_course_and_likelihood_are_those_of_the_kalman_filter_with_the_backward_pass(seed: int) -> None:
    model = random_model(seed)
    found = smooth(model)
    states, constants, minus_two_ln = kalman_and_rts(model)
    np.testing.assert_allclose(found.states, states, atol=1e-9)
    np.testing.assert_allclose(found.constants, constants, atol=1e-9)
    of_constant_factors = model.measured.size * np.log(2.0 * np.pi)
    assert found.likelihood.cost + found.likelihood.log_determinant + of_constant_factors == pytest.approx(
        minus_two_ln, abs=1e-8
    )


def test_two_measurements_of_a_walk_by_hand() -> None:
    """x0 ~ N(0, 1), x1 = x0 + w, all variances 1, measured 0 and 8.

    Normal equations: 3 x0 − x1 = 0 and −x0 + 2 x1 = 8, so x0 = 1.6 and x1 = 4.8; the covariance of the measurements
    is [[2, 1], [1, 3]], determinant 5, and the cost 8² · 2/5 = 25.6.
    """
    one = np.ones((1, 1))
    model = LinearModel(
        transition=one[None], of_constants=np.zeros((1, 1, 1)), known=np.zeros((1, 1)), process_variance=one,
        observation=one, observed_constants=np.zeros((2, 1, 1)), measured=np.array([[0.0], [8.0]]),
        measurement_variance=np.ones((2, 1)), first_variance=np.ones(1), constant_variance=np.ones(1),
    )  # fmt: skip
    found = smooth(model)
    np.testing.assert_allclose(found.states[:, 0], [1.6, 4.8])
    assert found.likelihood.cost == pytest.approx(25.6)
    assert found.likelihood.log_determinant == pytest.approx(np.log(5.0))


def test_residuals_of_a_course_without_noise_are_zero() -> None:
    model = random_model(3)
    made = np.random.default_rng(1)
    constants, states = made.normal(size=2), [made.normal(size=3)]
    for k in range(11):
        states.append(model.transition[k] @ states[-1] + model.of_constants[k] @ constants + model.known[k])
    course = np.array(states)
    np.testing.assert_allclose(process_residuals(model, course, constants), 0.0, atol=1e-12)
    seen = course @ model.observation.T + model.observed_constants @ constants
    np.testing.assert_allclose(measurement_residuals(model, course, constants), model.measured - seen, atol=1e-12)
