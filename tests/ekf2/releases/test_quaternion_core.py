"""The core of v1.13 and v1.14, whose attitude errors are additive in the quaternion.

Expected: numerical differentiation of q ⊗ (1, h), R(q) v and of the yaw, with rotations as squares of the elements;
products of whole matrices; and the formulas of docs/releases.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from tests.ekf2.releases.test_named_behaviours import Flying, asked, flying

from fusetune.ekf2.filter import (
    bias_inhibition,
    covariance,
    measurement_update,
    observation_gain,
    prediction,
    yaw_fusion,
)
from fusetune.ekf2.filter.aid_sources import zero_gyro_update, zero_velocity_update
from fusetune.ekf2.filter.aid_sources.gravity import gravity_fusion
from fusetune.ekf2.filter.common import imu_rates
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, GYRO_BIAS, MAG_EARTH, POSITION, VELOCITY, WIND
from fusetune.ekf2.filter.quaternion_core import attitude_jacobians, quaternion_covariance, quaternion_prediction
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3
from fusetune.ekf2.filter.resets import state_resets
from fusetune.ekf2.numerics.rotations import quat_to_dcm
from fusetune.ekf2.schedule.longest_delay import longest_delay_ms

V113, V114, V115 = "v1.13", "v1.14", "v1.15"
QUATERNION = [0, 1, 2, Q3]
G = 9.80665


@pytest.fixture
def it() -> Flying:
    return turned(flying(V114))


def turned(it: Flying) -> Flying:
    """Some attitude, and the covariance of a filter that has correlated everything."""
    q = np.array([0.8, -0.3, 0.4, 0.33166248])
    it.ekf["q"] = q / np.linalg.norm(q)
    quat_to_dcm(it.ekf["q"], it.ekf["R_to_earth"])
    it.ekf["cs"]["mag_3d"] = it.ekf["cs"]["wind"] = True
    it.ekf["quaternion"]["mean_dt"] = it.ekf["dt_ekf_avg"] = 0.01
    root = np.random.default_rng(5).normal(size=(24, 24)) * 0.01
    it.ekf["P"] = root @ root.T
    return it


def rotation(q: np.ndarray) -> np.ndarray:
    """PX4's rotation matrix, of squares of the elements: it grows with the norm."""
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def by_quaternion(function: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    """Derivative by the elements, one column each, from differences."""
    step = 1e-6
    columns = [(function(q + step * e) - function(q - step * e)) / (2 * step) for e in np.eye(4)]
    return np.stack(columns, axis=-1)


def by_error(function: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    """Derivative by attitude errors about north, east and down."""
    step = 1e-6

    def turned_by(error: np.ndarray) -> np.ndarray:
        n, e, d = error / 2
        left = np.array([[1, -n, -e, -d], [n, 1, -d, e], [e, d, 1, -n], [d, -e, n, 1]])
        return function(left @ q)

    return np.stack([(turned_by(step * e) - turned_by(-step * e)) / (2 * step) for e in np.eye(3)], axis=-1)


@pytest.mark.parametrize("axis", range(3))
def test_jacobians_by_attitude_errors_become_those_by_the_quaternion(it, axis):
    q, vector = np.array(it.ekf["q"]), np.array([0.2, -0.5, 1.5])
    H = np.zeros(24)
    H[:3] = by_error(lambda p: rotation(p).T @ vector, q)[axis]
    asked(attitude_jacobians.complete_attitude_jacobian, it, H, 2.0 * (rotation(q).T @ vector)[axis])
    assert np.allclose(H[QUATERNION], by_quaternion(lambda p: rotation(p).T @ vector, q)[axis], atol=1e-8)


def test_jacobians_stay_as_they_are_since_v1_15():
    it, H = flying(V115), np.arange(24.0)
    asked(attitude_jacobians.complete_attitude_jacobian, it, H, 3.0)
    assert H.tolist() == list(range(24))


@pytest.mark.parametrize("pitched", [False, True])
def test_the_yaw_is_differentiated_in_the_sequence_that_is_regular(it, pitched):
    q = np.array([0.68, 0.13, 0.7, -0.17] if pitched else [0.8, 0.4, 0.1, 0.33])
    q /= np.linalg.norm(q)
    it.ekf["q"] = q
    quat_to_dcm(it.ekf["q"], it.ekf["R_to_earth"])
    assert attitude_jacobians.uses_321_sequence(it.ekf["R_to_earth"]) != pitched

    def yaw(p: np.ndarray) -> np.ndarray:
        R = rotation(p)
        return np.array(math.atan2(-R[0, 1], R[1, 1]) if pitched else math.atan2(R[1, 0], R[0, 0]))

    H = np.zeros(24)
    variance = asked(yaw_fusion.compute_yaw_innov_var_and_h, it, 0.04, H)
    expected = by_quaternion(yaw, q)
    assert np.allclose(H[QUATERNION], expected, atol=1e-6)
    assert math.isclose(
        variance, expected @ it.ekf["P"][np.ix_(QUATERNION, QUATERNION)] @ expected + 0.04, rel_tol=1e-6
    )


def simple_rotation(q: np.ndarray) -> np.ndarray:
    """The rotation matrix of a unit quaternion with ones on its diagonal, which PX4's prediction differentiates."""
    R = rotation(q)
    np.fill_diagonal(R, 0.0)
    _w, x, y, z = q
    return R + np.diag([1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z), 1 - 2 * (x * x + y * y)])


def quaternion_product(p: np.ndarray, r: np.ndarray) -> np.ndarray:
    w, x, y, z = p
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]) @ r


