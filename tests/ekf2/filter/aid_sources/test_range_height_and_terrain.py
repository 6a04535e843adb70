"""Range fusion into height and terrain, its modes and resets, and the terrain where nothing observes it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import (
    at_time,
    is_running_after,
    make_estimator,
    make_parameters,
    put_sample,
)

from fusetune.ekf2.filter.aid_sources.range_finder.range_height_control import control_range_hagl_fusion
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_fusion import (
    compute_hagl_h,
    compute_hagl_variance,
    fuse_hagl_rng,
    get_range_variance,
    reset_terrain_to_rng,
    update_range_hagl,
)
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_GNSS, HEIGHT_REF_RANGE
from fusetune.ekf2.filter.terrain_control import control_terrain_fake_fusion, init_terrain, update_terrain_validity

HEIGHT, TERRAIN = 8, 23
CONDITIONAL, ENABLED = 1, 2
GNSS, RANGE = 1, 2


def _flying(time_s: float = 5.0, altitude: float = 2.0) -> np.void:
    """Aligned, hovering over ground at height 0 with a valid GNSS height reference."""
    ekf = make_estimator(time_s)
    ekf["cs"]["tilt_align"] = True
    ekf["cs"]["in_air"] = True
    ekf["cs_prev"]["in_air"] = True
    ekf["cs"]["gps_hgt"] = True
    ekf["height_sensor_ref"] = HEIGHT_REF_GNSS
    ekf["gpos_alt"] = altitude
    ekf["P"][...] = np.eye(24) * 0.01
    ekf["sensors"]["range"]["exists"] = True
    ekf["range"]["sensor_min_distance"] = 0.1
    ekf["range"]["sensor_max_distance"] = 40.0
    return ekf


def _feed(ekf: np.void, params: np.void, distance: float, samples: int = 1, quality: int = 100) -> None:
    for _ in range(samples):
        at_time(ekf, ekf["time_delayed_us"] * 1e-6 + 0.05)
        ekf["time_good_vert_accel"] = ekf["time_last_hgt_fuse"] = ekf["time_delayed_us"]
        put_sample(ekf, "range", 3_000, range=distance, quality=quality)
        control_range_hagl_fusion(ekf, params)


def test_jacobian_and_variance_of_height_above_ground():
    """h = terrain - p_z is linear, so a finite difference of it is exact."""
    H = np.empty(24)
    compute_hagl_h(H)
    numerical = np.zeros(24)
    for i, sign in ((HEIGHT, -1.0), (TERRAIN, 1.0)):
        state = np.zeros(24)
        state[i] = 1.0
        numerical[i] = state[TERRAIN] - state[HEIGHT]
        assert numerical[i] == sign
    np.testing.assert_array_equal(H, numerical)

    ekf = make_estimator()
    root = np.random.default_rng(1).normal(size=(24, 24))
    ekf["P"][...] = root @ root.T
    assert compute_hagl_variance(ekf) == pytest.approx(H @ ekf["P"] @ H)


def test_observation_variance_grows_with_range_and_holds_the_height_variance():
    """PX4's replay of a vehicle on the ground: 100 + 0.1² + (0.05 · 0.1386)² = 100.010048."""
    ekf, params = make_estimator(), make_parameters(EKF2_RNG_NOISE=0.1, EKF2_RNG_SFE=0.05)
    ekf["P"][HEIGHT, HEIGHT] = 100.0
    ekf["range"]["sample"]["range"] = 0.1386
    assert get_range_variance(ekf, params) == pytest.approx(100.010048, abs=1e-6)


@pytest.mark.parametrize(("update_height", "update_terrain"), [(True, True), (True, False), (False, True)])
def test_fusion_moves_what_it_may(update_height, update_terrain):
    ekf, params = _flying(), make_parameters()
    root = np.random.default_rng(2).normal(size=(24, 24)) * 0.1
    ekf["P"][...] = root @ root.T + 0.01 * np.eye(24)
    ekf["range"]["sample"]["range"] = 2.2
    update_range_hagl(ekf, params)
    assert fuse_hagl_rng(ekf, params, update_height, update_terrain)
    assert (ekf["gpos_alt"] != 2.0) == update_height
    assert (ekf["vel"][0] != 0.0) == update_height
    assert (ekf["terrain"] != 0.0) == update_terrain
    assert (ekf["time_last_terrain_fuse"] != 0) == update_terrain


