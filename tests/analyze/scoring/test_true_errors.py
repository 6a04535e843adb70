"""Errors by hand and against scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fusetune.analyze.metrics.error_figures import (
    ErrorFigure,
    attitude_figures,
    track_of,
    true_attitude,
    vector_figures,
)
from fusetune.analyze.scoring.true_errors import Reference, Truth, interpolate_quaternion


def by_name(figures: list[ErrorFigure]) -> dict[tuple[str, str], float]:
    return {(one.axis, one.metric): one.value for one in figures}


def test_figures_of_known_errors() -> None:
    # norms 5 and 10
    error = np.array([[3.0, 4.0, 0.0], [6.0, 8.0, 0.0]])
    figures = by_name(vector_figures("position", error, track_of(np.array([[1.0, 0.0, 0.0]] * 2))))
    assert figures["x", "rmse"] == pytest.approx(np.sqrt((9 + 36) / 2))
    assert figures["horizontal", "rmse"] == pytest.approx(np.sqrt((25 + 100) / 2))
    assert figures["all", "average_euclidean_error"] == pytest.approx(7.5)
    assert figures["all", "harmonic_error"] == pytest.approx(2 / (1 / 5 + 1 / 10))
    assert figures["all", "geometric_error"] == pytest.approx(np.sqrt(50.0))
    assert figures["all", "maximum_error"] == 10.0


def test_along_and_across_the_track() -> None:
    # flying east, an error of 3 m north and 4 m east
    track = track_of(np.array([[0.0, 2.0, 0.0]] * 2))
    figures = by_name(vector_figures("position", np.array([[3.0, 4.0, 0.0]] * 2), track))
    assert figures["along_track", "rmse"] == pytest.approx(4.0)
    assert figures["cross_track", "rmse"] == pytest.approx(3.0)


def quaternion(rotation: Rotation) -> np.ndarray:
    return np.atleast_2d(rotation.as_quat(scalar_first=True))


def test_attitude_errors_are_those_of_the_rotations() -> None:
    truth = Rotation.random(200, random_state=1)
    error = Rotation.from_rotvec(np.radians(3.0) * np.eye(3)[[0] * 200])
    figures = by_name(attitude_figures(quaternion(truth * error), true_attitude(quaternion(truth))))
    assert figures["all", "rmse"] == pytest.approx(3.0, abs=1e-6)


def test_a_heading_error_is_no_tilt() -> None:
    truth = Rotation.from_euler("ZYX", [[30.0, 10.0, -20.0]], degrees=True)
    turned = Rotation.from_euler("Z", 5.0, degrees=True) * truth
    figures = by_name(attitude_figures(quaternion(turned), true_attitude(quaternion(truth))))
    assert figures["heading", "rmse"] == pytest.approx(5.0)
    assert figures["tilt", "rmse"] == pytest.approx(0.0, abs=1e-5)


def test_a_tilt_error_is_no_heading_where_level() -> None:
    level = quaternion(Rotation.identity())
    rolled = quaternion(Rotation.from_euler("X", 2.0, degrees=True))
    figures = by_name(attitude_figures(rolled, true_attitude(level)))
    assert figures["tilt", "rmse"] == pytest.approx(2.0)
    assert figures["heading", "rmse"] == pytest.approx(0.0, abs=1e-9)


def test_quaternions_are_interpolated_across_a_change_of_sign() -> None:
    first, second = Rotation.identity(), Rotation.from_euler("Z", 2.0, degrees=True)
    pair = np.vstack([quaternion(first), -quaternion(second)])
    middle = interpolate_quaternion(np.array([0, 10]), pair, np.array([5]))
    angle = Rotation.from_quat(middle[0], scalar_first=True).magnitude()
    assert np.degrees(angle) == pytest.approx(1.0, abs=1e-6)


def test_what_is_kept_of_a_reference_is_that_of_the_same_times() -> None:
    reference = Reference(Truth(*(np.zeros(0, np.int64),) * 2, *(np.zeros(0),) * 3, None))
    made = iter(range(9))
    first, other = np.arange(5), np.arange(5) + 1
    asked = [
        reference.at(time, what, lambda: next(made)) for what in ("a", "b") for time in (first, first.copy(), other)
    ]
    assert asked == [0, 0, 1, 2, 2, 3]
