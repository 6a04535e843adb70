"""The sums say how the true error of a replay moves, whatever was corrected in between."""

import numpy as np
import pytest
from tests.analyze.smoothing.made_steps import motion, replayed

from fusetune.analyze.smoothing.inertial_steps import cross_matrix, inertial_steps, transitions
from fusetune.quaternions import conjugate, multiply, rotation_vector

GYRO_BIAS, ACCEL_BIAS = np.array([4e-5, -3e-5, 5e-5]), np.array([0.02, -0.01, 0.015])


@pytest.mark.parametrize("corrected", [False, True])
def test_errors_at_one_update_follow_from_those_at_another(corrected: bool) -> None:
    made = motion(20.0, GYRO_BIAS, ACCEL_BIAS)
    generator = np.random.default_rng(4) if corrected else None
    steps = replayed(made, np.array([2e-3, -1e-3, 3e-3]), np.array([0.1, 0.2, -0.1]), generator)
    sums = inertial_steps(steps)
    velocity_error = made.velocity - steps.velocity
    rotation_error = rotation_vector(multiply(made.quaternion, conjugate(steps.quaternion)))

    start, stop = np.array([0, 300, 995, 1000]), np.array([200, 1400, 1013, 2000])
    by = transitions(sums, start, stop)
    velocity = velocity_error[start] + by.known_velocity + by.velocity_by_gyro @ GYRO_BIAS - by.turned @ ACCEL_BIAS
    velocity += np.einsum("kij,kj->ki", by.velocity_by_rotation, rotation_error[start])
    rotation = rotation_error[start] + by.known_rotation - by.turned @ GYRO_BIAS

    # what is left is of the second order: half the square of the rotation, over 11 s of some 10 m/s²
    left = 0.5 * np.square(np.linalg.norm(rotation_error, axis=1)).max()
    assert np.abs(velocity_error[stop] - velocity_error[start]).max() > 100.0 * left
    np.testing.assert_allclose(velocity, velocity_error[stop], atol=110.0 * left)
    np.testing.assert_allclose(rotation, rotation_error[stop], atol=10.0 * left)

    way = np.cumsum(0.5 * (velocity_error[1:] + velocity_error[:-1]) * 0.01, axis=0)
    way = np.vstack([np.zeros(3), way])
    grown = velocity_error[start] * by.passed_s[:, None] + by.known_position
    grown += np.einsum("kij,kj->ki", by.position_by_rotation, rotation_error[start])
    by_constants = by.velocity_by_gyro @ GYRO_BIAS - by.turned @ ACCEL_BIAS
    grown += 0.5 * by.passed_s[:, None] * by_constants
    # over the 0.2 s between two measurements; the constants come in as if evenly
    np.testing.assert_allclose(grown[2], (way[stop] - way[start])[2], atol=1e-4)


def test_bias_changes_count_from_the_first_update() -> None:
    """With the biases known from the first update on and no other error, nothing is left but what was corrected."""
    made = motion(5.0, np.zeros(3), np.zeros(3))
    sums = inertial_steps(replayed(made, np.zeros(3), np.zeros(3)))
    np.testing.assert_allclose(sums.known_velocity, 0.0, atol=1e-9)
    np.testing.assert_allclose(sums.known_rotation, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.diff(made.velocity, axis=0) / 0.01, sums.acceleration[1:], atol=1e-9)


def test_cross_matrix_is_the_cross_product() -> None:
    made = np.random.default_rng(0)
    a, b = made.normal(size=(2, 7, 3))
    np.testing.assert_allclose(np.einsum("kij,kj->ki", cross_matrix(a), b), np.cross(a, b))