def test_the_covariance_is_propagated_by_the_derivatives_of_the_prediction(it):
    ekf, dt = it.ekf, 0.01
    ekf["imu_delayed"]["delta_ang"], ekf["imu_delayed"]["delta_vel"] = (0.01, -0.02, 0.015), (0.03, -0.05, -0.09)
    ekf["gyro_bias"], ekf["accel_bias"] = (1e-4, -2e-4, 3e-4), (1e-3, 2e-3, -1e-3)
    q, before = np.array(ekf["q"]), np.array(ekf["P"])
    angle = np.array(ekf["imu_delayed"]["delta_ang"] - ekf["gyro_bias"])
    velocity = np.array(ekf["imu_delayed"]["delta_vel"] - ekf["accel_bias"])
    F, noise_gain = np.eye(24), np.zeros((24, 6))
    F[np.ix_(QUATERNION, QUATERNION)] = by_quaternion(lambda p: quaternion_product(p, np.r_[1.0, angle / 2]), q)
    by_angle = np.stack([quaternion_product(q, np.r_[0.0, e / 2]) for e in np.eye(3)], axis=-1)
    F[np.ix_(QUATERNION, range(GYRO_BIAS, GYRO_BIAS + 3))] = -by_angle
    F[VELOCITY : VELOCITY + 3, QUATERNION] = by_quaternion(lambda p: simple_rotation(p) @ velocity, q)
    F[VELOCITY : VELOCITY + 3, ACCEL_BIAS : ACCEL_BIAS + 3] = -rotation(q)
    F[POSITION : POSITION + 3, VELOCITY : VELOCITY + 3] = np.eye(3) * dt
    noise_gain[QUATERNION, :3] = by_angle
    noise_gain[VELOCITY : VELOCITY + 3, 3:] = rotation(q)
    sigma = np.r_[[dt * it.params["EKF2_GYR_NOISE"]] * 3, [dt * it.params["EKF2_ACC_NOISE"]] * 3]
    quaternion_prediction._propagate.py_func(ekf, dt)
    quaternion_prediction._add_imu_noise.py_func(ekf, it.params, dt)
    expected = F @ before @ F.T + noise_gain @ np.diag(sigma**2) @ noise_gain.T
    assert np.allclose(ekf["P"], expected, rtol=1e-7, atol=1e-13)
    assert np.array_equal(ekf["P"], ekf["P"].T)


def test_noise_is_that_of_increments_over_the_mean_interval(it):
    ekf, params, dt = it.ekf, it.params, 0.01
    ekf["gyro_bias_inhibit"][1], ekf["quaternion"]["kept_gyro_bias_var"][1] = 1, 7e-7
    ekf["imu_delayed"]["delta_vel"] = 0.0
    before = np.diag(ekf["P"]).copy()
    asked(prediction.predict_covariance, it, params)
    P, added = ekf["P"], np.diag(ekf["P"]) - before
    assert np.isclose(added[GYRO_BIAS], (dt * dt * params["EKF2_GYR_B_NOISE"]) ** 2, rtol=1e-4)
    assert P[GYRO_BIAS + 1, GYRO_BIAS + 1] == 7e-7
    assert np.count_nonzero(P[GYRO_BIAS + 1]) == 1
    assert np.isclose(added[MAG_EARTH], (dt * params["EKF2_MAG_E_NOISE"]) ** 2, rtol=1e-4)
    assert np.isclose(added[WIND], params["EKF2_WIND_NSD"] ** 2 * dt, rtol=1e-3)


