"""Resets: state, covariance, counters, and the changes that are published."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import hamilton_product, make_estimator, make_parameters, set_attitude

from fusetune.ekf2.filter.resets.state_resets import (
    remember_reset_counters,
    reset_altitude_to,
    reset_horizontal_position_to,
    reset_horizontal_velocity_to,
    reset_quat_state_yaw,
    reset_vertical_velocity_to,
)
from fusetune.ekf2.numerics.rotations import euler_yaw


def correlated_estimator():
    ekf = make_estimator()
    ekf["P"][...] = np.full((24, 24), 0.1) + np.eye(24)
    ekf["output"]["size"] = 20
    ekf["time_delayed_us"] = 5_000_000
    remember_reset_counters(ekf)
    return ekf


def assert_uncorrelated(P, indices):
    for i in indices:
        row = P[i].copy()
        row[i] = 0
        assert not row.any()
        assert not P[:, i][np.arange(24) != i].any()


def test_horizontal_velocity_reset():
    ekf = correlated_estimator()
    ekf["vel"][:] = [1, 2, 3]
    reset_horizontal_velocity_to(ekf, make_parameters(), 4.0, -1.0, 0.5, math.nan)
    np.testing.assert_array_equal(ekf["vel"], [4, -1, 3])
    np.testing.assert_array_equal(ekf["state_reset"]["vel_ne_change"], [3, -3])
    assert ekf["state_reset"]["vel_ne_counter"] == 1
    assert ekf["P"][3, 3] == 0.5
    assert ekf["P"][4, 4] == 1.1, "a variance of NaN leaves the covariance alone"
    assert_uncorrelated(ekf["P"], [3, 6, 7])
    assert ekf["time_last_hor_vel_fuse"] == 5_000_000


def test_resets_of_one_update_add_up_and_the_next_starts_anew():
    ekf = correlated_estimator()
    params = make_parameters()
    reset_vertical_velocity_to(ekf, params, 1.0, 0.1)
    reset_vertical_velocity_to(ekf, params, 1.5, 0.1)
    assert ekf["state_reset"]["vel_d_change"] == 1.5
    assert ekf["state_reset"]["vel_d_counter"] == 2
    remember_reset_counters(ekf)
    reset_vertical_velocity_to(ekf, params, 1.25, 0.1)
    assert ekf["state_reset"]["vel_d_change"] == -0.25


def test_counters_wrap_at_eight_bits():
    ekf = correlated_estimator()
    ekf["state_reset"]["vel_d_counter"] = 255
    reset_vertical_velocity_to(ekf, make_parameters(), 1.0, 0.1)
    assert ekf["state_reset"]["vel_d_counter"] == 0


def test_variance_has_a_floor_of_one_centimetre():
    ekf = correlated_estimator()
    reset_altitude_to(ekf, make_parameters(), 12.0, 1e-9)
    assert ekf["P"][8, 8] == pytest.approx(1e-4)


def test_altitude_reset_moves_terrain_and_biases_along():
    ekf = correlated_estimator()
    ekf["gpos_alt"], ekf["terrain"] = 10.0, -8.0
    for name in ("baro_b_est", "gps_hgt_b_est", "ev_hgt_b_est"):
        ekf[name]["bias"] = 1.0
    reset_altitude_to(ekf, make_parameters(), 13.0, 0.5)
    assert ekf["gpos_alt"] == 13.0
    assert ekf["terrain"] + ekf["gpos_alt"] == pytest.approx(2.0), "height above ground is unchanged"
    assert ekf["state_reset"]["pos_d_change"] == -3.0
    assert ekf["state_reset"]["hagl_change"] == -3.0
    assert ekf["baro_b_est"]["bias"] == ekf["gps_hgt_b_est"]["bias"] == -2.0
    assert ekf["ev_hgt_b_est"]["bias"] == 4.0


def test_position_reset_publishes_metres():
    ekf = correlated_estimator()
    step = 100.0 / 6371000.0
    reset_horizontal_position_to(ekf, make_parameters(), step, -step, 1.0, 2.0)
    np.testing.assert_allclose(ekf["state_reset"]["pos_ne_change"], [100, -100], rtol=1e-9)
    assert ekf["P"][6, 6] == 1.0
    assert ekf["P"][7, 7] == 2.0
    assert_uncorrelated(ekf["P"], [6, 7])


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.5, 0.1), (0.1, -0.6)])
def test_yaw_reset_keeps_the_tilt(roll, pitch):
    """The direction of down in the body frame is what tilt means."""
    ekf = correlated_estimator()
    set_attitude(ekf, roll, pitch, 0.3)
    down, before = ekf["R_to_earth"][2].copy(), ekf["q"].copy()
    reset_quat_state_yaw(ekf, make_parameters(), -2.0, 0.04)
    np.testing.assert_allclose(ekf["R_to_earth"][2], down, atol=1e-12)
    assert euler_yaw(ekf["R_to_earth"]) == pytest.approx(-2.0, abs=1e-12)
    assert ekf["P"][2, 2] == 0.04
    assert_uncorrelated(ekf["P"], [2])
    after = hamilton_product(ekf["state_reset"]["quat_change"], before)
    assert abs(after @ ekf["q"]) == pytest.approx(1.0, abs=1e-12)
    assert ekf["state_reset"]["quat_counter"] == 1