def test_terrain_reset_takes_the_whole_innovation_and_the_height_uncertainty():
    ekf, params = _flying(), make_parameters()
    ekf["P"][HEIGHT, HEIGHT] = 4.0
    ekf["range"]["sample"]["range"] = 5.0
    update_range_hagl(ekf, params)
    variance = ekf["aid"]["rng_hgt"]["observation_variance"][0]
    reset_terrain_to_rng(ekf, params)
    assert ekf["gpos_alt"] == 2.0
    assert ekf["terrain"] == pytest.approx(3.0)  # 5 m below the vehicle, down positive
    # (I - K H) P (I - K H)' + K R K' with K = e_terrain: variance P_zz + R, covariance P_zz
    assert ekf["P"][TERRAIN, TERRAIN] == pytest.approx(4.0 + variance)
    assert ekf["P"][TERRAIN, HEIGHT] == pytest.approx(4.0)
    assert ekf["state_reset"]["hagl_counter"] == 1
    assert ekf["state_reset"]["hagl_change"] == pytest.approx(3.0)
    assert_holds_what_it_measured(ekf, variance)


def assert_holds_what_it_measured(ekf: np.void, variance: float) -> None:
    """The state is where the sensor says: no innovation is left to be rejected or fused once more."""
    aid = ekf["aid"]["rng_hgt"]
    for name in ("innovation", "innovation_filtered", "test_ratio", "test_ratio_filtered"):
        assert aid[name][0] == 0.0
    assert aid["innovation_variance"][0] == variance
    assert aid["fused"]
    assert not aid["innovation_rejected"]
    assert aid["time_last_fuse"] == ekf["time_delayed_us"]


def test_terrain_first_then_height_when_low_and_slow():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=CONDITIONAL, EKF2_RNG_A_HMAX=5.0, EKF2_HGT_REF=GNSS)
    _feed(ekf, params, 2.0)
    assert ekf["cs"]["rng_terrain"]
    assert not ekf["cs"]["rng_hgt"]
    _feed(ekf, params, 2.0)
    assert ekf["cs"]["rng_hgt"]
    assert ekf["cs"]["rng_terrain"]
    assert ekf["height_sensor_ref"] == HEIGHT_REF_GNSS


@pytest.mark.parametrize(
    ("altitude", "running", "aids"), [(3.4, False, True), (3.6, False, False), (4.9, True, True), (5.1, True, False)]
)
def test_conditional_aid_height_limit_with_hysteresis(altitude, running, aids):
    ekf, params = _flying(altitude=altitude), make_parameters(EKF2_RNG_CTRL=CONDITIONAL, EKF2_RNG_A_HMAX=5.0)
    ekf["cs"]["rng_terrain"] = True
    ekf["cs"]["rng_hgt"] = running
    _feed(ekf, params, altitude)
    assert ekf["cs"]["rng_hgt"] == aids


@pytest.mark.parametrize(("speed", "aided", "aids"), [(0.6, True, True), (0.8, True, False), (0.8, False, True)])
def test_conditional_aid_speed_limit_needs_a_known_speed(speed, aided, aids):
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=CONDITIONAL, EKF2_RNG_A_VMAX=1.0)
    ekf["cs"]["rng_terrain"] = True
    ekf["cs"]["gnss_vel"] = aided
    ekf["vel"][:] = (0.6 * speed, 0.8 * speed, 0.0)
    _feed(ekf, params, 2.0)
    assert ekf["cs"]["rng_hgt"] == aids


def _two_metres_over_a_hill(control):
    """After two samples at 480 m, with a hill of 478 m known below; range is the height reference."""
    ekf, params = _flying(altitude=480.0), make_parameters(EKF2_RNG_CTRL=control, EKF2_HGT_REF=RANGE)
    ekf["terrain"] = -478.0
    _feed(ekf, params, 2.0, samples=2)
    assert ekf["height_sensor_ref"] == HEIGHT_REF_RANGE
    return ekf


def test_as_unconditional_reference_the_ground_becomes_the_datum():
    ekf = _two_metres_over_a_hill(ENABLED)
    assert ekf["gpos_alt"] == pytest.approx(2.0, abs=1e-6)
    assert ekf["cs"]["rng_hgt"]
    assert not ekf["cs"]["rng_terrain"]
    assert ekf["events"]["reset_hgt_to_rng"]


