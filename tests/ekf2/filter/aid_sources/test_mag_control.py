"""Start, modes, heading, resets and end of magnetometer fusion, step by step."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import (
    at_time,
    is_running_after,
    make_estimator,
    make_parameters,
    put_sample,
    set_attitude,
)

from fusetune.ekf2.filter.aid_sources.magnetometer.mag_control import control_mag_fusion
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import fuse_mag
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import check_mag_heading_consistency, reset_mag_heading
from fusetune.ekf2.filter.world_field import (
    check_world_magnetic_model,
    earth_field_vector,
    get_mag_declination,
    synthetic_mag_z,
)

FIELD = np.array([0.22, 0.03, 0.40])
AUTO, HEADING, NONE, INIT = 0, 1, 5, 6


def _levelled(time_s: float = 100.0) -> np.void:
    ekf = make_estimator(time_s)
    ekf["cs"]["tilt_align"] = True
    ekf["P"][...] = np.eye(24) * 1e-2
    return ekf


def _feed(ekf: np.void, params: np.void, body_field: np.ndarray, samples: int = 1, reset: bool = False) -> None:
    """Advance by 20 ms and one sample, `samples` times."""
    for _ in range(samples):
        at_time(ekf, ekf["time_delayed_us"] * 1e-6 + 0.02)
        ekf["cs_prev"] = ekf["cs"].copy()
        ekf["state_reset_prev"]["quat_counter"] = ekf["state_reset"]["quat_counter"]
        put_sample(ekf, "mag", 5_000, mag=body_field, reset=reset)
        control_mag_fusion(ekf, params)


def test_low_pass_follows_its_closed_form():
    ekf, params = make_estimator(), make_parameters()
    _feed(ekf, params, np.zeros(3))
    _feed(ekf, params, FIELD, samples=7)
    np.testing.assert_allclose(ekf["mag"]["lpf"], FIELD * (1 - 0.9**7), rtol=1e-12)
    _feed(ekf, params, 2 * FIELD, reset=True)
    np.testing.assert_array_equal(ekf["mag"]["lpf"], 2 * FIELD)
    assert ekf["mag"]["counter"] == 1


def test_starts_with_the_fourth_sample_when_nothing_is_checked():
    ekf, params = _levelled(), make_parameters(EKF2_MAG_CHECK=0)
    started = []
    for _ in range(5):
        _feed(ekf, params, FIELD)
        started.append(bool(ekf["cs"]["mag"]))
    assert started == [False, False, False, True, True]
    assert ekf["cs"]["yaw_align"]
    assert ekf["cs"]["mag_hdg"]  # one sample after the start
    assert ekf["cs"]["mag_dec"]  # no north reference


def test_yaw_alignment_turns_the_field_to_magnetic_north():
    yaw, declination = np.radians(130.0), np.radians(8.0)
    ekf, params = _levelled(), make_parameters(EKF2_MAG_CHECK=0, EKF2_DECL_TYPE=2, EKF2_MAG_DECL=8.0)
    set_attitude(ekf, 0.1, -0.2, yaw)
    north = np.array([0.3 * np.cos(declination), 0.3 * np.sin(declination), 0.35])
    body_field = ekf["R_to_earth"].T @ north
    set_attitude(ekf, 0.1, -0.2, -1.0)
    _feed(ekf, params, body_field, samples=4)
    R = ekf["R_to_earth"]
    assert np.arctan2(R[1, 0], R[0, 0]) == pytest.approx(yaw, abs=1e-6)
    np.testing.assert_allclose(ekf["mag_I"], north, atol=1e-6)
    assert ekf["state_reset"]["quat_counter"] == 1
    assert ekf["P"][2, 2] == pytest.approx(params["EKF2_HEAD_NOISE"] ** 2)
    assert ekf["aid"]["mag"]["fused"]
    np.testing.assert_array_equal(ekf["aid"]["mag"]["innovation"], 0.0)


def test_first_field_variances_give_the_innovation_variance_of_px4():
    """PX4's replays show 0.0075 Gauss² at the first sample: noise, earth and body field, 0.05² each."""
    ekf, params = make_estimator(), make_parameters(EKF2_MAG_NOISE=0.05)
    ekf["P"][...] = 0.0
    for i in range(15, 18):
        ekf["P"][i, i] = 0.05**2
    _feed(ekf, params, FIELD)
    np.testing.assert_allclose(ekf["aid"]["mag"]["innovation_variance"], 0.0075, rtol=1e-6)
    np.testing.assert_allclose(ekf["aid"]["mag"]["innovation"], -FIELD)
    assert ekf["aid"]["mag"]["innovation_rejected"]


