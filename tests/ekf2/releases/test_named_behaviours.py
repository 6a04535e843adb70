"""Each named behaviour in the situation that tells it from its predecessor's.

Expected: what docs/releases.md says of the behaviour, as a figure by hand; `OLD` is v1.16 throughout, and where a
behaviour began with main, v1.17 must do as v1.16 does.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import START_US, hovering, set_time

from fusetune.ekf2.feed.message_samples import gnss_measurement_times
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_FRD, EV_FRAME_NED, GNSS_SAMPLE
from fusetune.ekf2.filter import bias_inhibition, measurement_update
from fusetune.ekf2.filter.aid_sources.airspeed import airspeed_control
from fusetune.ekf2.filter.aid_sources.external_vision import ev_attitude_error, ev_height_control, ev_vel_control
from fusetune.ekf2.filter.aid_sources.fake_position import fake_pos_control
from fusetune.ekf2.filter.aid_sources.gnss import (
    gnss_height_control,
    gnss_resets,
    gps_checks,
    gps_control,
    yaw_emergency,
)
from fusetune.ekf2.filter.aid_sources.gravity import gravity_fusion
from fusetune.ekf2.filter.aid_sources.magnetometer import mag_control, mag_fusion, mag_heading, mag_resets
from fusetune.ekf2.filter.aid_sources.optical_flow import optical_flow_control
from fusetune.ekf2.filter.aid_sources.range_finder import range_height_control
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.common.levelling import follow_specific_force
from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.filter.common.state import ATTITUDE, GYRO_BIAS, VELOCITY, WIND
from fusetune.ekf2.filter.resets import state_resets
from fusetune.ekf2.releases.behaviours import MODELLED, RELEASES
from fusetune.ekf2.releases.by_release import KernelChoice, release_of_fields
from fusetune.ekf2.replay import commands
from fusetune.px4 import releases

OLD, V117, MAIN = "v1.16", "v1.17", "main"
SINCE_V1_16 = [one for one in MODELLED if RELEASES.index(one) >= RELEASES.index(OLD)]
"""Older ones have tests of their own, in the files beside this one."""
SINCE_V117 = [(OLD, False), (V117, True), (MAIN, True)]
SINCE_MAIN = [(OLD, False), (V117, False), (MAIN, True)]


class Flying(NamedTuple):
    """The estimator of a release in flight, with its parameters."""

    ekf: np.void
    params: np.void


def flying(release: str, **overrides: float) -> Flying:
    params = parameter_record(complete({}, overrides, releases.BASELINE), release)
    return Flying(hovering(params, release).view(np.recarray)[0], params.view(np.recarray)[0])


def asked(choice: KernelChoice, it: Flying, *arguments: object) -> Any:
    """What the kernel of a release does, by its Python text: compiling all that it calls would take seconds."""
    release = release_of_fields(it.ekf.dtype.names)
    return choice.of(release).py_func(it.ekf, *arguments)


@pytest.fixture
def sample() -> np.void:
    """A good fix, at the limit of what starting asks for."""
    record = np.zeros(1, GNSS_SAMPLE)[0]
    record["lat_deg"], record["lon_deg"], record["alt"] = 47.4, 8.5, 488.0
    record["fix_type"], record["nsats"] = 3, 10
    record["hacc"], record["vacc"], record["sacc"], record["pdop"] = 1.0, 1.5, 0.2, 1.2
    return record


def checks(it: Flying, sample: np.void, seconds: float) -> bool:
    """Run the GNSS checks five times a second and return the last result."""
    passed = False
    for _ in range(round(seconds * 5)):
        set_time(it.ekf, int(it.ekf["time_delayed_us"]) + 200_000)
        sample["time_us"] = it.ekf["time_delayed_us"]
        passed = bool(gps_checks.check_gnss_sample(it.ekf, it.params, sample))
    return passed


@pytest.mark.parametrize(("release", "simplified"), SINCE_V117)
def test_few_satellites_stop_a_receiver_in_flight_until_v1_16(release, simplified, sample):
    it = flying(release, EKF2_GPS_CHECK=1023.0, EKF2_REQ_GPS_H=2.0)
    assert checks(it, sample, 3.0)
    sample["nsats"] = 4
    assert checks(it, sample, 1.0) == simplified
    # but what no filter can use is refused by every release
    sample["sacc"] = 11.0
    assert not checks(it, sample, 1.0)


@pytest.mark.parametrize("release", SINCE_V1_16)
def test_a_better_fix_may_be_asked_for_since_v1_17(release, sample):
    it = flying(release, EKF2_GPS_CHECK=2047.0, EKF2_REQ_GPS_H=2.0)
    if release != OLD:
        it.params["EKF2_REQ_FIX"] = 4.0
    assert checks(it, sample, 3.0) == (release == OLD)


@pytest.mark.parametrize("release", SINCE_V1_16)
def test_main_checks_strictly_on_the_ground_as_v1_16_does(release, sample):
    it = flying(release, EKF2_GPS_CHECK=1023.0, EKF2_REQ_GPS_H=2.0)
    it.ekf["cs"]["in_air"] = False
    assert checks(it, sample, 3.0)
    sample["nsats"] = 4
    assert checks(it, sample, 1.0) == (release == V117)


@pytest.mark.parametrize(("release", "within"), [(V117, False), (MAIN, True)])
def test_main_starts_gnss_within_its_gates(release, within):
    it = flying(release)
    it.ekf["cs_prev"]["yaw_align"] = True
    aid = it.ekf["aid"]["gnss_vel"]
    aid["test_ratio"][:2] = 0.1, 0.1
    assert gnss_resets.may_start_without_reset(it.ekf, aid, False)
    assert not gnss_resets.may_start_without_reset(it.ekf, aid, True)
    aid["test_ratio"][:2] = 0.9, 0.9
    assert gnss_resets.may_start_without_reset(it.ekf, aid, False) == within


def test_gnss_resets_what_nothing_else_aids_or_by_its_mode_nothing_that_moves_along():
    it = flying(V117)
    assert gnss_resets.is_gnss_reset_allowed(it.ekf, it.params, False, False)
    assert not gnss_resets.is_gnss_reset_allowed(it.ekf, it.params, True, False)
    it.ekf["cs"]["opt_flow"] = True
    assert gnss_resets.is_gnss_reset_allowed(it.ekf, it.params, False, False)
    it.params["EKF2_GPS_MODE"] = 1.0
    assert not gnss_resets.is_gnss_reset_allowed(it.ekf, it.params, False, False)
    it.params["EKF2_GPS_MODE"], it.ekf["gnss_trust"]["fault"] = 0.0, True
    assert not gnss_resets.is_gnss_reset_allowed(it.ekf, it.params, False, False)


@pytest.mark.parametrize(("release", "rejected_only"), [(V117, False), (MAIN, True)])
def test_main_blames_the_yaw_for_a_rejected_velocity_alone(release, rejected_only, monkeypatch):
    it = flying(release)
    monkeypatch.setattr(gps_control, "is_yaw_failure", lambda ekf: True)
    set_time(it.ekf, START_US + 5_000_000)
    it.ekf["cs"]["gnss_vel"] = True
    assert asked(gps_control._is_yaw_blamed, it) != rejected_only
    it.ekf["aid"]["gnss_vel"]["innovation_rejected"] = True
    assert asked(gps_control._is_yaw_blamed, it)


@pytest.mark.parametrize(("release", "repeated"), SINCE_V117)
def test_a_yaw_that_was_reset_in_this_update_may_be_reset_again(release, repeated):
    it = flying(release)
    it.ekf["state_reset"]["quat_counter"] = it.ekf["state_reset_prev"]["quat_counter"] + 1
    assert asked(yaw_emergency._has_yaw_been_reset, it) != repeated


@pytest.mark.parametrize(("release", "deviation"), SINCE_MAIN)
def test_main_tells_the_yaw_estimator_the_deviation(release, deviation):
    it = flying(release)
    assert asked(yaw_emergency._told_accuracy, it, 0.09) == pytest.approx(0.3 if deviation else 0.09)


@pytest.mark.parametrize(
    ("release", "by_other_reset", "by_heading_reset"), [(OLD, True, True), (V117, False, True), (MAIN, False, False)]
)
def test_which_reset_in_flight_aligns_the_field(release, by_other_reset, by_heading_reset):
    it = flying(release)
    assert bool(asked(mag_resets._aligns_field, it, False)) == by_other_reset
    assert bool(asked(mag_resets._aligns_field, it, True)) == by_heading_reset
    # nothing fuses a heading here
    assert bool(asked(mag_resets._may_ask_for_yaw_reset, it)) == (release == OLD)


@pytest.mark.parametrize(("release", "heading_kept"), SINCE_MAIN)
def test_main_aligns_the_field_on_the_climb_and_keeps_an_aided_heading(release, heading_kept, monkeypatch):
    it, with_heading = flying(release), []
    monkeypatch.setattr(mag_control, "_reset_to_filtered", lambda ekf, params, heading: with_heading.append(heading))
    it.ekf["cs"]["mag_hdg"] = it.ekf["cs"]["gnss_pos"] = True
    asked(mag_control._reset_on_climb, it, it.params)
    assert with_heading == [not heading_kept]
    assert it.ekf["cs"]["mag_aligned_in_flight"] == heading_kept


@pytest.mark.parametrize(("release", "forgiven"), SINCE_MAIN)
def test_main_trusts_a_consistent_magnetometer_again(release, forgiven):
    it = flying(release)
    for flag in ("mag", "mag_fault", "mag_heading_consistent", "constant_pos"):
        it.ekf["cs"][flag] = True
    asked(mag_control._forgive_mag_fault, it)
    assert it.ekf["cs"]["mag_fault"] != forgiven
    assert bool(asked(mag_control._is_heading_kept, it)) == forgiven
    assert bool(asked(mag_heading._is_present_small, it, it.params, 1.0)) != forgiven


@pytest.mark.parametrize(("release", "bias_held"), SINCE_V117)
def test_a_magnetometer_that_may_not_tilt_leaves_the_level_gyro_bias(release, bias_held):
    it = flying(release)
    K = np.ones(it.ekf["scratch"]["K"].shape)
    asked(mag_fusion._hold_tilt, it, K)
    assert K[ATTITUDE : ATTITUDE + 3].tolist() == [0.0, 0.0, 1.0]
    assert K[GYRO_BIAS : GYRO_BIAS + 3].tolist() == ([0.0, 0.0, 1.0] if bias_held else [1.0] * 3)
    K[:] = 1.0
    asked(mag_fusion._hold_tilt_by_declination, it, K)
    assert (K[ATTITUDE] == 0.0) == bias_held


@pytest.mark.parametrize(("release", "steady"), SINCE_V117)
def test_gravity_is_fused_while_the_mean_force_is_one_g(release, steady, monkeypatch):
    it = flying(release, EKF2_IMU_CTRL=7.0)
    for part in ("_update_gravity", "_fuse_gravity"):
        monkeypatch.setattr(gravity_fusion, part, lambda ekf, params: None)
    it.ekf["accel_magnitude_filt"] = 15.0  # a jerk that the decaying maximum still remembers
    if steady:
        it.ekf["levelling"]["specific_force"] = 0.0, 0.0, -9.8
    asked(gravity_fusion.control_gravity_fusion, it, it.params)
    assert it.ekf["cs"]["gravity_vector"] == steady
    it.ekf["cs"]["tilt_align"] = it.ekf["aid"]["gravity"]["fused"] = False
    it.ekf["accel_magnitude_filt"] = 9.8
    asked(gravity_fusion.control_gravity_fusion, it, it.params)
    assert it.ekf["cs"]["gravity_vector"] != steady
    # v1.16 says so of what it has not fused, too
    assert it.ekf["aid"]["gravity"]["fused"] != steady


@pytest.mark.parametrize(("release", "yields"), SINCE_V117)
def test_fake_position_makes_way_for_gravity_that_is_fused(release, yields):
    it = flying(release, EKF2_IMU_CTRL=7.0)
    assert asked(fake_pos_control._is_gravity_leading, it, it.params) != yields
    it.ekf["cs"]["gravity_vector"] = True
    assert asked(fake_pos_control._is_gravity_leading, it, it.params)
    assert bool(asked(bias_inhibition._is_only_tilt_held, it)) == yields


@pytest.mark.parametrize(("release", "at_rest_only"), SINCE_V117)
def test_a_range_finder_stands_on_the_ground_only_at_rest(release, at_rest_only):
    it = flying(release)
    it.ekf["cs"]["in_air"] = False
    assert bool(asked(range_height_control._may_stand, it)) != at_rest_only
    it.ekf["cs"]["vehicle_at_rest"] = True
    assert asked(range_height_control._may_stand, it)


@pytest.mark.parametrize(("release", "seconds"), SINCE_MAIN)
def test_main_holds_the_motion_of_range_for_two_seconds(release, seconds):
    assert range_height_control._motion_hold_us(flying(release).ekf) == (2_000_000 if seconds else 2)


@pytest.mark.parametrize(("release", "scaled"), SINCE_V117)
def test_terrain_is_where_the_aided_velocity_causes_the_flow(release, scaled):
    it = flying(release)
    it.ekf["cs"]["gnss_vel"] = True
    it.ekf["vel"][:2] = 3.0, 4.0
    if scaled:
        it.ekf["flow_rates"]["compensated_lpf"] = 0.0, 0.5  # rad/s: 5 m/s at 10 m
    expected = 10.0 if scaled else it.params["EKF2_MIN_RNG"]
    assert asked(optical_flow_control._height_by_flow, it, it.params) == pytest.approx(expected)


@pytest.mark.parametrize(("release", "known"), SINCE_MAIN)
def test_main_knows_the_height_above_ground_by_range(release, known):
    it = flying(release)
    it.ekf["terrain_valid"] = False
    it.ekf["height_sensor_ref"] = HEIGHT_REF_RANGE
    assert bool(asked(optical_flow_control._is_height_known, it)) == known


@pytest.mark.parametrize(("release", "correlated"), SINCE_V117)
def test_the_covariance_of_the_wind_follows(release, correlated):
    it = flying(release)
    it.ekf["gyro_bias_inhibit"] = it.ekf["accel_bias_inhibit"] = False
    it.ekf["scratch"]["K"] = 1.0
    measurement_update.clear_inhibited_state_kalman_gains(it.ekf)
    assert (it.ekf["scratch"]["K"][WIND] == 1.0) == correlated


@pytest.mark.parametrize(("release", "at_once"), SINCE_V117)
def test_a_horizontal_velocity_of_one_known_variance_uncorrelates_both(release, at_once):
    it = flying(release)
    it.ekf["P"][VELOCITY + 1, 0] = it.ekf["P"][0, VELOCITY + 1] = 0.001
    state_resets.reset_horizontal_velocity_to(it.ekf, it.params, 1.0, 2.0, 0.25, math.nan)
    assert it.ekf["P"][VELOCITY, VELOCITY] == pytest.approx(0.25)
    assert it.ekf["P"][VELOCITY + 1, VELOCITY + 1] == pytest.approx(0.01)
    assert (it.ekf["P"][VELOCITY + 1, 0] == 0.0) == at_once


@pytest.mark.parametrize(("release", "active_only"), SINCE_MAIN)
def test_main_shifts_the_biases_of_active_sources(release, active_only):
    it = flying(release)
    it.ekf["cs"]["baro_hgt"] = True
    state_resets.reset_altitude_to(it.ekf, it.params, 15.0, 0.1)
    assert it.ekf["baro_b_est"]["bias"] == pytest.approx(-5.0)
    assert it.ekf["gps_hgt_b_est"]["bias"] == pytest.approx(0.0 if active_only else -5.0)


@pytest.mark.parametrize(("release", "turned"), SINCE_MAIN)
def test_main_turns_an_unaided_velocity_with_the_yaw(release, turned):
    it = flying(release)
    it.ekf["vel"][:2] = 2.0, 0.0
    state_resets.reset_quat_state_yaw(it.ekf, it.params, math.pi / 2.0, 0.1)
    assert it.ekf["vel"][:2] == pytest.approx((0.0, 2.0) if turned else (2.0, 0.0))
    # less than 0.3 rad does not
    state_resets.reset_quat_state_yaw(it.ekf, it.params, math.pi / 2.0 + 0.2, 0.1)
    assert it.ekf["vel"][:2] == pytest.approx((0.0, 2.0) if turned else (2.0, 0.0))


@pytest.mark.parametrize(("release", "held"), SINCE_MAIN)
def test_main_holds_a_heading_that_nothing_tells(release, held):
    it = flying(release, EKF2_HEAD_NOISE=0.05)
    it.ekf["P"][ATTITUDE + 2, 0] = it.ekf["P"][0, ATTITUDE + 2] = 0.001
    it.ekf["scratch"]["K"] = 1.0
    measurement_update.clear_inhibited_state_kalman_gains(it.ekf)
    assert (it.ekf["scratch"]["K"][ATTITUDE + 2] == 0.0) == held
    measurement_update.constrain_covariance(it.ekf, it.params)
    assert it.ekf["P"][ATTITUDE + 2, ATTITUDE + 2] == pytest.approx(0.05**2 if held else 0.01)
    assert (it.ekf["P"][ATTITUDE + 2, 0] == 0.0) == held


@pytest.mark.parametrize(("release", "once"), SINCE_MAIN)
def test_main_reduces_a_large_variance_once(release, once):
    it = flying(release)
    it.ekf["P"][VELOCITY, VELOCITY] = 4e6
    measurement_update.constrain_state_variances(it.ekf)
    assert (it.ekf["P"][VELOCITY, VELOCITY] > 1e6) == once
    assert it.ekf["P"][VELOCITY, VELOCITY] < 4e6


@pytest.mark.parametrize(("release", "counted"), SINCE_MAIN)
def test_main_counts_aligned_vision_to_north_east_aiding(release, counted):
    it = flying(release)
    it.ekf["cs"]["ev_pos"] = True
    assert not asked(is_north_east_aiding_active, it)
    it.ekf["cs"]["yaw_align"] = True
    assert bool(asked(is_north_east_aiding_active, it)) == counted


@pytest.mark.parametrize(("release", "levered"), SINCE_MAIN)
def test_main_levers_the_attitude_of_vision(release, levered):
    it = flying(release)
    vision = it.ekf["sensors"]["ev"]["sample"]
    vision["pos"], vision["orientation_var"] = (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)
    variance = asked(ev_attitude_error.variance_with_attitude, it, 0, 0.05, 3)
    assert variance == pytest.approx(0.05 + 4.0 * 0.3 + 9.0 * 0.2 if levered else 0.3)
    vision["pos_frame"] = EV_FRAME_NED
    assert bool(asked(ev_height_control._is_height_turned, it)) != levered
    vision["pos_frame"] = EV_FRAME_FRD
    assert asked(ev_height_control._is_height_turned, it)


@pytest.mark.parametrize(("release", "stamped"), SINCE_MAIN)
def test_main_stamps_vision_velocity(release, stamped):
    it = flying(release)
    it.ekf["sensors"]["ev"]["sample"]["time_us"] = 77
    assert (asked(ev_vel_control._local_sample_time, it) == 77) == stamped


@pytest.mark.parametrize(("release", "wings_only"), SINCE_MAIN)
def test_main_keeps_airspeed_to_fixed_wings(release, wings_only, monkeypatch):
    it = flying(release, EKF2_ARSP_THR=2.0)
    for part in ("update_airspeed", "_start_airspeed"):
        monkeypatch.setattr(airspeed_control, part, lambda *_: None)
    it.ekf["sensors"]["airspeed"]["sample"]["true_airspeed"] = 12.0
    airspeed_control._use_airspeed_sample.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["fuse_aspd"] != wings_only
    it.ekf["cs"]["fixed_wing"] = True
    it.ekf["cs"]["fuse_aspd"] = it.ekf["cs"]["wind"] = False
    airspeed_control._use_airspeed_sample.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["fuse_aspd"]


@pytest.mark.parametrize(("release", "fused"), SINCE_MAIN)
def test_airspeed_of_main_starts_by_being_fused(release, fused, monkeypatch):
    it, done = flying(release), []
    for part in ("reset_vel_using_airspeed", "_reset_wind", "fuse_airspeed"):
        monkeypatch.setattr(airspeed_control, part, lambda *_, part=part: done.append(part))
    it.ekf["cs"]["wind"], it.ekf["horizontal_deadreckon_time_exceeded"] = True, False
    asked(airspeed_control._start_airspeed, it, it.params, True)
    assert done == ["fuse_airspeed"] * fused
    it.ekf["horizontal_deadreckon_time_exceeded"] = True
    asked(airspeed_control._start_airspeed, it, it.params, True)
    assert done == ["fuse_airspeed", "reset_vel_using_airspeed"] * fused


@pytest.mark.parametrize(("release", "forced"), SINCE_V117)
def test_a_given_position_is_taken_over_whole(release, forced, monkeypatch):
    it, gains = flying(release), []
    monkeypatch.setattr(commands, "fuse_direct_state", lambda ekf, *_: gains.append(0.5))
    monkeypatch.setattr(commands, "compute_kalman_gain", lambda ekf, H, variance: None)
    monkeypatch.setattr(commands, "measurement_update", lambda ekf, *_: gains.append(ekf.scratch.K.max()))
    monkeypatch.setattr(commands, "_fuse_with_gain_on", commands._fuse_with_gain_on.py_func)
    for part in ("update_horizontal_position_reset_status", "apply_position_reset"):
        monkeypatch.setattr(commands, part, lambda *_: gains.append("told"))
    asked(commands._fuse_given_position, it, it.params, -3.0, 0.0, 0.02, 0.02, 0.01)
    assert gains == ([1.0, 1.0, "told", "told"] if forced else [0.5, 0.5])


@pytest.mark.parametrize(("release", "left_out"), SINCE_V117)
def test_an_unhealthy_range_sample_stops_nothing(release, left_out, monkeypatch):
    it = flying(release, EKF2_RNG_CTRL=2.0)
    for part, value in (("is_data_healthy", False), ("has_recent_range", True), ("is_height_reset_required", False)):
        monkeypatch.setattr(range_height_control, part, lambda *_, value=value: value)
    for part in ("stop_rng_hgt_fusion", "stop_rng_terr_fusion", "_fuse_or_recover"):
        monkeypatch.setattr(range_height_control, part, lambda ekf, *_: setattr(ekf.cs, "rng_terrain", False))
    monkeypatch.setattr(range_height_control, "_choose_height_aiding", lambda *_: False)
    for part in ("_follow_conditional_reference", "_fuse_healthy_or_recover"):
        monkeypatch.setattr(range_height_control, part, lambda *_: None)
    it.ekf["cs"]["rng_terrain"] = True
    it.ekf["aid"]["rng_hgt"]["observation"][0] = it.ekf["aid"]["rng_hgt"]["observation_variance"][0] = 1.0
    asked(range_height_control._control_with_sample, it, it.params)
    assert it.ekf["cs"]["rng_terrain"] == left_out


def test_a_height_that_fails_beside_another_is_faulty_until_it_has_agreed_for_five_seconds(monkeypatch):
    it = flying(V117)
    it.params["EKF2_GPS_MODE"] = 1.0
    monkeypatch.setattr(gnss_height_control, "fuse_vertical_position", lambda *_: None)
    it.ekf["cs"]["gps_hgt"] = it.ekf["cs"]["baro_hgt"] = True
    it.ekf["origin"]["alt"] = 400.0
    trust, aid = it.ekf["gnss_trust"], it.ekf["aid"]["gnss_hgt"]
    aid["time_last_fuse"] = START_US - 6_000_000
    gnss_height_control._continue_or_fault_height.py_func(it.ekf, it.params, 10.0, 1.0)
    assert trust["height_fault"]
    assert not it.ekf["cs"]["gps_hgt"]
    for seconds, rejected, started in ((3, True, False), (7, False, False), (9, False, True)):
        set_time(it.ekf, START_US + seconds * 1_000_000)
        aid["innovation_rejected"] = rejected
        gnss_height_control._start_sound_height.py_func(it.ekf, it.params, 10.0, 1.0, False)
        assert it.ekf["cs"]["gps_hgt"] == started
    assert not trust["height_fault"]


def test_main_takes_the_time_that_a_gnss_message_tells():
    stamped = {"timestamp": np.array([5_000_000, 5_200_000]), "timestamp_sample": np.array([4_900_000, 5_090_000])}
    assert gnss_measurement_times(stamped).tolist() == [4_900_000, 5_090_000]
    assert gnss_measurement_times({**stamped, "timestamp_sample": stamped["timestamp"]}) is None
    assert gnss_measurement_times({"timestamp": stamped["timestamp"]}) is None


def test_levelling_follows_the_horizon():
    """The first update takes over the force that levelled; the next ones are low-passed with a tenth."""
    it = flying(V117)
    it.ekf["levelling"]["specific_force"] = 0.0, 0.0, -9.0
    for expected in (-9.0, -9.0 - 0.1 * (9.80665 - 9.0)):
        follow_specific_force.py_func(it.ekf)
        assert it.ekf["levelling"]["specific_force"][2] == pytest.approx(expected)
