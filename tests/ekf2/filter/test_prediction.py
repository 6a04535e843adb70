"""Covariance prediction against F P Fᵀ + Q, with F by differentiating an independent state propagation."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import (
    hamilton_product,
    make_estimator,
    make_parameters,
    rotated_by_error,
    rotation_matrix,
    set_quaternion,
)

from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_BARO, HEIGHT_REF_RANGE
from fusetune.ekf2.filter.prediction import predict_covariance, predict_state
from fusetune.ekf2.numerics.constants import ONE_G

DT = 0.01
THETA, VEL, POS, B_GYRO, B_ACCEL = (slice(i, i + 3) for i in (0, 3, 6, 9, 12))


def propagate(q, vel, pos, gyro_bias, accel_bias, gyro, accel, dt):
    """Strapdown step with velocity and position by the attitude at the start, the discretisation of F."""
    increment = (gyro - gyro_bias) * dt
    half = np.linalg.norm(increment) / 2
    dq = np.concatenate([[np.cos(half)], np.sinc(half / np.pi) * increment / 2])
    force = rotation_matrix(q) @ (accel - accel_bias)
    return hamilton_product(q, dq), vel + (force + [0, 0, ONE_G]) * dt, pos + vel * dt


def attitude_error(q, reference):
    """Rotation vector e with q = dq(e) ⊗ reference, for small e."""
    error = hamilton_product(q, reference * [1, -1, -1, -1])
    return 2 * error[1:] * np.sign(error[0])


def numerical_transition(q, vel, gyro_bias, accel_bias, gyro, accel):
    """24 × 24 derivative of the propagated error state by the error state before."""
    pos = np.zeros(3)
    nominal = propagate(q, vel, pos, gyro_bias, accel_bias, gyro, accel, DT)
    F = np.eye(24)
    eps = 1e-6
    for column in range(15):
        columns = []
        for sign in (eps, -eps):
            d = np.zeros(15)
            d[column] = sign
            q_p, vel_p, pos_p = propagate(
                rotated_by_error(q, d[THETA]),
                vel + d[VEL],
                pos + d[POS],
                gyro_bias + d[B_GYRO],
                accel_bias + d[B_ACCEL],
                gyro,
                accel,
                DT,
            )
            columns.append(np.concatenate([attitude_error(q_p, nominal[0]), vel_p, pos_p]))
        F[:9, column] = (columns[0] - columns[1]) / (2 * eps)
    return F


def random_case(seed):
    """An estimator in a random state with a random covariance of realistic size, and its inertial sample."""
    rng = np.random.default_rng(seed)
    ekf = make_estimator()
    q = rng.normal(size=4)
    set_quaternion(ekf, q / np.linalg.norm(q))
    ekf["vel"][:] = rng.normal(0, 5, 3)
    ekf["gyro_bias"][:] = rng.normal(0, 0.02, 3)
    ekf["accel_bias"][:] = rng.normal(0, 0.1, 3)
    root = rng.normal(0, 0.05, (24, 24))
    ekf["P"][...] = root @ root.T + 1e-4 * np.eye(24)
    imu = ekf["imu_delayed"]
    imu["delta_ang"][:] = rng.normal(0, 1, 3) * DT
    imu["delta_vel"][:] = (rng.normal(0, 3, 3) - [0, 0, ONE_G]) * DT
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = DT
    ekf["height_sensor_ref"] = HEIGHT_REF_BARO
    return ekf


@pytest.mark.parametrize("seed", range(5))
def test_covariance_prediction_is_f_p_ft_plus_q(seed):
    ekf = random_case(seed)
    params = make_parameters(EKF2_MAG_NOISE=0.5, EKF2_WIND_NSD=0.05)
    before = ekf["P"].copy()
    R = ekf["R_to_earth"].copy()
    imu = ekf["imu_delayed"]
    F = numerical_transition(
        ekf["q"].copy(),
        ekf["vel"].copy(),
        ekf["gyro_bias"].copy(),
        ekf["accel_bias"].copy(),
        imu["delta_ang"] / DT,
        imu["delta_vel"] / DT,
    )
    # the gyro bias acts through the rotation of the whole step; F holds it at the start of the step
    F[THETA, B_GYRO] = -R * DT
    predict_covariance(ekf, params)

    Q = np.zeros((24, 24))
    Q[THETA, THETA] = np.eye(3) * params["EKF2_GYR_NOISE"] ** 2 * DT**2
    Q[VEL, VEL] = R @ R.T * params["EKF2_ACC_NOISE"] ** 2 * DT**2
    variances = np.diag(before)
    height_rate = ekf["vel"][2] * DT / (10 + DT)
    wind_density = params["EKF2_WIND_NSD"] * (1 + 0.5 * abs(height_rate))
    speed_squared = ekf["vel"][0] ** 2 + ekf["vel"][1] ** 2
    growth = {
        9: (params["EKF2_GYR_NOISE"] ** 2, (params["EKF2_GYR_B_NOISE"] * DT) ** 2),
        12: (params["EKF2_ACC_NOISE"] ** 2, (params["EKF2_ACC_B_NOISE"] * DT) ** 2),
        15: (params["EKF2_MAG_NOISE"] ** 2, (params["EKF2_MAG_E_NOISE"] * DT) ** 2),
        18: (params["EKF2_MAG_NOISE"] ** 2, (params["EKF2_MAG_B_NOISE"] * DT) ** 2),
        21: (1.0, wind_density**2 * DT),
    }
    for first, (limit, noise) in growth.items():
        for i in range(first, min(first + 3, 23)):
            Q[i, i] = noise if variances[i] < limit else 0.0
    Q[23, 23] = (DT * params["EKF2_TERR_NOISE"]) ** 2 + (DT * params["EKF2_TERR_GRAD"]) ** 2 * speed_squared
    np.testing.assert_allclose(ekf["P"], F @ before @ F.T + Q, rtol=1e-7, atol=1e-10)


def test_covariance_stays_exactly_symmetric():
    ekf = random_case(11)
    params = make_parameters()
    for _ in range(50):
        predict_covariance(ekf, params)
        predict_state(ekf, params)
    assert np.array_equal(ekf["P"], ekf["P"].T)
    assert np.linalg.eigvalsh(ekf["P"]).min() > 0


def test_clipping_raises_the_noise_of_its_axis_only():
    quiet, clipped = random_case(3), random_case(3)
    clipped["imu_delayed"]["delta_vel_clipping"][1] = True
    params = make_parameters()
    predict_covariance(quiet, params)
    predict_covariance(clipped, params)
    y = quiet["R_to_earth"][:, 1]
    extra = (4.9**2 - params["EKF2_ACC_NOISE"] ** 2) * DT**2 * np.outer(y, y)
    np.testing.assert_allclose((clipped["P"] - quiet["P"])[VEL, VEL], extra, rtol=1e-9, atol=1e-15)


def test_terrain_does_not_drift_where_it_is_the_height_reference():
    ekf = random_case(4)
    ekf["height_sensor_ref"] = HEIGHT_REF_RANGE
    before = ekf["P"][23, 23]
    predict_covariance(ekf, make_parameters())
    assert ekf["P"][23, 23] == before


def test_free_fall_follows_the_closed_form():
    """Without specific force: v = g t and z = g t² / 2 (trapezoidal rule is exact), on a non-rotating earth."""
    ekf = make_estimator()
    imu = ekf["imu_delayed"]
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = DT
    params = make_parameters()
    for _ in range(100):
        predict_state(ekf, params)
    assert ekf["vel"][2] == pytest.approx(ONE_G * 1.0, rel=1e-12)
    assert -ekf["gpos_alt"] == pytest.approx(ONE_G / 2, rel=1e-5)  # the altitude is kept in single precision


def test_rotation_about_one_axis_integrates_to_the_angle():
    ekf = make_estimator()
    imu = ekf["imu_delayed"]
    imu["delta_ang"][2] = 0.02
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = DT
    imu["delta_vel"][2] = -ONE_G * DT
    for _ in range(50):
        predict_state(ekf, make_parameters())
    np.testing.assert_allclose(ekf["q"], [np.cos(0.5), 0, 0, np.sin(0.5)], atol=1e-12)
    np.testing.assert_allclose(ekf["vel"], 0, atol=1e-12)


def test_earth_rate_and_coriolis_once_the_latitude_is_known():
    """A gyro that turns with the earth keeps the attitude; going north, Coriolis acceleration points east.

    Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, eq. 5.53.
    """
    latitude, speed, spin = 0.8, 20.0, 7.2921150e-5
    ekf = make_estimator()
    ekf["gpos_lat"] = latitude
    ekf["vel"][:] = [speed, 0, 0]
    imu = ekf["imu_delayed"]
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = DT
    imu["delta_vel"][2] = -ONE_G * DT
    imu["delta_ang"][:] = np.array([np.cos(latitude), 0, -np.sin(latitude)]) * spin * DT
    predict_state(ekf, make_parameters())
    np.testing.assert_allclose(ekf["q"], [1, 0, 0, 0], atol=1e-15)
    assert ekf["vel"][1] == pytest.approx(2 * spin * np.sin(latitude) * speed * DT, rel=1e-9)