def test_distance_that_became_the_datum_is_not_fused_against_the_old_height():
    """The height was 478 m off; R = P_zz + 0.1² = 0.02 m² each time, so the first sample leaves the terrain 0.03 m².

    The second resets the height to R and is fused with no innovation: its gain P_zz / R = 1 makes the height as
    uncertain as terrain and distance together, 0.03 + 0.02.
    """
    ekf, params = (
        _flying(altitude=480.0),
        make_parameters(EKF2_RNG_CTRL=ENABLED, EKF2_HGT_REF=RANGE, EKF2_RNG_NOISE=0.1, EKF2_RNG_SFE=0.0),
    )
    _feed(ekf, params, 2.0)
    _feed(ekf, params, 2.0)
    assert ekf["cs"]["rng_hgt"]
    assert ekf["gpos_alt"] == pytest.approx(2.0, abs=1e-6)
    assert not ekf["reject"]["hagl"]
    assert ekf["P"][HEIGHT, HEIGHT] == pytest.approx(0.05)
    assert_holds_what_it_measured(ekf, ekf["aid"]["rng_hgt"]["observation_variance"][0])


def test_height_that_failed_too_long_is_taken_from_the_distance():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=ENABLED, EKF2_HGT_REF=RANGE)
    _feed(ekf, params, 2.0, samples=3)
    ekf["gpos_alt"] = 9.0
    ekf["vel"][2] = 1.0
    at_time(ekf, ekf["time_delayed_us"] * 1e-6 + 0.05)
    ekf["time_last_hgt_fuse"] = ekf["time_delayed_us"] - 5_100_000
    sensor, measured_us = ekf["sensors"]["range"], ekf["time_delayed_us"] - 3_000
    sensor["sample"]["time_us"] = sensor["newest_time_us"] = measured_us
    control_range_hagl_fusion(ekf, params)
    assert ekf["gpos_alt"] == pytest.approx(2.0, abs=1e-6)
    assert ekf["vel"][2] == 0.0
    assert_holds_what_it_measured(ekf, ekf["aid"]["rng_hgt"]["observation_variance"][0])


def test_conditional_reference_keeps_the_height():
    ekf = _two_metres_over_a_hill(CONDITIONAL)
    assert ekf["gpos_alt"] == pytest.approx(480.0, abs=1e-3)
    assert not ekf["events"]["reset_hgt_to_rng"]


def test_start_resets_a_terrain_that_disagrees():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=CONDITIONAL)
    ekf["terrain"] = 30.0
    _feed(ekf, params, 2.0)
    assert ekf["cs"]["rng_terrain"]
    assert ekf["terrain"] == pytest.approx(0.0, abs=1e-5)


def test_start_beside_optical_flow_waits_for_agreement():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=CONDITIONAL)
    ekf["cs"]["opt_flow_terrain"] = True
    ekf["terrain"] = 30.0
    _feed(ekf, params, 2.0)
    assert not ekf["cs"]["rng_terrain"]
    ekf["terrain"] = 0.0
    _feed(ekf, params, 2.0)
    assert ekf["cs"]["rng_terrain"]
    assert ekf["aid"]["rng_hgt"]["fused"]


def test_lasting_rejection_resets_the_terrain():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=CONDITIONAL)
    _feed(ekf, params, 2.0, samples=5)
    counter = ekf["state_reset"]["hagl_counter"]
    ekf["vel"][:] = (5.0, 0.0, 0.0)  # over uneven ground the jump is no inconsistency
    for _ in range(102):
        ekf["P"][...] = np.eye(24) * 1e-3
        _feed(ekf, params, 9.0)
    assert ekf["state_reset"]["hagl_counter"] == counter + 1
    assert ekf["terrain"] == pytest.approx(7.0, abs=0.1)


def test_bad_sample_in_the_air_stops_and_on_the_ground_is_replaced():
    params = make_parameters(EKF2_RNG_CTRL=CONDITIONAL, EKF2_MIN_RNG=0.1)
    ekf = _flying()
    _feed(ekf, params, 2.0, samples=3)
    _feed(ekf, params, 50.0)
    assert not ekf["cs"]["rng_terrain"]
    assert not ekf["cs"]["rng_hgt"]

    ekf = _flying(altitude=0.1)
    ekf["cs"]["in_air"] = False
    _feed(ekf, params, 0.0, samples=3, quality=0)
    assert ekf["cs"]["rng_terrain"]
    assert ekf["aid"]["rng_hgt"]["observation"][0] == pytest.approx(0.1)


def test_disabled_range_finder_is_only_observed():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=0)
    _feed(ekf, params, 2.0, samples=3)
    assert ekf["aid"]["rng_hgt"]["timestamp_sample"] > 0
    assert not ekf["cs"]["rng_terrain"]