def test_covariances_of_a_lost_position_do_not_grow(it):
    it.ekf["P"][POSITION, POSITION] = 10_001.0
    before = np.array(it.ekf["P"])
    asked(prediction.predict_covariance, it, it.params)
    assert np.array_equal(it.ekf["P"][POSITION : POSITION + 2], before[POSITION : POSITION + 2])


def test_an_update_takes_off_the_gain_s_square_times_the_innovation_s_variance(it):
    H = np.zeros(24)
    H[[0, Q3, VELOCITY, MAG_EARTH]] = 0.3, -0.2, 1.0, 0.5
    before, state = np.array(it.ekf["P"]), np.array(it.ekf["vel"])
    S = float(H @ before @ H) + 0.01
    K = before @ H / S
    observation_gain.compute_kalman_gain.py_func(it.ekf, H, S)
    it.ekf["scratch"]["K"][:3] = K[:3] = 0.0
    assert asked(measurement_update.measurement_update, it, it.params, 0.01, 0.4)
    expected = before - np.outer(K, K) * S
    # but for the limits: a hundredth of the largest of the accelerometer's, and none above (0.1 g dt)²
    free = [i for i in range(24) if not ACCEL_BIAS <= i < ACCEL_BIAS + 3]
    assert np.allclose(it.ekf["P"][np.ix_(free, free)], expected[np.ix_(free, free)], rtol=1e-9, atol=1e-15)
    assert np.allclose(it.ekf["vel"], state - K[VELOCITY : VELOCITY + 3] * 0.4)


def test_the_quaternion_is_corrected_by_addition(it):
    before = np.array(it.ekf["q"])
    H = np.zeros(24)
    H[0] = 1.0
    S = it.ekf["P"][0, 0] + 0.01
    K = it.ekf["P"][:, 0] / S
    observation_gain.compute_kalman_gain.py_func(it.ekf, H, S)
    asked(measurement_update.measurement_update, it, it.params, 0.01, 0.05)
    q = before - K[QUATERNION] * 0.05
    assert np.allclose(it.ekf["q"], q / np.linalg.norm(q))


def test_an_update_that_would_make_a_variance_negative_is_refused(it):
    H = np.zeros(24)
    H[VELOCITY] = 1.0
    observation_gain.compute_kalman_gain.py_func(it.ekf, H, it.ekf["P"][VELOCITY, VELOCITY] + 0.01)
    it.ekf["P"][WIND, WIND] = 1e-12
    before = np.array(it.ekf["vel"])
    assert not asked(measurement_update.measurement_update, it, it.params, 0.01, 1.0)
    assert not np.any(it.ekf["P"][WIND])
    assert np.array_equal(it.ekf["vel"], before)


def test_directly_observed_states_note_when_they_were_fused(it):
    for index, timer in ((VELOCITY, "time_last_hor_vel_fuse"), (POSITION + 2, "time_last_hgt_fuse")):
        it.ekf[timer] = 5
        variance = it.ekf["P"][index, index] + 0.1
        assert asked(measurement_update.fuse_direct_state, it, it.params, 0.1, variance, 0.1, index)
        assert it.ekf[timer] == it.ekf["time_delayed_us"]


def test_what_is_not_estimated_has_no_covariance(it):
    it.ekf["cs"]["mag_3d"] = it.ekf["cs"]["wind"] = False
    asked(prediction.predict_covariance, it, it.params)
    assert not np.any(it.ekf["P"][MAG_EARTH : WIND + 2])


def test_variances_of_the_accelerometer_bias_stay_near_each_other(it):
    P = it.ekf["P"]
    for axis, variance in enumerate((1e-3, 1e-6, 2e-7)):
        P[ACCEL_BIAS + axis, ACCEL_BIAS + axis] = variance
    it.ekf["accel_bias_inhibit"][2] = 1
    it.ekf["quaternion"]["kept_accel_bias_var"][2] = 2e-7
    asked(prediction.predict_covariance, it, it.params)
    kept = np.diag(P)[ACCEL_BIAS : ACCEL_BIAS + 3]
    # (0.1 g dt)², a hundredth of the largest, and an axis that is not learnt as it was
    assert np.allclose(kept, [(0.1 * G * 0.01) ** 2, 1e-5, 2e-7], rtol=1e-3)


