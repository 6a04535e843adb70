"""Joseph-form updates against the dense formula, and the invariants of the covariance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.ekf2.filter.height_and_field_records import make_estimator, make_parameters, rotated_by_error

from fusetune.ekf2.filter.measurement_update import (
    constrain_state_variances,
    fuse,
    fuse_direct_state,
    measurement_update,
)

GYRO_Z, ACCEL_X = 11, 12


def estimator_with_covariance(seed, scale=0.05):
    rng = np.random.default_rng(seed)
    root = rng.normal(0, scale, (24, 24))
    ekf = make_estimator()
    ekf["P"][...] = root @ root.T + 1e-3 * np.eye(24)
    ekf["cs"]["mag"] = True
    ekf["cs"]["wind"] = True
    return ekf


def joseph(P, K, H, R):
    """(I - K H) P (I - K H)ᵀ + K R Kᵀ; Bierman 1977."""
    A = np.eye(24) - np.outer(K, H)
    return A @ P @ A.T + R * np.outer(K, K)


@pytest.mark.parametrize("inhibited", [False, True])
def test_direct_state_update_is_the_dense_joseph_form(inhibited):
    ekf = estimator_with_covariance(1)
    if inhibited:
        ekf["gyro_bias_inhibit"][2] = True
        ekf["accel_bias_inhibit"][0] = True
        ekf["cs"]["mag"] = False
        ekf["cs"]["wind"] = False
    P = ekf["P"].copy()
    R, state = 0.3, 4
    H = np.eye(24)[state]
    K = P[:, state] / (P[state, state] + R)
    if inhibited:
        K[[GYRO_Z, ACCEL_X]] = 0
        K[15:23] = 0
    fuse_direct_state(ekf, make_parameters(), 0.1, P[state, state] + R, R, state)
    np.testing.assert_allclose(ekf["P"], joseph(P, K, H, R), rtol=1e-10, atol=1e-14)


def test_update_with_a_full_jacobian_is_the_dense_joseph_form():
    ekf = estimator_with_covariance(2)
    rng = np.random.default_rng(3)
    P, R = ekf["P"].copy(), 0.2
    H = np.where(rng.random(24) < 0.4, rng.normal(size=24), 0.0)
    K = P @ H / (H @ P @ H + R)
    measurement_update(ekf, make_parameters(), K.copy(), H, R, 0.01)
    np.testing.assert_allclose(ekf["P"], joseph(P, K, H, R), rtol=1e-9, atol=1e-13)


def test_state_moves_by_gain_times_innovation():
    ekf = estimator_with_covariance(4)
    params = make_parameters()
    K = np.linspace(-0.02, 0.03, 24)
    q = ekf["q"].copy()
    before = {name: ekf[name].copy() for name in ("vel", "gyro_bias", "accel_bias", "mag_I", "mag_B", "wind_vel")}
    terrain, altitude = ekf["terrain"], ekf["gpos_alt"]
    innovation = 0.5
    fuse(ekf, params, K, innovation)
    np.testing.assert_allclose(ekf["q"], rotated_by_error(q, -K[:3] * innovation), atol=1e-15)
    for name, index in (("vel", 3), ("gyro_bias", 9), ("accel_bias", 12), ("mag_I", 15), ("mag_B", 18)):
        np.testing.assert_allclose(ekf[name], before[name] - K[index : index + 3] * innovation, rtol=1e-14)
    np.testing.assert_allclose(ekf["wind_vel"], before["wind_vel"] - K[21:23] * innovation, rtol=1e-14)
    # single precision
    assert ekf["gpos_alt"] == pytest.approx(altitude + K[8] * innovation, rel=1e-6)
    assert ekf["terrain"] == pytest.approx(terrain - K[23] * innovation, rel=1e-6)


def test_biases_stay_within_their_limits():
    ekf = estimator_with_covariance(5)
    params = make_parameters(EKF2_GYR_B_LIM=0.1, EKF2_ABL_LIM=0.2)
    fuse(ekf, params, np.full(24, 10.0), 1.0)
    np.testing.assert_array_equal(ekf["gyro_bias"], -params["EKF2_GYR_B_LIM"])
    np.testing.assert_array_equal(ekf["accel_bias"], -params["EKF2_ABL_LIM"])
    np.testing.assert_array_equal(ekf["mag_B"], -0.5)
    np.testing.assert_array_equal(ekf["mag_I"], -1.0)


def test_field_and_wind_stay_put_while_not_estimated():
    ekf = estimator_with_covariance(6)
    ekf["cs"]["mag"] = False
    ekf["cs"]["wind"] = False
    fuse(ekf, make_parameters(), np.full(24, 0.1), 1.0)
    for name in ("mag_I", "mag_B", "wind_vel"):
        np.testing.assert_array_equal(ekf[name], 0.0)


@given(
    seed=st.integers(0, 10_000),
    updates=st.lists(st.tuples(st.integers(0, 23), st.floats(1e-4, 10), st.floats(-1, 1)), min_size=1, max_size=12),
)
@settings(max_examples=60, deadline=None)
def test_covariance_stays_symmetric_and_positive_and_shrinks(seed, updates):
    ekf = estimator_with_covariance(seed)
    params = make_parameters()
    for state, R, innovation in updates:
        variance = ekf["P"][state, state]
        fuse_direct_state(ekf, params, innovation, variance + R, R, state)
        assert ekf["P"][state, state] <= variance * (1 + 1e-12)
    assert np.array_equal(ekf["P"], ekf["P"].T)
    assert np.linalg.eigvalsh(ekf["P"]).min() > 0
    assert np.linalg.norm(ekf["q"]) == pytest.approx(1.0, abs=1e-12)


def test_excessive_variance_is_fused_down_rather_than_clipped():
    """A fused zero innovation with R = 10 P takes P to 10/11 P and shrinks its covariances alike."""
    ekf = estimator_with_covariance(7)
    ekf["P"][...] = np.diag(np.full(24, 0.1))
    ekf["P"][2, 2] = 1.05
    ekf["P"][2, 3] = ekf["P"][3, 2] = 0.2
    constrain_state_variances(ekf, make_parameters())
    assert ekf["P"][2, 2] == pytest.approx(1.05 * 10 / 11)
    assert ekf["P"][2, 3] == pytest.approx(0.2 * 10 / 11)


def test_small_variances_are_raised_and_group_ratio_is_kept():
    ekf = estimator_with_covariance(8)
    ekf["P"][...] = np.diag(np.full(24, 0.1))
    ekf["P"][0, 0] = 1e-12
    ekf["P"][4, 4] = 0.0
    ekf["P"][13, 13] = 1e-12
    constrain_state_variances(ekf, make_parameters())
    assert ekf["P"][0, 0] == 1e-9
    assert ekf["P"][4, 4] == 1e-6
    assert ekf["P"][13, 13] == pytest.approx(0.1 / 1e6)
