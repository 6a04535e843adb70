"""Zero velocity, zero gyro, fake position and height, and dead-reckoning status."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import at_time, make_estimator, make_parameters, set_attitude

from fusetune.ekf2.filter.aid_sources.fake_height_control import control_fake_hgt_fusion
from fusetune.ekf2.filter.aid_sources.fake_position.fake_pos_control import control_fake_pos_fusion
from fusetune.ekf2.filter.aid_sources.zero_gyro_update import control_zero_gyro_update
from fusetune.ekf2.filter.aid_sources.zero_innovation_heading_update import control_zero_innovation_heading_update
from fusetune.ekf2.filter.aid_sources.zero_velocity_update import control_zero_velocity_update
from fusetune.ekf2.filter.bias_inhibition import update_imu_bias_inhibit
from fusetune.ekf2.filter.common.dead_reckoning import update_dead_reckoning_status


def resting_estimator():
    ekf = make_estimator()
    ekf["output"]["size"] = 20
    ekf["cs"]["vehicle_at_rest"] = True
    ekf["cs_prev"]["vehicle_at_rest"] = True
    return ekf


def test_zero_velocity_is_fused_five_times_a_second():
    ekf, params = resting_estimator(), make_parameters()
    ekf["vel"][:] = [0.5, -0.5, 0.2]
    control_zero_velocity_update(ekf, params)
    np.testing.assert_allclose(ekf["vel"], 0, atol=1e-5)
    ekf["vel"][0] = 1.0
    at_time(ekf, 100.2)
    control_zero_velocity_update(ekf, params)
    assert ekf["vel"][0] == 1.0
    at_time(ekf, 100.201)
    control_zero_velocity_update(ekf, params)
    # the variance is that of the first observation, so the second has the same weight
    assert ekf["vel"][0] == pytest.approx(0.5, rel=1e-5)


def test_zero_velocity_leaves_vertical_velocity_aiding_alone():
    ekf, params = resting_estimator(), make_parameters()
    ekf["vel"][:] = 1.0
    ekf["cs"]["tilt_align"] = True
    ekf["cs"]["gnss_vel"] = True
    control_zero_velocity_update(ekf, params)
    np.testing.assert_array_equal(ekf["vel"], 1.0)


def test_gyro_at_rest_measures_its_bias():
    """Kalman gain of a scalar: P / (P + R) with P = 1."""
    ekf, params = resting_estimator(), make_parameters()
    imu = ekf["imu_delayed"]
    imu["delta_ang_dt"] = 0.01
    imu["delta_ang"][:] = np.array([0.01, -0.02, 0.03]) * 0.01
    for _ in range(19):
        control_zero_gyro_update(ekf, params)
    assert not ekf["gyro_bias"].any()
    control_zero_gyro_update(ekf, params)
    control_zero_gyro_update(ekf, params)
    gain = 1 / (1 + params["EKF2_GYR_NOISE"] ** 2)
    np.testing.assert_allclose(ekf["gyro_bias"], np.array([0.01, -0.02, 0.03]) * gain, rtol=1e-6)


def test_motion_discards_the_mean_gyro():
    ekf, params = resting_estimator(), make_parameters()
    ekf["imu_delayed"]["delta_ang_dt"] = 0.01
    control_zero_gyro_update(ekf, params)
    ekf["cs"]["vehicle_at_rest"] = False
    control_zero_gyro_update(ekf, params)
    assert ekf["zero_gyro"]["delta_ang_dt"] == 0.0


def test_position_is_held_at_rest():
    ekf, params = resting_estimator(), make_parameters()
    ekf["vel"][:2] = 2.0
    control_fake_pos_fusion(ekf, params)
    assert ekf["cs"]["valid_fake_pos"]
    assert not ekf["cs"]["fake_pos"]
    assert not ekf["vel"][:2].any()
    assert ekf["events"]["reset_vel_to_zero"]
    assert ekf["events"]["reset_pos_to_last_known"]
    at_time(ekf, 100.3)
    ekf["gpos_lat"] += 1e-8
    control_fake_pos_fusion(ekf, params)
    assert ekf["aid"]["fake_pos"]["fused"]
    assert ekf["aid"]["fake_pos"]["observation_variance"][0] == pytest.approx(1e-4)
    assert ekf["gpos_lat"] < 1e-10


def test_position_is_held_in_the_air_only_while_the_tilt_is_uncertain():
    ekf, params = resting_estimator(), make_parameters(EKF2_IMU_CTRL=3)
    ekf["cs"]["vehicle_at_rest"] = False
    ekf["P"][...] = np.eye(24) * 1e-4
    control_fake_pos_fusion(ekf, params)
    assert not ekf["cs"]["fake_pos"]
    at_time(ekf, 101.0)
    ekf["P"][0, 0] = 0.01
    control_fake_pos_fusion(ekf, params)
    assert ekf["cs"]["fake_pos"]
    ekf["cs"]["gnss_pos"] = True
    control_fake_pos_fusion(ekf, params)
    assert not ekf["cs"]["fake_pos"]


def test_height_is_held_until_a_source_is_fused():
    ekf, params = resting_estimator(), make_parameters()
    control_fake_hgt_fusion(ekf, params)
    assert ekf["cs"]["fake_hgt"]
    at_time(ekf, 100.3)
    ekf["gpos_alt"] = 5.0
    control_fake_hgt_fusion(ekf, params)
    assert ekf["aid"]["fake_hgt"]["fused"]
    assert ekf["gpos_alt"] < 5.0
    ekf["cs"]["baro_hgt"] = True
    control_fake_hgt_fusion(ekf, params)
    assert not ekf["cs"]["fake_hgt"]


def test_heading_variance_is_bounded_without_heading():
    ekf, params = resting_estimator(), make_parameters()
    ekf["cs"]["tilt_align"] = True
    ekf["P"][2, 2] = 0.9 * params["EKF2_HEAD_NOISE"] ** 2
    control_zero_innovation_heading_update(ekf, params)
    assert ekf["time_last_heading_fuse"] == 0
    ekf["P"][2, 2] = 1.0
    control_zero_innovation_heading_update(ekf, params)
    assert ekf["P"][2, 2] == pytest.approx(1 * 0.25 / 1.25)
    assert ekf["time_last_heading_fuse"] == 100_000_000


def test_dead_reckoning_is_declared_after_the_timeout():
    ekf, params = make_estimator(), make_parameters()
    ekf["cs"]["gnss_vel"] = True
    ekf["time_last_hor_vel_fuse"] = 100_000_000
    update_dead_reckoning_status(ekf, params)
    assert not ekf["cs"]["inertial_dead_reckoning"]
    assert not ekf["horizontal_deadreckon_time_exceeded"]
    at_time(ekf, 101.1)
    update_dead_reckoning_status(ekf, params)
    assert ekf["cs"]["inertial_dead_reckoning"]
    assert not ekf["horizontal_deadreckon_time_exceeded"]
    # last aiding counts as one second before the last update that had any
    at_time(ekf, 99.0 + params["EKF2_NOAID_TOUT"] * 1e-6 + 0.01)
    update_dead_reckoning_status(ekf, params)
    assert ekf["horizontal_deadreckon_time_exceeded"]


def test_air_data_alone_is_wind_dead_reckoning():
    ekf, params = make_estimator(), make_parameters()
    ekf["cs"]["fuse_aspd"] = ekf["cs"]["fuse_beta"] = True
    ekf["aid"]["airspeed"]["time_last_fuse"] = ekf["aid"]["sideslip"]["time_last_fuse"] = 100_000_000
    update_dead_reckoning_status(ekf, params)
    assert ekf["cs"]["wind_dead_reckoning"]
    assert not ekf["cs"]["inertial_dead_reckoning"]


@pytest.mark.parametrize(
    ("acceleration", "expected"), [(9.8, False), (30.0, True)], ids=["calm", "beyond EKF2_ABL_ACCLIM"]
)
def test_accel_bias_learning_stops_while_manoeuvring(acceleration, expected):
    ekf, params = make_estimator(), make_parameters()
    imu = ekf["imu_delayed"]
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = 0.01
    imu["delta_vel"][2] = -acceleration * 0.01
    update_imu_bias_inhibit(ekf, params)
    assert list(ekf["accel_bias_inhibit"]) == [expected] * 3
    assert not ekf["gyro_bias_inhibit"].any()


def test_unaided_accel_bias_is_learnt_along_gravity_only():
    ekf, params = make_estimator(), make_parameters()
    imu = ekf["imu_delayed"]
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = 0.01
    ekf["cs"]["fake_pos"] = True
    set_attitude(ekf, 0.1, 0.1, 1.0)
    update_imu_bias_inhibit(ekf, params)
    assert list(ekf["accel_bias_inhibit"]) == [True, True, False]
