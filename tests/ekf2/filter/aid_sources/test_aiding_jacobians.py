"""Analytic Jacobians of the aid sources against central differences of their own predictions.

The error state is perturbed as the filter corrects it: the attitude by a rotation in the NED frame, everything else
by addition.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import new_estimator, parameters

from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_fusion import compute_airspeed_jacobian, predict_airspeed
from fusetune.ekf2.filter.aid_sources.drag.drag_fusion import compute_drag_jacobian, predict_drag
from fusetune.ekf2.filter.aid_sources.external_vision.body_velocity_fusion import (
    compute_body_velocity_jacobian,
    predict_body_velocity,
)
from fusetune.ekf2.filter.aid_sources.gravity.gravity_fusion import compute_gravity_jacobian
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import compute_flow_jacobian, predict_flow
from fusetune.ekf2.filter.aid_sources.sideslip.sideslip_fusion import compute_sideslip_jacobian, predict_sideslip
from fusetune.ekf2.filter.common.state import (
    ACCEL_BIAS,
    ATTITUDE,
    ERROR_STATE_SIZE,
    GYRO_BIAS,
    POSITION,
    TERRAIN,
    VELOCITY,
    WIND,
)
from fusetune.ekf2.filter.observation_gain import compute_innovation_variance, compute_kalman_gain
from fusetune.ekf2.numerics.rotations import quat_to_dcm, rotate_by_earth_increment

STEP = 1e-5


def _random_state(seed: int) -> np.ndarray:
    """A vehicle tilted by up to some 40°, flying in wind some metres above the ground."""
    rng = np.random.default_rng(seed)
    memory = new_estimator()
    ekf = memory[0]
    rotate_by_earth_increment(ekf["q"], 0.0, 0.0, rng.uniform(-3.0, 3.0))
    rotate_by_earth_increment(ekf["q"], *rng.uniform(-0.5, 0.5, 2), 0.0)
    quat_to_dcm(ekf["q"], ekf["R_to_earth"])
    ekf["vel"] = rng.normal(0.0, 6.0, 3)
    ekf["wind_vel"] = rng.normal(0.0, 3.0, 2)
    ekf["gpos_alt"] = 488.0
    ekf["terrain"] = -480.0
    return memory


def _perturb(memory: np.ndarray, index: int, delta: float) -> np.void:
    ekf = memory.copy()[0]
    if index < VELOCITY:
        rotation = np.zeros(3)
        rotation[index - ATTITUDE] = delta
        rotate_by_earth_increment(ekf["q"], *rotation)
        quat_to_dcm(ekf["q"], ekf["R_to_earth"])
    elif index < POSITION:
        ekf["vel"][index - VELOCITY] += delta
    elif index == POSITION + 2:
        ekf["gpos_alt"] -= delta
    elif GYRO_BIAS <= index < ACCEL_BIAS:
        ekf["gyro_bias"][index - GYRO_BIAS] += delta
    elif WIND <= index < TERRAIN:
        ekf["wind_vel"][index - WIND] += delta
    elif index == TERRAIN:
        ekf["terrain"] += delta
    return ekf


def _numerical_jacobian(memory: np.ndarray, predict: Callable[[np.void], float]) -> np.ndarray:
    return np.array(
        [
            (predict(_perturb(memory, i, STEP)) - predict(_perturb(memory, i, -STEP))) / (2.0 * STEP)
            for i in range(ERROR_STATE_SIZE)
        ]
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("compute", "predict", "states", "atol"),
    [
        (compute_gravity_jacobian, lambda ekf, axis: -ekf["R_to_earth"][2, axis], 2, 1e-9),
        (compute_body_velocity_jacobian, predict_body_velocity, 6, 1e-7),
    ],
    ids=["gravity", "body_velocity"],
)
def test_vector_in_the_body_frame(
    compute: Callable[[np.void, np.ndarray], None],
    predict: Callable[[np.void, int], float],
    states: int,
    atol: float,
    axis: int,
    seed: int,
) -> None:
    """It depends on the first error states alone."""
    memory = _random_state(seed)
    jacobian = np.zeros((3, states))
    compute(memory[0], jacobian)
    expected = _numerical_jacobian(memory, lambda ekf: predict(ekf, axis))
    np.testing.assert_allclose(jacobian[axis], expected[:states], atol=atol)
    np.testing.assert_allclose(expected[states:], 0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_airspeed(seed: int) -> None:
    memory = _random_state(seed)
    jacobian = np.zeros(ERROR_STATE_SIZE)
    compute_airspeed_jacobian(memory[0], jacobian)
    np.testing.assert_allclose(jacobian, _numerical_jacobian(memory, predict_airspeed), atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_sideslip(seed: int) -> None:
    memory = _random_state(seed)
    jacobian = np.zeros(ERROR_STATE_SIZE)
    compute_sideslip_jacobian(memory[0], jacobian)
    expected = _numerical_jacobian(memory, predict_sideslip)
    np.testing.assert_allclose(jacobian, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(2))
def test_optical_flow(seed: int, axis: int) -> None:
    """The Jacobian keeps the height from zero by 1 mm, which is 1 part in 8000 here."""
    memory = _random_state(seed)
    jacobian = np.zeros(ERROR_STATE_SIZE)
    compute_flow_jacobian(memory[0], axis, jacobian)
    params = parameters()[0]
    expected = _numerical_jacobian(memory, lambda ekf: predict_flow(ekf, params, 0.0, 0.0, 0.0)[axis])
    np.testing.assert_allclose(jacobian, expected, rtol=3e-4, atol=1e-7)
    assert jacobian[TERRAIN] != 0.0
    assert jacobian[POSITION + 2] == -jacobian[TERRAIN]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(2))
@pytest.mark.parametrize("inverse_bcoef", [0.0, 0.04])
def test_drag(seed: int, axis: int, inverse_bcoef: float) -> None:
    memory = _random_state(seed)
    jacobian = np.zeros(ERROR_STATE_SIZE)
    compute_drag_jacobian(memory[0], axis, 1.1, inverse_bcoef, 0.15, jacobian)
    expected = _numerical_jacobian(memory, lambda ekf: predict_drag(ekf, axis, 1.1, inverse_bcoef, 0.15))
    np.testing.assert_allclose(jacobian, expected, atol=1e-7)


def test_gain_and_innovation_variance_are_the_kalman_filters() -> None:
    rng = np.random.default_rng(7)
    memory = new_estimator()
    root = rng.normal(size=(ERROR_STATE_SIZE, ERROR_STATE_SIZE))
    memory[0]["P"] = root @ root.T
    jacobian = np.where(rng.uniform(size=ERROR_STATE_SIZE) < 0.3, rng.normal(size=ERROR_STATE_SIZE), 0.0)
    variance = compute_innovation_variance(memory[0], jacobian, 0.7)
    assert variance == pytest.approx(jacobian @ memory[0]["P"] @ jacobian + 0.7, rel=1e-12)
    compute_kalman_gain(memory[0], jacobian, variance)
    np.testing.assert_allclose(memory[0]["scratch"]["K"], memory[0]["P"] @ jacobian / variance, rtol=1e-12)
