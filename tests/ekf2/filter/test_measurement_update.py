"""Joseph-form updates against the dense formula, and the invariants of the covariance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.ekf2.filter.height_and_field_records import make_estimator, make_parameters, rotated_by_error

from fusetune.ekf2.filter.measurement_update import (
    MAX_VARIANCE_REDUCTIONS,
    constrain_state_variances,
    fuse,
    fuse_direct_state,
    measurement_update,
)
from fusetune.ekf2.filter.observation_gain import compute_innovation_variance, compute_kalman_gain

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
    compute_kalman_gain(ekf, H, H @ P @ H + R)
    measurement_update(ekf, make_parameters(), R, 0.01)
    np.testing.assert_allclose(ekf["P"], joseph(P, K, H, R), rtol=1e-9, atol=1e-13)


@given(
    seed=st.integers(0, 10_000),
    seen=st.lists(st.integers(0, 23), min_size=1, max_size=8),
    still=st.sets(st.integers(0, 23)),
    inhibited=st.tuples(*4 * (st.booleans(),)),
)
@settings(max_examples=80, deadline=None)
def test_update_is_the_multiplied_out_form_bit_by_bit(seed, seen, still, inhibited):
    """P - (K PHᵀ + PH Kᵀ - S K Kᵀ) of whole matrices, where some states are correlated with no other."""
    ekf = estimator_with_covariance(seed)
    rng = np.random.default_rng(seed)
    for state in still:
        ekf["P"][state, np.arange(24) != state] = 0.0
        ekf["P"][np.arange(24) != state, state] = 0.0
    ekf["gyro_bias_inhibit"][1], ekf["accel_bias_inhibit"][2] = inhibited[:2]
    ekf["cs"]["mag"], ekf["cs"]["wind"] = inhibited[2:]
    P, H, R = ekf["P"].copy(), np.zeros(24), 0.3
    H[seen] = rng.normal(size=len(seen))
    S = compute_innovation_variance(ekf, H, R)
    assert pytest.approx(H @ P @ H + R, rel=1e-12) == S
    compute_kalman_gain(ekf, H, S)
    measurement_update(ekf, make_parameters(), R, 0.0)
    K, PH = ekf["scratch"]["K"].copy(), ekf["scratch"]["PH"].copy()
    np.testing.assert_allclose(PH, P @ H, rtol=1e-12, atol=1e-16)
    assert not K[[10] * inhibited[0] + [14] * inhibited[1]].any()
    assert inhibited[2] or not K[15:21].any()
    assert inhibited[3] or not K[21:23].any()
    expected = P - ((np.outer(K, PH) + np.outer(PH, K)) - np.outer(K, K) * S)
    np.testing.assert_array_equal(ekf["P"], expected)
    np.testing.assert_allclose(ekf["P"], joseph(P, K, H, R), rtol=1e-9, atol=1e-13)


def test_state_moves_by_gain_times_innovation():
    ekf = estimator_with_covariance(4)
    params = make_parameters()
    K = np.linspace(-0.02, 0.03, 24)
    q = ekf["q"].copy()
    before = {name: ekf[name].copy() for name in ("vel", "gyro_bias", "accel_bias", "mag_I", "mag_B", "wind_vel")}
    terrain, altitude = ekf["terrain"], ekf["gpos_alt"]
    innovation = 0.5
    ekf["scratch"]["K"][:] = K
    fuse(ekf, params, innovation)
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
    ekf["scratch"]["K"][:] = 10.0
    fuse(ekf, params, 1.0)
    np.testing.assert_array_equal(ekf["gyro_bias"], -params["EKF2_GYR_B_LIM"])
    np.testing.assert_array_equal(ekf["accel_bias"], -params["EKF2_ABL_LIM"])
    np.testing.assert_array_equal(ekf["mag_B"], -0.5)
    np.testing.assert_array_equal(ekf["mag_I"], -1.0)


def test_field_and_wind_stay_put_while_not_estimated():
    ekf = estimator_with_covariance(6)
    ekf["cs"]["mag"] = False
    ekf["cs"]["wind"] = False
    ekf["scratch"]["K"][:] = 0.1
    fuse(ekf, make_parameters(), 1.0)
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
    constrain_state_variances(ekf)
    assert ekf["P"][2, 2] == pytest.approx(1.05 * 10 / 11)
    assert ekf["P"][2, 3] == pytest.approx(0.2 * 10 / 11)


def test_small_variances_are_raised_and_group_ratio_is_kept():
    ekf = estimator_with_covariance(8)
    ekf["P"][...] = np.diag(np.full(24, 0.1))
    ekf["P"][0, 0] = 1e-12
    ekf["P"][4, 4] = 0.0
    ekf["P"][13, 13] = 1e-12
    constrain_state_variances(ekf)
    assert ekf["P"][0, 0] == 1e-9
    assert ekf["P"][4, 4] == 1e-6
    assert ekf["P"][13, 13] == pytest.approx(0.1 / 1e6)


GROUPS = (
    # states, least and largest variance, largest ratio within the group; PX4 v1.16, constrainStateVariances
    (range(0, 3), 1e-9, 1.0, None),
    (range(3, 9), 1e-6, 1e6, None),
    (range(9, 12), 1e-9, 1.0, 1e6),
    (range(12, 15), 1e-9, 1.0, 1e6),
    (range(15, 18), 1e-6, 1.0, 1e6),
    (range(18, 21), 1e-6, 1.0, 1e6),
    (range(21, 23), 1e-6, 1e6, 1e6),
    (range(23, 24), 0.0, 1e4, None),
)


def _exponents_of_variances():
    """Decades of 24 variances, up to 1.5 above each limit: ln(10^1.5) / ln(1.1) = 36.2 reductions of one state.

    More than that on all states at once, 888 reductions, is beyond `MAX_VARIANCE_REDUCTIONS` of one update.
    """
    highs = [high for states, _, high, _ in GROUPS for _ in states]
    assert 37 * len(highs) <= MAX_VARIANCE_REDUCTIONS
    return st.tuples(*(st.floats(-14, np.log10(high) + 1.5) for high in highs))


@given(exponents=_exponents_of_variances(), mag=st.booleans(), wind=st.booleans())
@settings(max_examples=80, deadline=None)
def test_limits_of_variances_are_those_of_each_group(exponents, mag, wind):
    """Uncorrelated states: too large ones go down by 10/11 until they fit, then too small ones are raised."""
    ekf = make_estimator()
    ekf["cs"]["mag"], ekf["cs"]["wind"] = mag, wind
    expected = 10.0 ** np.array(exponents)
    ekf["P"][...] = np.diag(expected)
    constrain_state_variances(ekf)
    for states, low, high, ratio in GROUPS:
        if (states[0] in (15, 18) and not mag) or (states[0] == 21 and not wind):
            continue
        for state in states:
            while expected[state] > high:
                expected[state] *= 10.0 / 11.0
        largest = max(expected[state] for state in states)
        for state in states:
            expected[state] = max(expected[state], low, largest / ratio if ratio else 0.0)
    np.testing.assert_allclose(np.diag(ekf["P"]), expected, rtol=1e-9)
    assert np.count_nonzero(ekf["P"]) == 24
