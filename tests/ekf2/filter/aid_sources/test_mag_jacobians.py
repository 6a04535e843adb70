"""Jacobians of field and declination against numerical differentiation by the error state."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import make_estimator, rotated_by_error, set_quaternion

from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import compute_declination_h, compute_mag_h, predict_mag
from fusetune.ekf2.filter.common.state import MAG_BODY, MAG_EARTH

STEP = 1e-6


def _random_estimator(seed: int) -> np.void:
    rng = np.random.default_rng(seed)
    ekf = make_estimator()
    q = rng.normal(size=4)
    set_quaternion(ekf, q / np.linalg.norm(q))
    ekf["mag_I"][:] = rng.uniform(-0.4, 0.4, 3)
    ekf["mag_B"][:] = rng.uniform(-0.1, 0.1, 3)
    return ekf


def _perturbed(ekf: np.void, error: np.ndarray) -> np.void:
    moved = make_estimator()
    set_quaternion(moved, rotated_by_error(ekf["q"].copy(), error[:3]))
    moved["mag_I"][:] = ekf["mag_I"] + error[MAG_EARTH : MAG_EARTH + 3]
    moved["mag_B"][:] = ekf["mag_B"] + error[MAG_BODY : MAG_BODY + 3]
    return moved


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(3))
def test_field_jacobian(seed, axis):
    ekf = _random_estimator(seed)
    numerical = np.zeros(24)
    for i in range(24):
        error = np.zeros(24)
        error[i] = STEP
        numerical[i] = (predict_mag(_perturbed(ekf, error), axis) - predict_mag(_perturbed(ekf, -error), axis)) / (
            2 * STEP
        )
    H = np.empty(24)
    compute_mag_h(ekf, axis, H)
    np.testing.assert_allclose(H, numerical, atol=1e-9)


def test_predicted_field_is_earth_field_in_body_axes_plus_body_field():
    ekf = _random_estimator(7)
    expected = ekf["R_to_earth"].T @ ekf["mag_I"] + ekf["mag_B"]
    np.testing.assert_allclose([predict_mag(ekf, axis) for axis in range(3)], expected, atol=1e-15)


@pytest.mark.parametrize("field", [(0.21, 0.04, 0.4), (-0.2, 0.1, 0.3), (0.15, -0.3, -0.2), (-0.1, -0.1, 0.5)])
def test_declination_jacobian(field):
    field = np.array(field)
    numerical = np.zeros(24)
    for i in range(3):
        step = np.zeros(3)
        step[i] = STEP
        ahead, behind = field + step, field - step
        numerical[MAG_EARTH + i] = (np.arctan2(ahead[1], ahead[0]) - np.arctan2(behind[1], behind[0])) / (2 * STEP)
    H = np.empty(24)
    declination = compute_declination_h(field, H)
    # the single-precision epsilon on the north component moves declination by up to 1.5 epsilon over the field
    np.testing.assert_allclose(declination, np.arctan2(field[1], field[0]), atol=2e-6)
    np.testing.assert_allclose(H, numerical, rtol=2e-5, atol=1e-9)


def test_declination_of_a_vertical_field_is_defined():
    H = np.empty(24)
    assert np.isfinite(compute_declination_h(np.array([0.0, 0.0, 0.5]), H))
    assert np.isfinite(H).all()
