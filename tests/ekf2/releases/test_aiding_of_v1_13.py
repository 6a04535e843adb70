"""What GNSS, height, fake position and yaw estimator of v1.13 do otherwise than v1.14's.

Expected: the formulas and limits of docs/releases.md, worked out here.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import START_US, set_time
from tests.ekf2.releases.test_named_behaviours import Flying, asked, flying
from tests.ekf2.releases.test_older_aiding import arrives, give_gnss, place, unaided
from tests.ekf2.replay.test_flight_schedule import Arrival, inputs_of

from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.feed.sensor_samples import GNSS_SAMPLE
from fusetune.ekf2.filter import estimator, height_control, one_height_source, vertical_innovations
from fusetune.ekf2.filter.aid_sources.barometer import baro_offset_bias
from fusetune.ekf2.filter.aid_sources.fake_position import one_fake_position as fake_pos_until_v1_15
from fusetune.ekf2.filter.aid_sources.gnss import (
    gnss_arrival,
    gnss_by_mask,
    gnss_fusion,
    gnss_taken,
    gnss_yaw_by_mask,
    gnss_yaw_control,
)
from fusetune.ekf2.filter.common import timing
from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.filter.yaw_estimator import matrix_bank, told_velocity
from fusetune.ekf2.numerics.rotations import euler_yaw
from fusetune.ekf2.replay import recording
from fusetune.ekf2.replay.flight_schedule import flight_schedule
from fusetune.ekf2.schedule.taking_actions import GNSS as GNSS_DATA
from fusetune.ekf2.schedule.taking_actions import SYSTEM_FLAGS
from fusetune.px4 import releases

V113, V114 = "v1.13", "v1.14"
OLD_AND_NEW = [(V113, True), (V114, False)]
BARO, GNSS, RANGE, VISION = 0.0, 1.0, 2.0, 3.0
"""Values of EKF2_HGT_MODE."""


@pytest.fixture
def sample() -> np.record:
    """A good fix."""
    record = np.zeros(1, GNSS_SAMPLE).view(np.recarray)[0]
    record["lat_deg"], record["lon_deg"], record["alt"] = 47.4, 8.5, 498.0
    record["fix_type"], record["nsats"] = 3, 10
    record["hacc"], record["vacc"], record["sacc"], record["pdop"] = 1.0, 1.5, 0.2, 1.2
    record["yaw"] = math.nan
    return record


@pytest.fixture
def it(sample: np.record) -> Flying:
    """In flight, 10 m above an origin at 488 m, with GNSS and barometer at hand that agree."""
    made = flying(V113)
    made.params["EKF2_AID_MASK"] = 1.0
    place(made, 47.4, 8.5, 488.0)
    ekf = made.ekf
    ekf["cs"]["yaw_align"] = ekf["cs"]["baro_hgt"] = ekf["gnss"]["checks_passed"] = True
    ekf["cs_prev"] = ekf["cs"]
    ekf["gnss"]["last_pass_us"], ekf["gnss"]["last_fail_us"] = START_US, START_US - 20_000_000
    give_gnss(made, sample)
    baro = ekf["sensors"]["baro"]
    baro["exists"], baro["newest_time_us"], baro["sample"]["hgt"] = True, START_US, 510.0
    ekf["baro"]["lpf"] = 500.0
    gnss_taken.take_gnss_sample(ekf, made.params)
    return made


def control(it: Flying) -> None:
    """One update of GNSS, with the sample at hand."""
    gnss_taken.take_gnss_sample(it.ekf, it.params)
    asked(gnss_fusion.control_gnss, it, it.params)


def fused(it: Flying) -> Flying:
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = True
    return it


# GNSS


@pytest.mark.parametrize(("mask", "starts"), [(1.0, True), (2.0, False)])
def test_gnss_starts_where_the_mask_asks_for_it(it, sample, mask, starts):
    it.params["EKF2_AID_MASK"] = mask
    sample["vel"] = 1.0, 2.0, 0.5
    give_gnss(it, sample)
    control(it)
    assert it.ekf["cs"]["gnss_pos"] == it.ekf["cs"]["gnss_vel"] == starts
    assert np.allclose(it.ekf["vel"], (1.0, 2.0, 0.5) if starts else 0.0)
    # all axes are as uncertain as the receiver says, where EKF2_GPS_V_NOISE is not more
    expected = max(0.2, float(it.params["EKF2_GPS_V_NOISE"])) ** 2 if starts else 0.01
    assert np.allclose(np.diag(it.ekf["P"])[3:6], expected)


def test_gnss_that_starts_beside_flow_leaves_the_velocity(it, sample):
    it.ekf["cs"]["opt_flow"] = True
    sample["vel"] = 1.0, 2.0, 0.5
    give_gnss(it, sample)
    control(it)
    assert it.ekf["cs"]["gnss_pos"]
    assert not it.ekf["vel"].any()


def test_a_yaw_that_is_not_of_north_is_aligned_before_gnss_starts(it):
    it.ekf["cs"]["ev_yaw"] = True
    control(it)
    assert not it.ekf["cs"]["gnss_pos"]
    assert not it.ekf["cs"]["ev_yaw"]
    assert it.ekf["mag_modes"]["yaw_reset_requested"]
    assert it.ekf["gnss_arrivals"]["inhibits_ev_yaw"]


def test_velocities_and_position_are_gated_apart(it, sample):
    sample["vel"] = 50.0, 0.0, 0.1
    give_gnss(fused(it), sample)
    control(it)
    ekf, reject = it.ekf, it.ekf["reject"]
    assert (reject["hor_vel"], reject["ver_vel"], reject["hor_pos"]) == (True, False, False)
    assert ekf["vel"][0] == 0.0
    assert ekf["vel"][2] > 0.0
    assert ekf["aid"]["gnss_pos"]["fused"]
    assert ekf["aid"]["gnss_vel"]["innovation_rejected"]
    assert ekf["vertical"]["gnss_fused"]
    assert not ekf["vertical"]["gnss_rejected"]
    # 1.5 times the noise along down
    noise = max(0.2, float(it.params["EKF2_GPS_V_NOISE"]))
    assert np.allclose(ekf["aid"]["gnss_vel"]["observation_variance"], np.square([noise, noise, 1.5 * noise]))


def test_rows_tell_the_vertical_velocity_apart(it):
    rows = np.zeros(3, recording.INNOVATION_ROW).view(np.recarray)
    recorder = recording.new_recorder(recording.IS_FULL).view(np.recarray)[0]
    recorder["innovation_rows"] = 3
    rows["fused"] = True
    it.ekf["vertical"]["gnss_rejected"] = True
    asked(recording._tell_vertical_apart, it, vertical_innovations.GNSS_VELOCITY, recorder, rows)
    assert list(rows["fused"]) == [True, True, False]
    assert list(rows["innovation_rejected"]) == [False, False, True]


def test_a_withheld_gnss_is_judged_and_not_fused(it, sample):
    sample["vel"] = 0.1, 0.0, 0.1
    give_gnss(fused(it), sample)
    it.ekf["sensors"]["gnss"]["withheld"] = True
    control(it)
    assert it.ekf["aid"]["gnss_vel"]["timestamp_sample"] == START_US
    assert not it.ekf["vel"].any()
    assert not it.ekf["aid"]["gnss_pos"]["fused"] or it.ekf["aid"]["gnss_pos"]["time_last_fuse"] == 0


@pytest.mark.parametrize(
    ("seconds", "since_take_off", "resets"),
    [((0.5, 0.5), 5.0, False), ((1.5, 0.5), 5.0, True), ((1.5, 0.5), 31.0, False), ((7.1, 7.1), 60.0, True)],
)
def test_what_failed_is_reset_sooner_after_take_off(it, seconds, since_take_off, resets):
    now = START_US + 70_000_000
    set_time(it.ekf, now)
    velocity, position = (now - round(1e6 * one) for one in seconds)
    it.ekf["time_last_hor_vel_fuse"], it.ekf["time_last_hor_pos_fuse"] = velocity, position
    it.ekf["time_last_on_ground"] = now - round(1e6 * since_take_off)
    it.ekf["aid"]["optical_flow"]["time_last_fuse"] = now
    assert gnss_by_mask._is_reset_due(it.ekf) == resets


@pytest.mark.parametrize(("resets_before", "since_reset_s", "done"), [(0, 6.0, True), (0, 4.0, False), (3, 6.0, False)])
def test_the_yaw_is_put_right_three_times_at_most(it, resets_before, since_reset_s, done):
    gsf, taken = it.ekf["gsf"], it.ekf["gnss_taken"]
    gsf["vel_fuse_started"], gsf["yaw"], gsf["yaw_variance"] = True, 1.0, 0.01
    taken["yaw_resets"], taken["yaw_reset_us"] = resets_before, START_US - round(1e6 * since_reset_s)
    taken["time_before_us"] = START_US - 200_000
    it.ekf["cs"]["mag_hdg"] = True
    gnss_by_mask._put_yaw_right(it.ekf, it.params)
    assert (abs(euler_yaw(it.ekf["R_to_earth"]) - 1.0) < 1e-6) == done
    assert it.ekf["cs"]["mag_fault"] == done
    assert taken["yaw_resets"] == resets_before + done


def test_gnss_that_stops_leaves_the_height_to_the_barometer(it):
    fused(it)
    it.ekf["cs"]["baro_hgt"], it.ekf["cs"]["gps_hgt"] = False, True
    gnss_by_mask.stop_gnss_by_mask(it.ekf, it.params)
    assert it.ekf["cs"]["baro_hgt"]
    assert not it.ekf["cs"]["gps_hgt"]
    # 510 m less the offset of 500 m
    assert it.ekf["gpos_alt"] == 10.0


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_checks_go_by_the_newest_imu_sample_in_v1_13(release, old, sample):
    one = flying(release)
    one.ekf["time_latest_us"] = START_US + 120_000
    arrives(one, sample)
    assert one.ekf["gnss"]["last_fail_us"] == START_US + (120_000 if old else 0)
    one.ekf["gnss"]["last_fail_us"] = START_US - 4_900_000
    assert gnss_arrival.is_gnss_trusted(one.ekf) == old


def test_a_heading_starts_with_its_second_sample(it, sample):
    it.params["EKF2_AID_MASK"] = 129.0
    sample["yaw"], sample["yaw_offset"], sample["yaw_acc"] = 0.5, 0.0, 2.0
    it.ekf["cs"]["ev_yaw"] = True
    for number in range(2):
        gnss_yaw_by_mask.control_gnss_yaw_by_mask(it.ekf, it.params, sample)
        assert it.ekf["cs"]["gnss_yaw"] == (number == 1)
        set_time(it.ekf, START_US + 200_000)
    assert math.isclose(euler_yaw(it.ekf["R_to_earth"]), 0.5)
    assert not it.ekf["cs"]["ev_yaw"]
    # whatever accuracy the receiver tells
    gnss_yaw_control.update_gnss_yaw.py_func(it.ekf, it.params, sample)
    assert math.isclose(it.ekf["aid"]["gnss_yaw"]["observation_variance"][0], 0.1**2)


# height


def watch(it: Flying) -> None:
    asked(height_control.watch_height_first, it, it.params)


def choose(it: Flying) -> str:
    asked(height_control.control_height_fusion, it, it.params)
    cs = it.ekf["cs"]
    (source,) = [name for name in ("baro_hgt", "gps_hgt", "rng_hgt", "ev_hgt") if cs[name]]
    return source


@pytest.mark.parametrize(
    ("mode", "sound", "expected"),
    [(BARO, True, "baro_hgt"), (GNSS, True, "gps_hgt"), (GNSS, False, "baro_hgt"), (RANGE, True, "baro_hgt")],
)
def test_the_mode_names_the_source_of_height(it, mode, sound, expected):
    it.params["EKF2_HGT_MODE"] = mode
    it.ekf["gnss"]["checks_passed"] = sound
    assert choose(it) == expected


def test_a_reset_to_gnss_moves_the_offset_of_the_barometer(it, sample):
    it.params["EKF2_HGT_MODE"] = GNSS
    sample["alt"] = 500.0
    give_gnss(it, sample)
    gnss_taken.take_gnss_sample(it.ekf, it.params)
    it.ekf["sensors"]["gnss"]["data_ready"] = False
    assert choose(it) == "gps_hgt"
    # 12 m instead of 10 m, so the barometer's zero is 2 m lower
    assert math.isclose(it.ekf["gpos_alt"], 12.0, abs_tol=1e-4)
    assert math.isclose(it.ekf["baro"]["lpf"], 498.0, abs_tol=1e-4)
    # 1.5 m, within 1.5 times EKF2_GPS_P_NOISE and EKF2_NOAID_NOISE
    assert math.isclose(it.ekf["P"][8, 8], 1.5**2)


def test_the_offset_follows_the_height_by_a_tenth_of_a_metre_a_second(it):
    it.ekf["cs"]["baro_hgt"], it.ekf["cs"]["gps_hgt"] = False, True
    it.ekf["sensors"]["baro"]["data_ready"] = True
    it.ekf["heights"]["baro_interval"] = 0.05
    it.ekf["sensors"]["baro"]["sample"]["hgt"] = 515.0
    one_height_source._follow_baro_offset(it.ekf)
    assert math.isclose(it.ekf["baro"]["lpf"], 500.0 + 0.1 * 0.05)
    it.ekf["sensors"]["baro"]["sample"]["hgt"] = 510.505
    one_height_source._follow_baro_offset(it.ekf)
    assert math.isclose(it.ekf["baro"]["lpf"], 500.005 + 0.1 * 0.5 * 0.05)


def test_the_barometer_is_fused_without_bias_and_offset(it):
    it.ekf["sensors"]["baro"]["data_ready"] = True
    it.ekf["heights"]["baro_bias"]["bias"] = 0.5
    it.ekf["sensors"]["gnss"]["data_ready"] = False
    choose(it)
    aid = it.ekf["aid"]["baro_hgt"]
    # 510 - 0.5 - 500
    assert math.isclose(aid["observation"][0], 9.5)
    assert math.isclose(aid["innovation"][0], -0.5)
    assert aid["fused"]
    assert it.ekf["vertical"]["position"] == aid["innovation"][0] / math.sqrt(aid["innovation_variance"][0])


@pytest.mark.parametrize(
    ("state", "expected", "fault"),
    [
        ({}, "gps_hgt", True),
        ({"checks_passed": False}, "baro_hgt", False),
        ({"checks_passed": False, "baro_fault": True}, "gps_hgt", True),
        ({"intermittent": True}, "baro_hgt", False),
    ],
)
def test_a_lost_barometer_is_replaced_by_gnss_where_that_is_sound(it, state, expected, fault):
    it.ekf["gnss"]["checks_passed"] = state.get("checks_passed", True)
    it.ekf["cs"]["baro_fault"] = state.get("baro_fault", False)
    it.ekf["vel"][2] = 3.0
    set_time(it.ekf, START_US + 5_100_000)
    newest = 0 if state.get("intermittent") else START_US + 5_000_000
    it.ekf["sensors"]["gnss"]["newest_time_us"] = newest
    it.ekf["sensors"]["gnss"]["data_ready"] = False
    it.ekf["sensors"]["baro"]["newest_time_us"] = START_US + 5_000_000
    watch(it)
    assert it.ekf["cs"][expected]
    assert it.ekf["cs"]["baro_fault"] == fault
    assert it.ekf["time_last_hgt_fuse"] == START_US + 5_100_000
    # without GNSS velocity the vertical velocity starts from rest
    assert it.ekf["vel"][2] == 0.0
    assert it.ekf["P"][5, 5] == 10.0


def low(it: Flying) -> Flying:
    """Low over steady ground, with range that agrees."""
    it.params["EKF2_RNG_AID"] = 1.0
    it.ekf["gpos_alt"] = 2.0
    rng = it.ekf["range"]
    rng["is_sample_ready"] = rng["is_sample_valid"] = True
    rng["sample"]["range"], rng["sample"]["time_us"] = 2.1, START_US
    terrain = it.ekf["aid"]["terrain_range_finder"]
    terrain["innovation"][0], terrain["innovation_variance"][0] = 0.01, 0.1
    terrain["time_last_fuse"] = START_US
    it.ekf["terrain"], it.ekf["terrain_valid"] = 0.0, True
    return it


@pytest.mark.parametrize(
    ("height", "suited", "leads"), [(2.0, False, True), (4.0, False, False), (4.0, True, True), (5.5, True, False)]
)
def test_range_leads_low_and_slow(it, height, suited, leads):
    low(it).ekf["gpos_alt"] = height
    it.params["EKF2_RNG_A_HMAX"] = 5.0
    it.ekf["heights"]["range_suits"] = suited
    assert choose(it) == ("rng_hgt" if leads else "baro_hgt")


def test_range_that_leads_keeps_the_height_by_the_terrain(it):
    low(it).ekf["terrain"] = 0.3
    assert choose(it) == "rng_hgt"
    # 2.1 m above a terrain 0.3 m below zero
    assert math.isclose(it.ekf["aid"]["rng_hgt"]["observation"][0], 1.8)
    assert it.ekf["heights"]["sensor_offset"] == 0.3
    it.params["EKF2_RNG_AID"] = 0.0
    before = float(it.ekf["gpos_alt"])
    assert choose(it) == "baro_hgt"
    assert it.ekf["gpos_alt"] == before


def test_range_is_assumed_where_it_gives_the_height_on_the_ground(it):
    it.params["EKF2_HGT_MODE"] = RANGE
    it.ekf["cs"]["in_air"] = False
    rng = it.ekf["range"]
    rng["is_sample_ready"] = rng["is_regularly_sending_data"] = True
    assert choose(it) == "rng_hgt"
    assert rng["sample"]["range"] == it.params["EKF2_MIN_RNG"]
    assert math.isclose(it.ekf["gpos_alt"], it.params["EKF2_MIN_RNG"], rel_tol=1e-6)


def test_vision_gives_the_height_where_the_mode_says_so(it):
    it.params["EKF2_HGT_MODE"] = VISION
    ev = it.ekf["sensors"]["ev"]
    ev["exists"], ev["data_ready"], ev["newest_time_us"] = True, True, START_US
    ev["sample"]["pos"] = 0.0, 0.0, -12.0
    assert choose(it) == "ev_hgt"
    assert it.ekf["gpos_alt"] == 12.0
    assert it.ekf["aid"]["ev_hgt"]["observation"][0] == -12.0


def test_the_bias_of_the_barometer_is_held_against_gnss(it):
    bias = it.ekf["heights"]["baro_bias"]
    assert bias["variance"] == 0.1
    baro_offset_bias.predict_baro_bias(bias, 0.05, 3.5)
    assert math.isclose(bias["variance"], 0.1 + (0.005 * 0.05) ** 2)
    assert math.isclose(bias["ratio_gain"], 0.05 / 10.05)
    baro_offset_bias.fuse_baro_bias(bias, 0.4, 0.3, 3.5)
    assert math.isclose(bias["bias"], 0.1, rel_tol=1e-5)
    assert math.isclose(bias["variance"], 0.075, rel_tol=1e-5)
    # 0.4² / (9 · 0.4)
    assert math.isclose(bias["ratio_lpf"], 0.05 / 10.05 * 0.16 / 3.6, rel_tol=1e-5)
    bias["ratio_lpf"] = -0.3
    before = float(bias["variance"])
    baro_offset_bias.fuse_baro_bias(bias, 100.0, 0.3, 3.5)
    assert math.isclose(bias["variance"], before + 1e3 * (0.005 * 0.05) ** 2)


@pytest.mark.parametrize(
    ("position", "velocity", "flags", "bad"),
    [
        (3.1, 1.1, {"gnss_pos": True}, True),
        (1.1, 3.1, {"gnss_pos": True}, True),
        (3.1, 0.9, {"gnss_pos": True}, False),
        (3.1, 1.1, {"gnss_pos": True, "gps_hgt": True, "baro_hgt": False}, False),
        (-3.1, -1.1, {"gnss_pos": True}, False),
    ],
)
def test_the_last_innovations_tell_of_bad_accelerations(it, position, velocity, flags, bad):
    for name, value in flags.items():
        it.ekf["cs"][name] = value
    vertical = it.ekf["vertical"]
    vertical["position"], vertical["velocity"] = position, velocity
    vertical["position_us"] = vertical["velocity_us"] = START_US - 900_000
    height_control.check_vertical_acceleration_health(it.ekf)
    assert it.ekf["fs"]["bad_acc_vertical"] == bad


def test_a_height_is_limited_while_the_acceleration_is_bad(it):
    it.ekf["fs"]["bad_acc_vertical"] = True
    aid = it.ekf["aid"]["baro_hgt"]
    aid["innovation"][0], aid["innovation_variance"][0], aid["observation_variance"][0] = 9.0, 1.01, 1.0
    assert vertical_innovations.fuse_vertical_position_apart(it.ekf, it.params, aid, 5.0)
    # 0.01 / 1.01 of 5 σ; what is told stays as it is
    assert math.isclose(it.ekf["gpos_alt"], 10.0 + 0.01 / 1.01 * 5.0 * math.sqrt(1.01), rel_tol=1e-6)
    assert aid["innovation"][0] == 9.0


# yaw estimator


def test_the_yaw_estimator_is_told_the_accuracy_of_the_height(it, monkeypatch):
    monkeypatch.setattr(told_velocity, "run_matrix_bank_in_air", lambda *_: None)
    told_velocity.run_told_matrix_bank.py_func(it.ekf, it.params)
    told = it.ekf["yaw_velocity"]
    assert told["is_new"]
    assert told["accuracy"] == 1.5


@pytest.mark.parametrize(
    ("fixed_wing", "age_s", "airspeed", "expected"),
    [(False, 0.1, 20.0, 0.0), (True, 0.1, 20.0, 20.0), (True, 0.1, 3.0, 0.0), (True, 1.1, 20.0, 15.0)],
)
def test_the_yaw_estimator_takes_the_airspeed_as_measured(it, fixed_wing, age_s, airspeed, expected):
    it.params["EKF2_GSF_TAS"], it.params["EKF2_ARSP_THR"] = 15.0, 8.0
    it.ekf["cs"]["fixed_wing"] = fixed_wing
    measured = it.ekf["sensors"]["airspeed"]["sample"]
    measured["true_airspeed"], measured["time_us"] = airspeed, START_US - round(1e6 * age_s)
    assert told_velocity._airspeed(it.ekf, it.params) == expected


@pytest.mark.parametrize(("release", "learns"), [(V113, True), (V114, False)])
def test_gyro_biases_are_learnt_up_to_0_175_rad_per_s_in_v1_13(release, learns):
    one = flying(release)
    assert (asked(matrix_bank._spin_limit, one) > 0.1749) == learns


# fake position


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_the_position_is_faked_at_once_in_v1_13(release, old):
    one = unaided(release)
    one.ekf["horizontal_deadreckon_time_exceeded"] = False
    one.ekf["vel"][0] = 5.0
    asked(fake_pos_until_v1_15.control_fake_position, one, one.params)
    assert one.ekf["cs"]["fake_pos"] == old
    assert one.ekf["vel"][0] == (0.0 if old else 5.0)
    assert one.ekf["aid"]["fake_pos"]["timestamp_sample"] == (0 if old else START_US)


def test_the_fake_position_ends_with_its_interval_in_v1_13():
    one = unaided(V113, fake_pos=True, gnss_pos=True)
    one.ekf["aid"]["fake_pos"]["time_last_fuse"] = START_US - 100_000
    for number in range(2):
        set_time(one.ekf, START_US + 110_000 * number)
        asked(fake_pos_until_v1_15.control_fake_position, one, one.params)
        assert one.ekf["cs"]["fake_pos"] == (number == 0)


# time


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_what_happens_is_noted_by_the_newest_imu_sample_in_v1_13(release, old):
    one = flying(release)
    one.ekf["time_delayed_us"] = START_US + 90_000
    assert asked(timing.horizon_us, one) == START_US + (0 if old else 90_000)


def test_the_time_is_put_ahead_for_an_update(it, monkeypatch):
    seen = []
    for name in ("predict_state", "update_imu_bias_inhibit", "predict_covariance", "run_terrain_filter"):
        monkeypatch.setattr(estimator, name, lambda *_: None)
    monkeypatch.setattr(estimator, "control_fusion_modes", lambda ekf, _: seen.append(int(ekf["time_delayed_us"])))
    monkeypatch.setattr(estimator, "correct_output", lambda ekf, _: seen.append(int(ekf["time_delayed_us"])))
    it.ekf["time_latest_us"] = START_US + 90_000
    asked(estimator.update, it, it.params)
    assert seen == [START_US + 90_000, START_US]


@pytest.mark.parametrize(("mag_type", "requested"), [(0.0, True), (5.0, False)])
def test_a_first_fix_resets_the_yaw_where_there_is_a_magnetometer(sample, mag_type, requested):
    one = flying(V113)
    one.params["EKF2_MAG_TYPE"] = mag_type
    arrives(one, sample)
    assert one.ekf["mag_modes"]["yaw_reset_requested"] == requested


def test_flags_are_read_before_gnss_of_the_same_run_and_the_first_update_ends_an_interval():
    ensure_compiled(V113)
    mags, baros = [Arrival(run, 0) for run in range(5, 600, 20)], [Arrival(run, 0) for run in range(3, 600, 10)]
    fixes, flags = [Arrival(20, 0), Arrival(60, 0)], [Arrival(20, 0), Arrival(61, 0)]
    inputs = inputs_of({"mag": mags, "baro": baros, "gnss": fixes, "system_flags": flags}, [5_000] * 600)
    wanted = {"EKF2_AID_MASK": 1.0, "SENS_BARO_RATE": 100.0, "SENS_MAG_RATE": 100.0, "EKF2_MAG_TYPE": 0.0}
    values = complete({}, {}, releases.number_of_name(V113)) | wanted
    tables = flight_schedule(inputs, parameter_record(values, V113)[0], (), release=V113).tables
    assert tables.updates["run"][0] in tables.intervals["run"]
    early = [
        (int(one["run"]), int(one["sensor"])) for one in tables.actions if one["sensor"] in (GNSS_DATA, SYSTEM_FLAGS)
    ]
    seen = list(dict.fromkeys(one for one in early if one[0] in (20, 60, 61)))
    assert seen == [(20, SYSTEM_FLAGS), (20, GNSS_DATA), (60, GNSS_DATA), (61, SYSTEM_FLAGS)]
