"""Errors by hand, against scipy's rotations, and NEES against its distribution."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fusetune.analyze.metrics.attitude import error_in_ned
from fusetune.analyze.metrics.error_figures import (
    ErrorFigure,
    attitude_figures,
    nees_figures,
    track_of,
    true_attitude,
    vector_figures,
)


def by_name(figures: list[ErrorFigure]) -> dict[tuple[str, str], float]:
    return {(one.axis, one.metric): one.value for one in figures}


def quaternions(rotation: Rotation) -> np.ndarray:
    return np.atleast_2d(rotation.as_quat(scalar_first=True))


def test_components_have_mean_and_maximum_too() -> None:
    error = np.array([[1.0, 0.0, -3.0], [3.0, 0.0, 1.0]])
    figures = by_name(vector_figures("velocity", error, track_of(np.zeros((2, 3)))))
    assert figures["x", "mean_error"] == 2.0
    assert figures["z", "maximum_error"] == 3.0
    assert figures["z", "rmse"] == pytest.approx(np.sqrt(5.0))
    # No ground speed, no track to split along.
    assert ("along_track", "rmse") not in figures


def test_a_heading_offset_shows_as_its_mean() -> None:
    truth = Rotation.from_euler("ZYX", [[10.0, 5.0, 2.0], [170.0, -5.0, 1.0]], degrees=True)
    turned = Rotation.from_euler("Z", -6.0, degrees=True) * truth
    figures = by_name(attitude_figures(quaternions(turned), true_attitude(quaternions(truth))))
    assert figures["heading", "mean_error"] == pytest.approx(-6.0)
    assert figures["all", "average_euclidean_error"] == pytest.approx(6.0)
    assert figures["all", "harmonic_error"] == pytest.approx(6.0)


def test_the_attitude_error_is_the_rotation_vector_in_ned() -> None:
    truth = Rotation.random(50, random_state=2)
    vector = np.random.default_rng(3).normal(0.0, 0.1, (50, 3))
    estimate = Rotation.from_rotvec(vector) * truth
    signs = np.where(np.arange(50) % 2, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(error_in_ned(signs * quaternions(estimate), quaternions(truth)), vector, atol=1e-12)
    np.testing.assert_allclose(error_in_ned(quaternions(truth), quaternions(truth)), 0.0, atol=1e-12)


def test_nees_of_consistent_errors_lies_within_its_bounds_and_of_boastful_ones_beyond() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(2000, dtype=np.int64) * 200_000
    variance = np.tile([0.04, 0.09, 0.01], (2000, 1))
    error = rng.standard_normal((2000, 3)) * np.sqrt(variance)
    plain, effective = nees_figures("velocity", "all", time, error, variance, 0.99)
    assert plain.metric == "nees"
    assert plain.lower < plain.value < plain.upper
    assert effective.value == plain.value
    assert plain.value == pytest.approx(3.0, abs=0.15)
    boastful = nees_figures("velocity", "all", time, error, 0.5 * variance, 0.99)[0]
    assert boastful.value == pytest.approx(2.0 * plain.value)
    assert boastful.value > boastful.upper


def test_nees_of_correlated_errors_has_wider_bounds() -> None:
    rng = np.random.default_rng(5)
    slow = np.repeat(rng.standard_normal((40, 2)), 25, axis=0)
    time = np.arange(1000, dtype=np.int64) * 200_000
    plain, effective = nees_figures("p", "horizontal", time, slow, np.ones((1000, 2)), 0.95)
    assert effective.n < 200.0
    assert effective.lower < plain.lower
    assert effective.upper > plain.upper


def test_a_fitted_offset_costs_its_degrees_of_freedom() -> None:
    # Five pairs with their mean removed: Σ e² is χ² with 8 of 10 degrees, so the mean NEES is scaled by 5/4.
    error = np.random.default_rng(6).standard_normal((5, 2))
    error -= error.mean(axis=0)
    time = np.arange(5, dtype=np.int64) * 200_000
    figure = nees_figures("p", "horizontal", time, error, np.ones((5, 2)), 0.95, fitted=2)[0]
    assert figure.value == pytest.approx(np.mean(np.sum(error**2, axis=1)) * 5.0 / 4.0)


def test_no_nees_without_a_variance() -> None:
    time = np.arange(5, dtype=np.int64)
    assert nees_figures("p", "all", time, np.ones((5, 3)), np.zeros((5, 3)), 0.95) == []