@pytest.mark.parametrize(
    ("mag_type", "aligned_in_flight", "heading", "three_d"),
    [
        (AUTO, False, True, False),
        (AUTO, True, False, True),
        (HEADING, True, True, False),
        (INIT, False, False, False),
    ],
)
def test_mode_by_type(mag_type, aligned_in_flight, heading, three_d):
    ekf, params = _levelled(), make_parameters(EKF2_MAG_CHECK=0, EKF2_MAG_TYPE=mag_type)
    _feed(ekf, params, FIELD, samples=4)
    ekf["cs"]["mag_aligned_in_flight"] = aligned_in_flight
    _feed(ekf, params, FIELD)
    assert ekf["cs"]["mag"]
    assert ekf["cs"]["mag_hdg"] == heading
    assert ekf["cs"]["mag_3d"] == three_d


def test_type_none_stops():
    ekf, params = _levelled(), make_parameters(EKF2_MAG_CHECK=0)
    _feed(ekf, params, FIELD, samples=5)
    _feed(ekf, make_parameters(EKF2_MAG_TYPE=NONE), FIELD)
    for flag in ("mag", "mag_hdg", "mag_dec", "yaw_align"):
        assert not ekf["cs"][flag]


def test_stops_after_a_second_without_data():
    ekf, params = _levelled(), make_parameters(EKF2_MAG_CHECK=0)
    _feed(ekf, params, FIELD, samples=5)
    assert is_running_after(ekf, params, 0.9, "mag", control_mag_fusion, "mag")
    assert not is_running_after(ekf, params, 1.1, "mag", control_mag_fusion, "mag")


def test_climbing_clear_of_the_ground_realigns_once():
    ekf, params = _levelled(), make_parameters(EKF2_MAG_CHECK=0)
    _feed(ekf, params, FIELD, samples=5)
    ekf["cs"]["in_air"] = True
    ekf["last_on_ground_pos_d"] = 0.0
    for altitude, aligned in ((1.0, False), (1.4, False), (1.6, True)):
        ekf["gpos_alt"] = altitude
        _feed(ekf, params, FIELD)
        assert ekf["cs"]["mag_aligned_in_flight"] == aligned
    assert ekf["mag"]["flt_mag_align_start_time"] == ekf["time_delayed_us"]
    _feed(ekf, params, FIELD)
    assert ekf["cs"]["mag_3d"]


def test_heading_fusion_leaves_tilt_alone():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(24, 24)) * 0.05
    for update_tilt in (False, True):
        ekf, params = _levelled(), make_parameters()
        set_attitude(ekf, 0.2, -0.1, 0.5)
        ekf["P"][...] = root @ root.T + 1e-3 * np.eye(24)
        ekf["cs"]["mag"] = True
        ekf["mag_I"][:] = FIELD
        measured = ekf["R_to_earth"].T @ FIELD + np.array([0.02, -0.01, 0.015])
        _prepare_first_axis(ekf, measured)
        before, variances = ekf["q"].copy(), np.diag(ekf["P"]).copy()
        assert fuse_mag(ekf, params, measured, 0.0025, True, update_tilt)
        change = _small_rotation(before, ekf["q"])
        assert (np.abs(change[:2]) > 1e-6).all() == update_tilt
        assert abs(change[2]) > 1e-6
        assert (np.diag(ekf["P"])[15:21] < variances[15:21]).all()


def test_field_only_fusion_moves_nothing_but_the_field():
    ekf, params = _levelled(), make_parameters()
    root = np.random.default_rng(5).normal(size=(24, 24)) * 0.05
    ekf["P"][...] = root @ root.T + 1e-3 * np.eye(24)
    ekf["cs"]["mag"] = True
    ekf["mag_I"][:] = FIELD
    measured = FIELD + 0.02
    _prepare_first_axis(ekf, measured)
    q, vel, gyro_bias = ekf["q"].copy(), ekf["vel"].copy(), ekf["gyro_bias"].copy()
    assert fuse_mag(ekf, params, measured, 0.0025, False, False)
    np.testing.assert_array_equal(ekf["q"], q)
    np.testing.assert_array_equal(ekf["vel"], vel)
    np.testing.assert_array_equal(ekf["gyro_bias"], gyro_bias)
    assert np.linalg.norm(ekf["mag_I"] + ekf["mag_B"] - measured) < np.linalg.norm(FIELD - measured)