def test_stops_without_data():
    ekf, params = _flying(), make_parameters(EKF2_RNG_CTRL=CONDITIONAL)
    _feed(ekf, params, 2.0, samples=3)
    assert is_running_after(ekf, params, 0.39, "range", control_range_hagl_fusion, "rng_terrain")
    assert not is_running_after(ekf, params, 0.41, "range", control_range_hagl_fusion, "rng_terrain")


def test_lever_arm_moves_the_distance_to_the_imu():
    ekf, params = _flying(), make_parameters(EKF2_RNG_POS_Z=0.3, EKF2_IMU_POS_Z=0.1)
    _feed(ekf, params, 2.0)
    # the sensor sits 0.2 m below the IMU, which is that much farther from the ground
    assert ekf["aid"]["rng_hgt"]["observation"][0] == pytest.approx(2.2)


def test_terrain_on_the_ground_is_right_below():
    ekf, params = make_estimator(), make_parameters(EKF2_MIN_RNG=0.1)
    ekf["gpos_alt"] = 12.0
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] == pytest.approx(-11.9, abs=1e-6)
    assert ekf["P"][TERRAIN, TERRAIN] == pytest.approx(0.01)
    assert ekf["last_on_ground_pos_d"] == -12.0


@pytest.mark.parametrize("flag", ["rng_terrain", "opt_flow_terrain"])
def test_terrain_on_the_ground_is_left_to_a_sensor(flag):
    ekf, params = make_estimator(), make_parameters()
    ekf["cs"][flag] = True
    ekf["terrain"] = 7.0
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] == 7.0


def test_terrain_on_the_ground_is_held_for_a_second_after_aiding_and_as_reference():
    ekf, params = make_estimator(), make_parameters()
    ekf["terrain"] = 7.0
    ekf["time_last_terrain_fuse"] = ekf["time_delayed_us"] - 900_000
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] == 7.0
    at_time(ekf, 100.2)
    ekf["height_sensor_ref"] = HEIGHT_REF_RANGE
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] == 7.0
    ekf["height_sensor_ref"] = HEIGHT_REF_GNSS
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] != 7.0


def test_take_off_starts_the_terrain_anew_once():
    ekf, params = make_estimator(), make_parameters(EKF2_MIN_RNG=0.1)
    ekf["cs"]["rng_terrain"] = True
    ekf["terrain"] = 7.0
    ekf["cs"]["in_air"] = True
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] == pytest.approx(0.1)
    ekf["cs_prev"]["in_air"] = True
    ekf["terrain"] = 7.0
    control_terrain_fake_fusion(ekf, params)
    assert ekf["terrain"] == 7.0


def test_terrain_becomes_valid_by_range_and_stays_valid_by_variance():
    ekf, params = _flying(altitude=2.0), make_parameters()
    init_terrain(ekf, params)
    ekf["terrain"] = 0.0
    update_terrain_validity(ekf)
    assert not ekf["terrain_valid"]  # no terrain fusion yet
    ekf["time_last_terrain_fuse"] = ekf["aid"]["rng_hgt"]["time_last_fuse"] = ekf["time_delayed_us"]
    ekf["cs"]["rng_terrain"] = True
    ekf["P"][TERRAIN, TERRAIN] = 10.0
    update_terrain_validity(ekf)
    assert ekf["terrain_valid"]  # range needs no small variance to start with
    update_terrain_validity(ekf)
    assert not ekf["terrain_valid"]  # but keeping it does
    ekf["P"][HEIGHT, HEIGHT] = 0.0
    ekf["P"][TERRAIN, TERRAIN] = 0.24  # below 0.5² m²
    ekf["cs"]["rng_terrain"] = False
    ekf["terrain_valid"] = True
    update_terrain_validity(ekf)
    assert ekf["terrain_valid"]
    ekf["terrain"] = -3.0  # above the vehicle
    update_terrain_validity(ekf)
    assert not ekf["terrain_valid"]


def test_terrain_by_flow_alone_needs_a_small_variance():
    ekf = _flying(altitude=10.0)
    ekf["time_last_terrain_fuse"] = ekf["aid"]["optical_flow"]["time_last_fuse"] = ekf["time_delayed_us"]
    ekf["cs"]["opt_flow_terrain"] = True
    ekf["P"][HEIGHT, HEIGHT] = 0.0
    for variance, valid in ((1.1, False), (0.9, True)):  # 10 % of 10 m, squared
        ekf["P"][TERRAIN, TERRAIN] = variance
        ekf["terrain_valid"] = False
        update_terrain_validity(ekf)
        assert ekf["terrain_valid"] == valid
