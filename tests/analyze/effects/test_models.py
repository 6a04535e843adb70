"""The tuners' models are the filter's own, whose functions are called here as plain Python."""

from types import SimpleNamespace

import numpy as np
import pytest

from fusetune.analyze.effects.drag import HEADING, KAPPA_X, KAPPA_Y, M, predicted_force
from fusetune.analyze.effects.range_finder import _variances
from fusetune.analyze.effects.static_pressure import DIRECTIONS, pressure_heights
from fusetune.ekf2.filter.aid_sources.barometer.static_pressure import static_pressure_height_correction
from fusetune.ekf2.filter.aid_sources.drag.drag_fusion import inverse_ballistic_coefficients

RHO = 1.1


def drag(x: float, y: float, z: float, heading: float = 0.0) -> np.ndarray:
    values = np.zeros(8)
    values[[M, KAPPA_X, KAPPA_Y, HEADING]] = 0.2, 0.01, 0.02, heading
    return predicted_force(values, np.eye(3)[None], np.array([[x, y, z]]), np.zeros((1, 2)))


def test_drag_of_a_slanting_wind_by_hand() -> None:
    """κ = √(0.03² + 0.08²)/5 = 0.0170880; own = 0.2 + 0.0170880 · 5 = 0.2854400."""
    np.testing.assert_allclose(drag(3.0, 4.0, 0.0), [-0.85632, -1.14176], rtol=1e-5)


@pytest.mark.parametrize("air", [(3.0, 4.0, 0.0), (-8.0, 1.0, 2.0), (0.5, -6.0, -3.0)])
def test_drag_is_what_the_filter_predicts(air: tuple[float, float, float]) -> None:
    params = SimpleNamespace(EKF2_BCOEF_X=RHO / 0.02, EKF2_BCOEF_Y=RHO / 0.04)
    inverse = inverse_ballistic_coefficients.py_func(params, air[0], air[1])
    speed = np.linalg.norm(air)
    expected = [-(0.5 * RHO * inverse[axis] * speed + 0.2) * air[axis] for axis in range(2)]
    np.testing.assert_allclose(drag(*air), expected, rtol=1e-9)


def test_a_wrong_heading_turns_forward_into_sideward() -> None:
    assert drag(5.0, 0.0, 0.0, heading=0.01)[1] == pytest.approx(-0.01 * drag(5.0, 0.0, 0.0)[0], rel=0.01)


@pytest.mark.parametrize("air", [(9.0, -4.0, 1.0), (-7.0, 3.0, -2.0), (30.0, 0.0, 0.0)])
def test_static_pressure_is_what_the_filter_adds(air: tuple[float, float, float]) -> None:
    coefficients = dict(zip(DIRECTIONS, (0.1, -0.2, 0.3, 0.15, -0.05), strict=True))
    params = SimpleNamespace(EKF2_ASPD_MAX=20.0, **{f"EKF2_PCOEF_{name}": one for name, one in coefficients.items()})
    added = static_pressure_height_correction.py_func(params, *air)
    read = pressure_heights(np.array([air]), 400.0) @ list(coefficients.values())
    assert read[0] == pytest.approx(-added, rel=1e-12)


def test_noise_that_grows_with_the_distance_is_parted_from_the_one_that_does_not() -> None:
    """20 000 draws of σ² = 0.03² + (0.01 d)²: the likeliest figures are within some per cent."""
    rng = np.random.default_rng(6)
    distance = rng.uniform(0.5, 12.0, 20_000)
    squares = (0.03**2 + (0.01 * distance) ** 2) * rng.normal(size=distance.size) ** 2
    white, share = np.sqrt(_variances(squares, distance, grows=True))
    assert white == pytest.approx(0.03, rel=0.08)
    assert share == pytest.approx(0.01, rel=0.03)