def test_three_axis_fusion_equals_the_joint_update():
    """Sequential scalar updates of a linear model equal one vector update (Kalman filter with diagonal noise)."""
    ekf, params = _levelled(), make_parameters()
    root = np.random.default_rng(11).normal(size=(24, 24)) * 0.02
    P = root @ root.T + 1e-4 * np.eye(24)
    P[:15, 15:] = P[15:, :15] = 0.0  # field states alone see the measurement, which makes the model linear
    P[15:21, 21:] = P[21:, 15:21] = 0.0
    P[:3, :] = P[:, :3] = 0.0
    ekf["P"][...] = P
    ekf["cs"]["mag"] = True
    ekf["mag_I"][:] = FIELD
    R = 0.0025
    H = np.zeros((3, 24))
    H[:, 15:18] = H[:, 18:21] = np.eye(3)
    measured = FIELD + np.array([0.01, -0.02, 0.03])
    _prepare_first_axis(ekf, measured)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R * np.eye(3))
    expected_field = (K @ (measured - FIELD))[15:21] + np.concatenate([FIELD, np.zeros(3)])
    fuse_mag(ekf, params, measured, R, True, True)
    np.testing.assert_allclose(np.concatenate([ekf["mag_I"], ekf["mag_B"]]), expected_field, atol=1e-8)
    np.testing.assert_allclose(ekf["P"][15:21, 15:21], (P - K @ H @ P)[15:21, 15:21], atol=1e-9)


def test_heading_innovation_filter_and_consistency():
    ekf, params = _levelled(), make_parameters(EKF2_HEAD_NOISE=0.3, EKF2_MAG_ACCLIM=0.5)
    ekf["cs"]["yaw_align"] = True
    ekf["P"][18:21, 18:21] = np.eye(3)  # body field unknown, so it is not used
    offset = 0.2
    set_attitude(ekf, 0.1, 0.2, 1.0 + offset)
    true_field = np.array([0.3, 0.0, 0.4])
    set_attitude(ekf, 0.1, 0.2, 1.0)
    body_field = ekf["R_to_earth"].T @ true_field
    set_attitude(ekf, 0.1, 0.2, 1.0 + offset)
    for n in range(1, 6):
        check_mag_heading_consistency(ekf, params, body_field)
        assert ekf["mag"]["heading_innovation_lpf"] == pytest.approx(offset * (1 - 0.9**n), abs=1e-9)
    assert not ekf["cs"]["mag_heading_consistent"]  # neither north reference nor acceleration
    ekf["cs"]["gnss_vel"] = True
    ekf["accel_horiz_lpf"][:] = (0.3, 0.3)
    check_mag_heading_consistency(ekf, params, body_field)
    assert not ekf["cs"]["mag_heading_consistent"]  # 0.42 m/s² is too little
    ekf["accel_horiz_lpf"][:] = (0.4, 0.4)
    check_mag_heading_consistency(ekf, params, body_field)
    assert ekf["cs"]["mag_heading_consistent"]
    ekf["mag"]["heading_innovation_lpf"] = 0.4
    check_mag_heading_consistency(ekf, params, body_field)
    assert not ekf["cs"]["mag_heading_consistent"]


def test_heading_reset_uses_a_known_body_field():
    yaw = -2.0
    for variance, uses_bias in ((1e-4, True), (1.0, False)):
        ekf, params = _levelled(), make_parameters(EKF2_MAG_NOISE=0.05)
        ekf["P"][18:21, 18:21] = np.eye(3) * variance
        ekf["mag_B"][:] = (0.05, -0.03, 0.02)
        set_attitude(ekf, -0.1, 0.15, yaw)
        body_field = ekf["R_to_earth"].T @ np.array([0.25, 0.0, 0.4]) + ekf["mag_B"]
        set_attitude(ekf, -0.1, 0.15, 0.0)
        reset_mag_heading(ekf, params, body_field)
        R = ekf["R_to_earth"]
        error = np.arctan2(R[1, 0], R[0, 0]) - yaw
        assert (abs(error) < 1e-9) == uses_bias


