"""What the core of older releases does otherwise than v1.16's: state, covariance, biases, start and buffers.

Expected: the formulas of docs/releases.md, worked out here.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import CONSTANTS_ONE_G, set_time
from tests.ekf2.releases.test_named_behaviours import Flying, asked, flying

from fusetune.ekf2.filter import (
    accel_bias_check,
    bias_inhibition,
    control,
    height_control,
    measurement_update,
    prediction,
)
from fusetune.ekf2.filter.aid_sources.gravity import gravity_fusion
from fusetune.ekf2.filter.common import earth_rate, global_position, local_origin
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, GYRO_BIAS, MAG_EARTH, POSITION, TERRAIN, VELOCITY, WIND
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.resets import state_resets

NEW, V115 = "v1.16", "v1.15"
DT = 0.01
RADIUS = 6_371_000.0


@pytest.fixture(params=[NEW, V115])
def it(request: pytest.FixtureRequest) -> Flying:
    return flying(request.param)


def is_old(it: Flying) -> bool:
    return "local" in it.ekf.dtype.names


def test_positions_are_metres_of_the_origin_until_v1_15(it):
    asked(global_position.add_to_position, it, 100.0, 200.0, 3.0)
    assert it.ekf["gpos_alt"] == 7.0
    north, east = asked(local_origin.get_local_horizontal_position, it)
    if is_old(it):
        assert (north, east) == (100.0, 200.0)
        lat, lon = asked(local_origin.get_global_horizontal_position, it)
        assert math.isclose(lat, 100.0 / RADIUS, rel_tol=1e-6)
        assert math.isclose(lon, 200.0 / RADIUS, rel_tol=1e-6)
    else:
        # radii of curvature of the ellipsoid at the equator: a(1 − e²) and a
        assert math.isclose(it.ekf["gpos_lat"], 100.0 / (6_378_137.0 * (1 - 0.0818191908425**2) + 10.0), rel_tol=1e-9)
        assert math.isclose(it.ekf["gpos_lon"], 200.0 / (6_378_137.0 + 10.0), rel_tol=1e-9)


def test_local_positions_have_the_resolution_of_single_precision():
    it = flying(V115)
    it.ekf["local"]["north"] = 1000.0
    # numbers of single precision from 512 to 1024 are 2⁻¹⁴ apart
    asked(global_position.add_to_position, it, 2.0**-16, 0.0, 0.0)
    assert it.ekf["local"]["north"] == 1000.0
    asked(global_position.add_to_position, it, 2.0**-14, 0.0, 0.0)
    assert it.ekf["local"]["north"] == 1000.0 + 2.0**-14


def test_the_last_known_place_is_one_of_the_local_frame_until_v1_15():
    it = flying(V115)
    asked(local_origin.remember_horizontal_position, it)
    asked(global_position.add_to_position, it, 30.0, -40.0, 0.0)
    assert asked(local_origin.offset_from_last_known, it) == (30.0, -40.0)
    asked(state_resets._reset_to_last_known, it, it.params, 4.0)
    assert asked(local_origin.get_local_horizontal_position, it) == (0.0, 0.0)
    assert it.ekf["P"][POSITION, POSITION] == 4.0
    assert it.ekf["state_reset"]["pos_ne_change"].tolist() == [-30.0, 40.0]


def test_no_curvature_turns_a_velocity_until_v1_15(it):
    it.ekf["vel"] = 100.0, 0.0, 0.0
    asked(prediction._integrate_velocity, it, it.params)
    # v1.16 has the transport rate: a velocity along the sphere turns upwards by v²/(r + h) seen from its plane
    radius = 6_378_137.0 * (1 - 0.0818191908425**2) + 10.0
    turned = 0.0 if is_old(it) else -(100.0**2) / radius * DT
    assert math.isclose(it.ekf["vel"][2], turned, rel_tol=1e-6, abs_tol=1e-15)
    assert it.ekf["vel"][0] == 100.0


def test_the_earth_rate_is_left_to_the_magnetic_model_until_v1_15(it):
    it.ekf["gpos_lat"] = 0.5
    asked(earth_rate.update_earth_rate, it)
    expected = 0.0 if is_old(it) else 7.292115e-5 * math.cos(0.5)
    assert math.isclose(it.ekf["earth_rate_ned"][0], expected)
    earth_rate.set_earth_rate(it.ekf, 0.5)
    assert math.isclose(it.ekf["earth_rate_ned"][2], -7.292115e-5 * math.sin(0.5))


def test_motion_is_filtered_plainly_until_v1_15(it):
    it.ekf["height_rate_lpf"], it.ekf["vel"] = 2.0, (0.0, 0.0, 1.0)
    it.ekf["accel_horiz_lpf"] = 5.0, 0.0
    asked(prediction._filter_motion, it, 0.03, 0.0, DT)
    if is_old(it):
        assert math.isclose(it.ekf["height_rate_lpf"], 2.0 * (1.0 - 0.1 * DT) + 1.0 * 0.1 * DT)
        assert math.isclose(it.ekf["accel_horiz_lpf"][0], 5.0 * (1.0 - DT) + 0.03)
    else:
        assert it.ekf["height_rate_lpf"] == 2.0
        assert math.isclose(it.ekf["accel_horiz_lpf"][0], 5.0 + DT / (1.0 + DT) * (3.0 - 5.0))


def test_noise_is_added_to_what_is_estimated_in_v1_15(it):
    P = it.ekf["P"]
    P[GYRO_BIAS, GYRO_BIAS] = P[MAG_EARTH, MAG_EARTH] = P[WIND, WIND] = P[ACCEL_BIAS, ACCEL_BIAS] = 1.5
    it.ekf["gyro_bias_inhibit"][1] = 1
    before = np.diag(P).copy()
    asked(prediction._add_noise_of_others, it, it.params, DT, 1e-4, 0.1, 0.1, 0.1)
    added = np.diag(P) - before
    # v1.16 adds none above the limits, which are the noises of gyro and accelerometer, of the field, and 1
    gyro, accel = (DT * it.params["EKF2_GYR_B_NOISE"]) ** 2, (DT * it.params["EKF2_ACC_B_NOISE"]) ** 2
    assert np.isclose(added[GYRO_BIAS], gyro if is_old(it) else 0.0, rtol=1e-3)
    assert np.isclose(added[ACCEL_BIAS], accel if is_old(it) else 0.0, rtol=1e-3)
    assert added[GYRO_BIAS + 1] == 0.0
    assert added[MAG_EARTH] == 0.0
    assert added[WIND] == 0.0
    it.ekf["cs"]["mag"] = it.ekf["cs"]["wind"] = True
    it.ekf["height_rate_lpf"] = 4.0
    before = np.diag(P).copy()
    asked(prediction._add_noise_of_others, it, it.params, DT, 1e-4, 0.1, 0.1, 0.1)
    added = np.diag(P) - before
    if is_old(it):
        assert np.isclose(added[MAG_EARTH], (DT * it.params["EKF2_MAG_E_NOISE"]) ** 2, rtol=1e-3)
        assert np.isclose(added[WIND], (it.params["EKF2_WIND_NSD"] * 3.0) ** 2 * DT)
    else:
        assert added[WIND] == 0.0


def test_variances_are_clipped_in_v1_15(it):
    P = it.ekf["P"]
    P[VELOCITY, VELOCITY], P[VELOCITY, POSITION], P[POSITION, VELOCITY] = 1.2e6, 50.0, 50.0
    P[GYRO_BIAS, GYRO_BIAS], P[GYRO_BIAS + 1, GYRO_BIAS + 1] = 2.0, 1e-8
    asked(measurement_update.constrain_state_variances, it)
    if is_old(it):
        assert P[VELOCITY, VELOCITY] == 1e6
        assert P[VELOCITY, POSITION] == 50.0
        # the largest of a group is at most 10⁶ times its least
        assert P[GYRO_BIAS, GYRO_BIAS] == 1.0
        assert P[GYRO_BIAS + 1, GYRO_BIAS + 1] == 1e-6
    else:
        # P (1 − 1/11)ᵏ until below the limit, correlations with it
        assert math.isclose(P[VELOCITY, VELOCITY], 1.2e6 * (10 / 11) ** 2)
        assert P[VELOCITY, POSITION] < 50.0


def test_manoeuvres_are_judged_with_the_biases_until_v1_15(it):
    it.ekf["accel_bias"] = 0.0, 0.0, -0.4
    it.ekf["accel_magnitude_filt"] = 0.0
    asked(bias_inhibition.update_imu_bias_inhibit, it, it.params)
    expected = CONSTANTS_ONE_G if is_old(it) else CONSTANTS_ONE_G - 0.4
    assert math.isclose(it.ekf["accel_magnitude_filt"], expected)


def stuck(it: Flying) -> None:
    """The bias says down, height and vertical velocity say up."""
    it.ekf["accel_bias"] = 0.0, 0.0, 0.95 * it.params["EKF2_ABL_LIM"]
    it.ekf["cs"]["gnss_vel"] = it.ekf["cs"]["baro_hgt"] = True
    it.ekf["aid"]["gnss_vel"]["innovation"][2] = -1.0
    it.ekf["aid"]["baro_hgt"]["innovation"][0] = -1.0


def test_a_bias_that_is_contradicted_for_7_s_starts_anew_in_v1_15(it):
    stuck(it)
    start, initial = int(it.ekf["time_delayed_us"]), it.params["EKF2_ABIAS_INIT"] ** 2
    if is_old(it):
        it.ekf["accel_bias_check"]["time_last_passed"] = start
    for seconds, reset in ((7.0, False), (7.1, True)):
        set_time(it.ekf, start + round(seconds * 1e6))
        asked(accel_bias_check.check_vertical_accel_bias, it, it.params)
        assert (it.ekf["P"][ACCEL_BIAS, ACCEL_BIAS] == initial) == (reset and is_old(it))


@pytest.mark.parametrize("agreeing", ["gnss_vel", "baro_hgt"])
def test_a_bias_that_one_of_height_and_velocity_agrees_with_is_kept(agreeing):
    it = flying(V115)
    stuck(it)
    it.ekf["aid"][agreeing]["innovation"] = 1.0
    set_time(it.ekf, int(it.ekf["time_delayed_us"]) + 8_000_000)
    asked(accel_bias_check.check_vertical_accel_bias, it, it.params)
    assert it.ekf["P"][ACCEL_BIAS, ACCEL_BIAS] == 0.01


def test_clipping_of_any_axis_is_counted_until_v1_15(it):
    it.ekf["dt_ekf_avg"] = DT
    for sample in range(51):
        it.ekf["imu_delayed"]["delta_vel_clipping"] = sample % 3 == 0, sample % 3 == 1, sample % 3 == 2
        frequent = asked(height_control._count_clipping, it)
    # by axes: one up, two down
    assert it.ekf["clip_counter"].tolist() == ([51, 0, 0] if is_old(it) else [0, 0, 1])
    assert frequent == is_old(it)
    assert it.ekf["fs"]["bad_acc_clipping"] == is_old(it)


def test_gravity_is_told_as_fused_where_it_was_until_v1_15(it):
    it.ekf["cs"]["gnss_vel"] = it.ekf["cs"]["gnss_pos"] = True
    asked(gravity_fusion.control_gravity_fusion, it, it.params)
    assert it.ekf["aid"]["gravity"]["fused"] == (not is_old(it))
    it.ekf["cs"]["gnss_vel"] = it.ekf["cs"]["gnss_pos"] = False
    asked(gravity_fusion.control_gravity_fusion, it, it.params)
    assert it.ekf["aid"]["gravity"]["fused"]


def test_velocity_resets_leave_the_position_correlated_until_v1_15(it):
    P = it.ekf["P"]
    for a, b in ((POSITION, GYRO_BIAS), (POSITION + 2, ACCEL_BIAS + 2)):
        P[a, b] = P[b, a] = 1e-3
    state_resets.reset_horizontal_velocity_to.py_func(it.ekf, it.params, 1.0, 2.0, 0.25, 0.25)
    state_resets.reset_vertical_velocity_to.py_func(it.ekf, it.params, 3.0, 0.5)
    kept = 1e-3 if is_old(it) else 0.0
    assert P[POSITION, GYRO_BIAS] == kept
    assert P[POSITION + 2, ACCEL_BIAS + 2] == kept
    assert P[VELOCITY, VELOCITY] == 0.25
    assert P[VELOCITY + 2, VELOCITY + 2] == 0.5


def test_nothing_tells_of_a_constant_position_until_v1_15(it):
    flags = it.ekf["sensors"]["system_flags"]
    flags["data_ready"], flags["sample"]["constant_pos"] = True, True
    control._follow_system_flags.py_func(it.ekf)
    assert it.ekf["cs"]["constant_pos"] == (not is_old(it))


def test_the_terrain_has_no_variance_in_the_filter_until_v1_15(it):
    asked(initialise_covariance, it, it.params)
    assert it.ekf["P"][TERRAIN, TERRAIN] == (0.0 if is_old(it) else it.params["EKF2_MIN_RNG"] ** 2)