def test_biases_are_increments_until_v1_14(it):
    it.ekf["gyro_bias"], it.ekf["accel_bias"] = (1e-3, 0.0, 0.0), (0.0, 2e-3, 0.0)
    assert np.allclose(asked(imu_rates.gyro_bias, it), [0.1, 0.0, 0.0])
    assert np.allclose(asked(imu_rates.accel_bias, it), [0.0, 0.2, 0.0])
    assert asked(imu_rates.bias_unit, it) == 0.01
    assert asked(imu_rates.bias_unit, flying(V115)) == 1.0
    covariance.reset_accel_bias.py_func(it.ekf, it.params)
    assert np.isclose(it.ekf["P"][ACCEL_BIAS, ACCEL_BIAS], (it.params["EKF2_ABIAS_INIT"] * 0.01) ** 2)
    assert it.ekf["quaternion"]["kept_accel_bias_var"][0] == it.ekf["P"][ACCEL_BIAS, ACCEL_BIAS]


def test_states_are_limited_once_per_prediction(it):
    it.ekf["gyro_bias"], it.ekf["mag_B"], it.ekf["wind_vel"] = 1.0, 2.0, 200.0
    it.ekf["dt_ekf_avg"] = 0.008
    asked(prediction._finish_prediction, it, it.params)
    assert np.allclose(it.ekf["gyro_bias"], it.params["EKF2_GYR_B_LIM"] * 0.01)
    assert np.all(it.ekf["mag_B"] == 0.5)
    assert np.all(it.ekf["wind_vel"] == 100.0)
    assert it.ekf["quaternion"]["mean_dt"] == 0.008


def test_a_variance_is_kept_while_a_bias_is_not_learnt(it):
    index = ACCEL_BIAS + 1
    it.ekf["P"][index, index] = 3e-6
    it.ekf["imu_delayed"]["delta_vel_clipping"][1] = True
    asked(bias_inhibition.update_imu_bias_inhibit, it, it.params)
    assert it.ekf["accel_bias_inhibit"].tolist() == [0, 1, 0]
    it.ekf["P"][index, index] = 0.0
    it.ekf["imu_delayed"]["delta_vel_clipping"][1] = False
    asked(bias_inhibition.update_imu_bias_inhibit, it, it.params)
    assert it.ekf["P"][index, index] == 3e-6


def rotation_vector(q: np.ndarray) -> np.ndarray:
    return 2.0 * math.acos(q[0]) / math.sqrt(1.0 - q[0] ** 2) * q[1:]


def test_the_covariance_of_the_quaternion_is_made_of_that_of_a_rotation_vector(it):
    quaternion_covariance.set_quaternion_covariance(it.ekf, 0.01)
    P, q = it.ekf["P"][np.ix_(QUATERNION, QUATERNION)], np.array(it.ekf["q"])
    J = by_quaternion(rotation_vector, q)
    assert np.allclose(J @ P @ J.T, np.eye(3) * 0.01, atol=1e-8)
    assert np.allclose(P @ q, 0.0, atol=1e-12)
    assert np.isclose(asked(covariance.tilt_variance, it), 0.02)


def test_attitude_variances_about_north_east_and_down(it):
    # what is uncertain by 0.01 rad² about every axis, is so about those of NED, too
    quaternion_covariance.set_quaternion_covariance(it.ekf, 1e-4)
    it.ekf["q"] = 1.0, 0.0, 0.0, 0.0
    P = it.ekf["P"]
    P[:4, :4] = 0.0
    P[1, 1], P[2, 2], P[Q3, Q3] = 1e-4, 4e-4, 9e-4
    assert np.allclose(
        [quaternion_covariance.attitude_variance_about(it.ekf, i) for i in range(3)], [4e-4, 16e-4, 36e-4]
    )


def test_a_reset_of_the_yaw_uncorrelates_the_attitude_and_adds_to_its_variance(it):
    level = flying(V114)
    level.ekf["P"] = np.full((24, 24), 1e-3)
    level.ekf["quaternion"]["mean_dt"] = 0.01
    for variance, added in ((0.004, 0.004), (0.5, 0.01)):
        level.ekf["P"][np.ix_(QUATERNION, QUATERNION)] = 0.0
        state_resets.reset_quat_state_yaw.py_func(level.ekf, level.params, 1.0, variance)
        assert np.isclose(asked(covariance.yaw_variance, level), added, rtol=1e-6)
        assert not np.any(level.ekf["P"][:3, 3:Q3])
        assert not np.any(level.ekf["P"][Q3, 3:Q3])
        assert np.isclose(math.atan2(level.ekf["R_to_earth"][1, 0], level.ekf["R_to_earth"][0, 0]), 1.0)