def test_declination_source_by_parameter():
    ekf = make_estimator()
    ekf["mag"]["wmm_declination"] = 0.1
    assert get_mag_declination(ekf, make_parameters(EKF2_DECL_TYPE=3, EKF2_MAG_DECL=10.0)) == 0.1
    saved = make_parameters(EKF2_DECL_TYPE=2, EKF2_MAG_DECL=10.0)
    assert get_mag_declination(ekf, saved) == pytest.approx(np.radians(10.0))
    assert get_mag_declination(ekf, make_parameters(EKF2_DECL_TYPE=0, EKF2_MAG_DECL=10.0)) == 0.0
    assert get_mag_declination(ekf, make_parameters(EKF2_DECL_TYPE=2, EKF2_MAG_DECL=0.0)) == 0.0
    ekf["cs"]["mag_aligned_in_flight"] = True
    ekf["mag_I"][:] = (0.2, -0.1, 0.4)
    assert get_mag_declination(ekf, saved) == pytest.approx(np.arctan2(-0.1, 0.2))


def test_earth_field_points_down_and_east_of_north():
    field = np.empty(3)
    earth_field_vector(np.radians(30.0), np.radians(60.0), 0.5, field)
    np.testing.assert_allclose(field, [0.25 * np.cos(np.pi / 6), 0.125, 0.5 * np.sin(np.pi / 3)], atol=1e-15)


def test_synthetic_z_completes_the_strength():
    ekf = make_estimator()
    ekf["mag"]["wmm_earth_field"][:] = (0.3, 0.0, 0.4)
    assert synthetic_mag_z(ekf, 0.3, 0.0) == pytest.approx(0.4)
    assert synthetic_mag_z(ekf, 0.6, 0.0) == 0.0
    set_attitude(ekf, np.pi, 0.0, 0.0)
    assert synthetic_mag_z(ekf, 0.3, 0.0) == pytest.approx(-0.4)


def test_model_is_looked_up_when_the_origin_is_new_and_every_ten_seconds():
    ekf = make_estimator()
    assert not check_world_magnetic_model(ekf)
    ekf["gpos_lat"], ekf["gpos_lon"] = np.radians(47.0), np.radians(8.0)
    ekf["origin"]["lat_lon_valid"] = True
    ekf["origin"]["timestamp"] = ekf["time_delayed_us"]
    assert check_world_magnetic_model(ekf)
    # Zurich: 3° E, 63° down, 0.48 Gauss within the model's coarse grid
    assert np.degrees(ekf["mag"]["wmm_declination"]) == pytest.approx(3.2, abs=0.8)
    assert np.degrees(ekf["mag"]["wmm_inclination"]) == pytest.approx(63.3, abs=1.0)
    assert ekf["mag"]["wmm_strength"] == pytest.approx(0.482, abs=0.01)
    assert not check_world_magnetic_model(ekf)  # same place, nothing new
    ekf["aid"]["mag"]["time_last_fuse"] = ekf["time_delayed_us"] + 1
    ekf["horizontal_deadreckon_time_exceeded"] = False
    ekf["gpos_lon"] = np.radians(30.0)
    at_time(ekf, 105.0)
    assert not check_world_magnetic_model(ekf)
    at_time(ekf, 110.1)
    assert check_world_magnetic_model(ekf)


def _prepare_first_axis(ekf: np.void, measured: np.ndarray) -> None:
    """What the control does before it fuses: innovations, and the first axis's variance."""
    aid = ekf["aid"]["mag"]
    aid["innovation_rejected"] = False
    aid["observation_variance"][:] = 0.0025
    predicted = ekf["R_to_earth"].T @ ekf["mag_I"] + ekf["mag_B"]
    aid["innovation"][:] = predicted - measured
    H = np.zeros(24)
    R = ekf["R_to_earth"]
    H[:3] = np.cross(R[:, 0], ekf["mag_I"])
    H[15:18] = R[:, 0]
    H[18] = 1.0
    aid["innovation_variance"][0] = H @ ekf["P"] @ H + 0.0025


def _small_rotation(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """NED rotation vector from one quaternion to another close by."""
    conjugate = before * np.array([1, -1, -1, -1])
    w = after[0] * conjugate[0] - after[1:] @ conjugate[1:]
    v = after[0] * conjugate[1:] + conjugate[0] * after[1:] + np.cross(after[1:], conjugate[1:])
    return 2 * v * np.sign(w)