@pytest.mark.parametrize(("release", "heading"), [(V113, 0.0), (V114, 0.01)])
def test_the_start_adds_what_a_heading_is_uncertain_by(release, heading):
    it = flying(release, EKF2_MAG_TYPE=0.0, EKF2_HEAD_NOISE=0.3)
    it.ekf["quaternion"]["mean_dt"] = 0.01
    asked(covariance.initialise_covariance, it, it.params)
    tilt = it.params["EKF2_ANGERR_INIT"] ** 2
    assert np.isclose(asked(covariance.tilt_variance, it), 2.0 * tilt)
    assert np.isclose(asked(covariance.yaw_variance, it), tilt + heading)
    assert np.isclose(it.ekf["P"][GYRO_BIAS, GYRO_BIAS], (it.params["EKF2_GBIAS_INIT"] * 0.01) ** 2)
    assert np.isclose(it.ekf["mag_modes"]["saved_body_variance"][0], it.params["EKF2_MAG_NOISE"] ** 2)


def test_gravity_is_observed_as_an_acceleration(it):
    level = flying(V114, EKF2_IMU_CTRL=7.0)
    level.ekf["quaternion"]["mean_dt"] = 0.01
    level.ekf["P"] = np.eye(24) * 1e-4
    level.ekf["quaternion"]["mean_force"] = 0.0, 0.0, -G
    level.ekf["imu_delayed"]["delta_vel"] = 0.001, 0.0, -G * 0.01
    asked(gravity_fusion.control_gravity_fusion, level, level.params)
    aid = level.ekf["aid"]["gravity"]
    assert np.allclose(aid["observation"], [0.1, 0.0, -G])
    # h = g (R20, …) of squares: 2 g of the quaternion's elements, and along z with the norm
    assert np.allclose(aid["innovation"], [-0.1, 0.0, -G + G * G / math.hypot(G, 0.1)], atol=1e-4)
    expected = np.array([1e-4, 1e-4, 1e-4]) * (2.0 * G) ** 2 + level.params["EKF2_GRAV_NOISE"] ** 2
    assert np.allclose(aid["innovation_variance"], expected)
    assert aid["fused"]


def test_zero_rates_and_velocities_before_v1_15(it):
    it.ekf["cs"]["vehicle_at_rest"] = it.ekf["cs_prev"]["vehicle_at_rest"] = True
    it.ekf["zero_gyro"]["delta_ang_dt"], before = 0.3, np.array(it.ekf["gyro_bias"])
    asked(zero_gyro_update.control_zero_gyro_update, it, it.params)
    assert np.array_equal(it.ekf["gyro_bias"], before)
    it.ekf["cs"]["gnss_vel"], it.ekf["cs"]["tilt_align"] = True, False
    it.ekf["vel"] = 1.0, 0.0, 0.0
    zero_velocity_update.control_zero_velocity_update.py_func(it.ekf, it.params)
    assert it.ekf["vel"][0] == 1.0
    new = flying(V115)
    for name in ("cs", "cs_prev", "vel", "P"):
        new.ekf[name] = it.ekf[name]
    zero_velocity_update.control_zero_velocity_update.py_func(new.ekf, new.params)
    assert new.ekf["vel"][0] < 1.0


def test_buffers_are_as_long_as_the_sources_that_are_asked_for():
    values = {
        "EKF2_BARO_CTRL": 1.0, "EKF2_BARO_DELAY": 0.0, "EKF2_ARSP_THR": 0.0, "EKF2_ASP_DELAY": 100.0,
        "EKF2_MAG_TYPE": 0.0, "EKF2_MAG_DELAY": 0.0, "EKF2_RNG_CTRL": 0.0, "EKF2_RNG_DELAY": 5.0,
        "EKF2_GPS_CTRL": 7.0, "EKF2_GPS_DELAY": 110.0, "EKF2_OF_CTRL": 0.0, "EKF2_OF_DELAY": 20.0,
        "EKF2_EV_CTRL": 0.0, "EKF2_EV_DELAY": 175.0, "EKF2_AVEL_DELAY": 5.0, "EKF2_DELAY_MAX": 200.0,
        "SENS_BARO_RATE": 20.0, "SENS_MAG_RATE": 15.0,
    }  # fmt: skip
    assert longest_delay_ms(values.__getitem__, V115) == 200.0
    assert longest_delay_ms(values.__getitem__, V114) == 110.0
    # the estimator's own 10 ms; in v1.13 1000 ms / 15 Hz
    assert longest_delay_ms((values | {"EKF2_GPS_CTRL": 0.0}).__getitem__, V114) == 10.0
    by_mask = values | {"EKF2_AID_MASK": 24.0, "EKF2_HGT_MODE": 1.0, "EKF2_RNG_AID": 0.0}
    assert longest_delay_ms(by_mask.__getitem__, V113) == 175.0
    assert longest_delay_ms((by_mask | {"EKF2_AID_MASK": 0.0}).__getitem__, V113) == 67.0
