"""What GNSS, height, fake aiding and the yaw estimator of older releases do otherwise than v1.16's.

Expected: the formulas and limits of docs/releases.md, worked out here.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import CONSTANTS_ONE_G, START_US, set_time
from tests.ekf2.releases.test_named_behaviours import Flying, asked, checks, flying

from fusetune.ekf2.feed.sensor_samples import GNSS_SAMPLE
from fusetune.ekf2.filter import height_control
from fusetune.ekf2.filter.aid_sources import zero_velocity_update
from fusetune.ekf2.filter.aid_sources.barometer import baro_height_control
from fusetune.ekf2.filter.aid_sources.fake_position import one_fake_position as fake_pos_until_v1_15
from fusetune.ekf2.filter.aid_sources.gnss import (
    arrived_gnss_control,
    gnss_arrival,
    gnss_height_control,
    gnss_position,
    gnss_velocity,
    gnss_yaw_control,
    gps_checks,
    gps_control,
    origin_by_checks,
    yaw_emergency,
)
from fusetune.ekf2.filter.common import conditions, dead_reckoning, imu_rates
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_BARO, HEIGHT_REF_GNSS
from fusetune.ekf2.filter.yaw_estimator import matrix_bank, yaw_bank
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import P_VE_VE, P_VN_VN, P_YAW_YAW
from fusetune.ekf2.numerics.rotations import euler_yaw

NEW, V115 = "v1.16", "v1.15"
OLD_AND_NEW = [(V115, True), (NEW, False)]


@pytest.fixture
def sample() -> np.record:
    """A good fix, at the limit of what starting asks for."""
    record = np.zeros(1, GNSS_SAMPLE).view(np.recarray)[0]
    record["lat_deg"], record["lon_deg"], record["alt"] = 47.4, 8.5, 488.0
    record["fix_type"], record["nsats"] = 3, 10
    record["hacc"], record["vacc"], record["sacc"], record["pdop"] = 1.0, 1.5, 0.2, 1.2
    return record


def give_gnss(it: Flying, fix: np.void) -> None:
    """A GNSS sample is due now."""
    gnss = it.ekf["sensors"]["gnss"]
    fix["time_us"] = it.ekf["time_delayed_us"]
    gnss["sample"], gnss["data_ready"], gnss["exists"] = fix, True, True
    gnss["newest_time_us"] = it.ekf["time_latest_us"]


def place(it: Flying, lat_deg: float, lon_deg: float, alt: float) -> None:
    origin = it.ekf["origin"]
    origin["lat_rad"], origin["lon_rad"], origin["alt"] = math.radians(lat_deg), math.radians(lon_deg), alt
    origin["lat_lon_valid"] = origin["valid"] = True


# GNSS checks


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_half_of_the_health_time_lets_a_sample_be_used_until_v1_15(release, old, sample):
    it = flying(release, EKF2_GPS_CHECK=1023.0, EKF2_REQ_GPS_H=10.0)
    # the first sample counts as failed; v1.16 uses what passes 1 s later
    assert checks(it, sample, 4.0) == (not old)
    assert checks(it, sample, 2.0)
    assert not it.ekf["gnss"]["checks_passed"]
    assert checks(it, sample, 5.0)
    assert it.ekf["gnss"]["checks_passed"]


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_the_climb_is_compared_with_the_filters_in_the_air_until_v1_15(release, old, sample):
    it = flying(release, EKF2_GPS_CHECK=1023.0, EKF2_REQ_VDRIFT=0.2)
    it.ekf["vel"][2] = 1.0
    sample["vel"] = 0.0, 0.0, 2.0
    for number in range(1, 4):
        sample["time_us"] = START_US + 2_000_000 * number
        gps_checks.run_gnss_checks(it.ekf, it.params, sample)
    # the first interval counts 10 s, so the filter begins with the difference of 1 m/s, beyond 0.2 m/s
    assert it.ekf["gnss"]["fail"]["vspeed"] == old
    if old:
        assert math.isclose(it.ekf["gnss"]["vel_d_filt"], 1.0)
        it.ekf["vel"][2] = 2.0
        sample["time_us"] += 2_000_000
        gps_checks.run_gnss_checks(it.ekf, it.params, sample)
        # 2 s of a time constant of 10 s
        assert math.isclose(it.ekf["gnss"]["vel_d_filt"], 0.8)


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_nothing_was_spoofed_or_too_fast_until_v1_15(release, old, sample):
    it = flying(release, EKF2_GPS_CHECK=1023.0)
    if not old:
        it.params["EKF2_VEL_LIM"] = 100.0
    it.ekf["vel"] = sample["vel"] = 200.0, 0.0, 0.0
    sample["spoofed"] = True
    sample["time_us"] = START_US
    assert bool(gps_checks.run_gnss_checks(it.ekf, it.params, sample)) == old


# the origin


@pytest.mark.parametrize("aided", [False, True])
def test_the_origin_is_where_the_filter_began(aided, sample):
    it = flying(V115)
    it.ekf["gnss"]["checks_passed"] = True
    it.ekf["local"]["north"], it.ekf["gpos_alt"] = 111.0, 10.0
    it.ekf["cs"]["opt_flow"] = aided
    asked(origin_by_checks.collect_gnss_sample, it, sample)
    origin = it.ekf["origin"]
    # 111 m are 111 / 6 371 000 rad on the sphere; the filter is 10 m above the origin
    expected = math.radians(47.4) - (111.0 / 6_371_000.0 if aided else 0.0)
    assert math.isclose(origin["lat_rad"], expected, rel_tol=0, abs_tol=1e-12)
    assert origin["alt"] == 478.0
    assert origin["valid"]
    assert it.ekf["local"]["north"] == 111.0
    assert it.ekf["gpos_alt"] == 10.0
    # 7.2921150e-5 rad/s times the cosine of the latitude
    assert math.isclose(it.ekf["earth_rate_ned"][0], 7.2921150e-5 * math.cos(math.radians(47.4)))


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_what_is_collected_changes_nothing_of_v1_16(release, old, sample):
    it = flying(release)
    it.ekf["gnss"]["checks_passed"] = True
    asked(origin_by_checks.collect_gnss_sample, it, sample)
    assert it.ekf["origin"]["valid"] == old


# velocity and position


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_gnss_counts_as_one_source_until_v1_15(release, old):
    it = flying(release)
    it.ekf["cs"]["gnss_vel"] = it.ekf["cs"]["gnss_pos"] = True
    assert conditions.get_number_of_active_horizontal_aiding_sources(it.ekf) == (1 if old else 2)
    assert conditions.get_number_of_active_vertical_velocity_aiding_sources(it.ekf) == 1


def test_position_is_judged_in_metres_of_the_origin(sample):
    it = flying(V115, EKF2_GPS_P_NOISE=0.5)
    gnss_position.update_gnss_position(it.ekf, it.params, sample)
    aid = it.ekf["aid"]["gnss_pos"]
    assert aid["timestamp_sample"] == 0, "there is no origin"
    place(it, 47.4, 8.5, 488.0)
    sample["lat_deg"] += math.degrees(10.0 / 6_371_000.0)
    sample["time_us"] = START_US
    it.ekf["local"]["north"], it.ekf["local"]["east"] = 12.0, 3.0
    gnss_position.update_gnss_position(it.ekf, it.params, sample)
    assert np.allclose(aid["observation"][:2], [10.0, 0.0], atol=1e-6)
    assert np.allclose(aid["innovation"][:2], [2.0, 3.0], atol=1e-6)
    assert np.allclose(aid["innovation_variance"][:2], 0.01 + 1.0**2)


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_no_axis_is_rejected_while_the_vertical_acceleration_is_bad(release, old, sample):
    it = flying(release, EKF2_GPS_V_NOISE=0.3, EKF2_GPS_V_GATE=5.0)
    it.ekf["fs"]["bad_acc_vertical"] = True
    sample["vel"] = 50.0, 0.0, -50.0
    sample["time_us"] = START_US
    gnss_velocity.update_gnss_velocity(it.ekf, it.params, sample)
    aid = it.ekf["aid"]["gnss_vel"]
    assert bool(aid["innovation_rejected"]) == (not old)
    if old:
        # (1.5 · 0.3)² + 0.01, five sigma of it
        assert math.isclose(aid["innovation"][2], 5.0 * math.sqrt(0.45**2 + 0.01), rel_tol=1e-6)
        assert aid["innovation"][0] == -50.0


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_levers_turn_by_the_measured_rate_until_v1_15(release, old):
    it = flying(release)
    it.ekf["imu_delayed"]["delta_ang"] = 0.01, 0.0, 0.0
    it.ekf["gyro_bias"][0] = 0.25
    assert math.isclose(asked(imu_rates.lever_rate, it)[0], 1.0 if old else 0.75)


def starting(it: Flying, fix: np.void, **flags: bool) -> None:
    """All that a start of GNSS asks for."""
    it.ekf["gnss"]["checks_passed"] = True
    it.ekf["cs"]["yaw_align"] = it.ekf["cs_prev"]["yaw_align"] = True
    for name, value in flags.items():
        it.ekf["cs"][name] = value
    place(it, 47.4, 8.5, 488.0)
    fix["vel"] = 1.0, 2.0, 0.5
    give_gnss(it, fix)
    gnss_velocity.update_gnss_velocity(it.ekf, it.params, fix)
    gnss_position.update_gnss_position(it.ekf, it.params, fix)


@pytest.mark.parametrize("control", [1, 4, 5])
def test_velocity_and_position_start_as_one(control, sample):
    it = flying(V115, EKF2_GPS_CTRL=float(control))
    it.ekf["local"]["north"] = 7.0
    starting(it, sample)
    asked(gps_control._control_velocity_and_position, it, it.params)
    assert it.ekf["cs"]["gnss_vel"]
    assert it.ekf["cs"]["gnss_pos"]
    assert it.ekf["vel"].tolist() == ([1.0, 2.0, 0.5] if control & 4 else [0.0, 0.0, 0.0])
    assert abs(it.ekf["local"]["north"] - (0.0 if control & 1 else 7.0)) < 1e-3


def test_a_start_beside_another_source_resets_the_position_alone(sample):
    it = flying(V115)
    it.ekf["local"]["north"] = 7.0
    starting(it, sample, opt_flow=True)
    asked(gps_control._control_velocity_and_position, it, it.params)
    assert it.ekf["vel"].tolist() == [0.0, 0.0, 0.0]
    assert abs(it.ekf["local"]["north"]) < 1e-3


@pytest.mark.parametrize(("seconds", "reset"), [(6.9, False), (7.1, True)])
def test_what_is_rejected_for_7_s_is_reset_after_it_was_judged(seconds, reset, sample):
    it = flying(V115)
    starting(it, sample, gnss_vel=True, gnss_pos=True)
    it.ekf["aid"]["gnss_vel"]["innovation_rejected"] = it.ekf["aid"]["gnss_pos"]["innovation_rejected"] = True
    set_time(it.ekf, START_US + int(seconds * 1e6))
    asked(gps_control._control_velocity_and_position, it, it.params)
    assert (it.ekf["vel"].tolist() == [1.0, 2.0, 0.5]) == reset
    assert not it.ekf["aid"]["gnss_vel"]["fused"]


def test_position_that_is_not_taken_still_times_out_until_v1_15(sample):
    for release, old in OLD_AND_NEW:
        it = flying(release, EKF2_GPS_CTRL=4.0)
        set_time(it.ekf, START_US + 15_000_000)
        it.ekf["time_last_hor_vel_fuse"] = it.ekf["time_delayed_us"]
        assert asked_plainly(gps_control.should_reset_gnss_fusion, it, it.params) == old


def asked_plainly(kernel, it, *arguments):
    """What a kernel that is no choice does; it asks choices itself."""
    return bool(kernel(it.ekf, *arguments))


# dead reckoning


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_velocity_stands_in_for_position_until_v1_15(release, old):
    it = flying(release)
    it.ekf["cs"]["ev_pos"] = True
    set_time(it.ekf, START_US + 2_000_000)
    it.ekf["time_last_hor_vel_fuse"] = it.ekf["time_delayed_us"]
    dead_reckoning.update_dead_reckoning_status(it.ekf, it.params)
    assert it.ekf["cs"]["inertial_dead_reckoning"] == (not old)


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_the_wind_makes_air_data_an_aid_until_v1_15(release, old):
    it = flying(release)
    it.ekf["cs"]["wind"] = True
    for source in ("airspeed", "sideslip"):
        it.ekf["aid"][source]["time_last_fuse"] = START_US
    it.ekf["time_last_hor_pos_fuse"] = it.ekf["time_last_hor_vel_fuse"] = 0
    dead_reckoning.update_dead_reckoning_status(it.ekf, it.params)
    assert it.ekf["cs"]["wind_dead_reckoning"] == old


# height


def height(it: Flying, fix: np.void, **flags: bool) -> np.void:
    place(it, 47.4, 8.5, 400.0)
    it.ekf["gnss"]["checks_passed"] = True
    for name, value in flags.items():
        it.ekf["cs"][name] = value
    give_gnss(it, fix)
    return it.ekf["aid"]["gnss_hgt"]


def test_gnss_height_counts_from_the_origin(sample):
    it = flying(V115, EKF2_HGT_REF=1.0)
    aid = height(it, sample)
    gnss_height_control.control_gnss_height_fusion(it.ekf, it.params)
    assert aid["observation"][0] == -88.0
    assert aid["innovation"][0] == 78.0
    # it starts as the reference by a reset, which the innovation does not tell of
    assert it.ekf["gpos_alt"] == 88.0
    assert it.ekf["height_sensor_ref"] == HEIGHT_REF_GNSS
    assert not aid["fused"]


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_every_source_resets_a_height_that_fails_until_v1_15(release, old, sample):
    it = flying(release, EKF2_HGT_REF=0.0, EKF2_GPS_V_NOISE=0.3)
    it.ekf["height_sensor_ref"] = HEIGHT_REF_BARO
    it.ekf["gps_hgt_b_est"]["bias"] = 60.0 if old else 460.0
    sample["vel"] = 0.0, 0.0, 2.0
    aid = height(it, sample, gps_hgt=True, gnss_vel=True, gnss_pos=True)
    aid["time_last_fuse"] = START_US
    set_time(it.ekf, START_US + 5_100_000)
    sample["time_us"] = it.ekf["time_delayed_us"]
    it.ekf["sensors"]["gnss"]["sample"] = sample
    it.ekf["sensors"]["gnss"]["newest_time_us"] = it.ekf["time_latest_us"]
    it.params["EKF2_GPS_P_GATE"] = 1.0
    gnss_height_control.control_gnss_height_fusion(it.ekf, it.params)
    # 488 m above the sea are 88 m above the origin, 28 m less the bias
    assert it.ekf["gpos_alt"] == (28.0 if old else 10.0)
    assert it.ekf["vel"][2] == (2.0 if old else 0.0)
    if old:
        assert it.ekf["gps_hgt_b_est"]["bias"] == 60.0
        # max(1.5 · 0.2, 0.3)²
        assert math.isclose(it.ekf["P"][5, 5], 0.09, rel_tol=1e-6)
        assert it.ekf["cs"]["gps_hgt"]


def test_gnss_without_velocity_leaves_the_vertical_velocity_at_zero(sample):
    it = flying(V115, EKF2_GPS_CTRL=3.0)
    it.ekf["vel"][2] = 3.0
    asked_kernel = gnss_height_control.reset_vertical_velocity_to_gnss
    asked_kernel.py_func(it.ekf, it.params, sample)
    assert it.ekf["vel"][2] == 0.0
    assert it.ekf["P"][5, 5] == 10.0


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_baro_starts_where_the_filter_is_until_v1_15(release, old):
    it = flying(release, EKF2_HGT_REF=0.0, EKF2_BARO_NOISE=3.5)
    it.ekf["gpos_alt"] = 0.0
    it.ekf["baro"]["lpf"], it.ekf["baro_b_est"]["bias"] = 501.0, 500.0
    it.ekf["vertical_position_deadreckon_time_exceeded"] = True
    baro_height_control._start.py_func(it.ekf, it.params, 502.0, 3.5**2)
    assert it.ekf["gpos_alt"] == (1.0 if old else 502.0)
    assert it.ekf["baro_b_est"]["bias"] == (500.0 if old else 0.0)
    assert it.ekf["cs"]["baro_hgt"]
    assert it.ekf["height_sensor_ref"] == HEIGHT_REF_BARO
    assert bool(it.ekf["aid"]["baro_hgt"]["fused"]) == (not old)


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_baro_resets_height_and_velocity_whatever_the_reference(release, old):
    it = flying(release)
    it.ekf["height_sensor_ref"] = HEIGHT_REF_GNSS
    it.ekf["cs"]["baro_hgt"] = it.ekf["cs"]["gnss_vel"] = True
    it.ekf["baro"]["lpf"], it.ekf["baro_b_est"]["bias"], it.ekf["vel"][2] = 530.0, 500.0, 4.0
    it.ekf["aid"]["baro_hgt"]["innovation_rejected"] = True
    it.ekf["aid"]["baro_hgt"]["time_last_fuse"] = START_US + 1_000_000
    set_time(it.ekf, START_US + 5_100_000)
    baro_height_control._fuse_or_recover.py_func(it.ekf, it.params, 12.25)
    assert it.ekf["gpos_alt"] == (30.0 if old else 10.0)
    assert it.ekf["vel"][2] == (0.0 if old else 4.0)


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_a_faulty_barometer_stays_so_until_v1_15(release, old):
    it = flying(release)
    it.ekf["cs"]["baro_fault"] = True
    it.ekf["sensors"]["baro"]["sample"]["reset"] = True
    baro_height_control._filter_measurement.py_func(it.ekf, 500.0)
    assert it.ekf["cs"]["baro_fault"] == old


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_range_tells_a_height_or_a_distance(release, old):
    it = flying(release)
    it.ekf["aid"]["rng_hgt"]["innovation"][0] = 0.5
    assert asked(height_control._range_innovation, it) == (0.5 if old else -0.5)


@pytest.mark.parametrize(("release", "old"), OLD_AND_NEW)
def test_vertical_acceleration_is_doubted_for_10_s_until_v1_15(release, old):
    it = flying(release)
    it.ekf["fs"]["bad_acc_vertical"] = True
    it.ekf["time_bad_vert_accel"] = START_US
    set_time(it.ekf, START_US + 9_900_000)
    height_control.check_vertical_acceleration_health(it.ekf)
    assert it.ekf["fs"]["bad_acc_vertical"] == old
    set_time(it.ekf, START_US + 10_100_000)
    height_control.check_vertical_acceleration_health(it.ekf)
    assert not it.ekf["fs"]["bad_acc_vertical"]


# fake position


def unaided(release: str, **flags: bool) -> Flying:
    it = flying(release, EKF2_NOAID_NOISE=10.0)
    for name, value in flags.items():
        it.ekf["cs"][name] = value
    it.ekf["horizontal_deadreckon_time_exceeded"] = True
    return it


@pytest.mark.parametrize(
    ("flags", "control", "tilt_var", "wanted"),
    [
        ({"vehicle_at_rest": True}, 7.0, 1e-4, True),
        ({}, 3.0, 1e-4, False),
        # (3 deg)² = 0.00274 rad²
        ({}, 3.0, 0.0028, True),
        ({}, 7.0, 0.0028, False),
    ],
)
def test_the_position_is_faked_at_rest_or_while_the_tilt_is_unknown(flags, control, tilt_var, wanted):
    it = unaided(V115, **flags)
    it.params["EKF2_IMU_CTRL"] = control
    it.ekf["P"][0, 0], it.ekf["P"][1, 1] = tilt_var, 0.0
    it.ekf["vel"][0] = 5.0
    fake_pos_until_v1_15.control_fake_position(it.ekf, it.params)
    assert it.ekf["cs"]["fake_pos"] == wanted
    assert not it.ekf["cs"]["valid_fake_pos"]
    assert it.ekf["vel"][0] == (0.0 if wanted else 5.0)


def test_a_fake_position_is_fused_unless_extreme():
    it = unaided(V115, fake_pos=True, vehicle_at_rest=True, in_air=False)
    it.ekf["local"]["north"] = 0.02
    set_time(it.ekf, START_US + 300_000)
    it.ekf["aid"]["fake_pos"]["time_last_fuse"] = START_US
    fake_pos_until_v1_15.control_fake_position(it.ekf, it.params)
    aid = it.ekf["aid"]["fake_pos"]
    # at rest 0.01 m of noise beside 0.01 m²
    assert aid["fused"]
    assert math.isclose(aid["innovation_variance"][0], 0.01 + 0.01**2)
    assert it.ekf["time_last_hor_pos_fuse"] == START_US + 300_000


# GNSS yaw


def heading(it: Flying, fix: np.void) -> None:
    it.params["EKF2_GPS_CTRL"] = 15.0
    it.ekf["gnss"]["checks_passed"] = True
    fix["yaw"], fix["yaw_offset"], fix["yaw_acc"] = 0.5, 0.0, 0.1
    give_gnss(it, fix)
    it.ekf["sensors"]["gnss"]["newest_yaw_time_us"] = it.ekf["time_latest_us"]
    it.ekf["gnss"]["intermittent"] = False


def test_a_gnss_heading_starts_with_a_reset_until_v1_15(sample):
    it = flying(V115)
    heading(it, sample)
    it.ekf["cs"]["yaw_align"] = it.ekf["cs"]["gnss_pos"] = True
    gnss_yaw_control.control_gnss_yaw_fusion.of(V115)(it.ekf, it.params, sample)
    assert it.ekf["cs"]["gnss_yaw"]
    assert math.isclose(euler_yaw(it.ekf["R_to_earth"]), 0.5)
    assert it.ekf["gnss_yaw_retries"]["resets_left"] == 1


def test_a_gnss_heading_that_fails_is_tried_once_more_in_flight(sample):
    it = flying(V115)
    heading(it, sample)
    it.ekf["cs"]["gnss_yaw"] = it.ekf["cs"]["yaw_align"] = True
    it.ekf["gnss_yaw_retries"]["resets_left"] = 1
    aid = it.ekf["aid"]["gnss_yaw"]
    for expected_left, stopped in ((0, False), (0, True)):
        aid["innovation_rejected"] = True
        aid["time_last_fuse"] = it.ekf["time_delayed_us"]
        set_time(it.ekf, int(it.ekf["time_delayed_us"]) + 7_100_000)
        asked(gnss_yaw_control._continue_gnss_yaw, it, it.params, sample, True)
        assert it.ekf["gnss_yaw_retries"]["resets_left"] == expected_left
        assert it.ekf["cs"]["gnss_yaw_fault"] == stopped
        assert it.ekf["cs"]["gnss_yaw"] == (not stopped)
        assert math.isclose(euler_yaw(it.ekf["R_to_earth"]), 0.5)


@pytest.mark.parametrize("in_air", [False, True])
def test_stopping_a_heading_on_the_ground_gives_the_alignment_up(in_air):
    it = flying(V115)
    it.ekf["cs"]["gnss_yaw"] = it.ekf["cs"]["yaw_align"] = True
    it.ekf["cs"]["in_air"] = in_air
    asked(gnss_yaw_control.stop_gnss_yaw_fusion, it)
    assert it.ekf["cs"]["yaw_align"] == in_air


# yaw estimator


def bank(it: Flying) -> np.ndarray:
    """Matrices of all models, (models, 3, 3)."""
    return np.moveaxis(it.ekf["yaw_matrices"]["R"], 2, 0)


def imu(it: Flying, delta_ang: tuple[float, ...], delta_vel: tuple[float, ...]) -> np.void:
    it.ekf["imu_delayed"]["delta_ang"], it.ekf["imu_delayed"]["delta_vel"] = delta_ang, delta_vel
    return it.ekf["imu_delayed"]


@pytest.fixture
def levelled() -> Flying:
    it = flying(V115)
    sample_ = imu(it, (0.0, 0.0, 0.0), (0.0, 0.0, -CONSTANTS_ONE_G * 0.01))
    it.ekf["gsf"]["accel_lpf"] = 0.0, 0.0, -CONSTANTS_ONE_G
    yaw_bank.predict_yaw_bank(it.ekf, sample_, True)
    assert it.ekf["gsf"]["tilt_aligned"]
    return it


def test_matrices_turn_to_first_order_and_keep_their_rows_nearly_of_unit_length(levelled):
    g = np.array([0.02, -0.03, 0.05])
    before = bank(levelled)[0].copy()
    levelled.ekf["gsf"]["accel_lpf"] = 0.0, 0.0, 0.0
    yaw_bank.predict_yaw_bank(levelled.ekf, imu(levelled, tuple(g), (0.0, 0.0, 0.0)), True)
    turned = before + np.cross(before, g)
    squared = (turned**2).sum(axis=1, keepdims=True)
    assert np.allclose(bank(levelled)[0], turned * (1.5 - 0.5 * squared), atol=1e-15)


def test_the_bank_levels_north_below_the_nose(levelled):
    pitched = flying(V115)
    c, s = math.cos(0.3), math.sin(0.3)
    force = (CONSTANTS_ONE_G * s * 0.01, 0.0, -CONSTANTS_ONE_G * c * 0.01)
    matrix_bank.level_matrices(pitched.ekf, imu(pitched, (0.0, 0.0, 0.0), force))
    # a nose 0.3 rad up: the rotation about the pitch axis
    assert np.allclose(bank(pitched)[4], [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    assert np.allclose(bank(levelled)[0], np.eye(3))


def started(it: Flying, *velocity: float) -> np.void:
    yaw_bank.fuse_yaw_bank_velocity(it.ekf, *velocity, 0.5, True)
    assert it.ekf["gsf"]["vel_fuse_started"]
    return it.ekf["gsf"]


def test_the_bank_starts_with_its_yaws_spread(levelled):
    gsf = started(levelled, 3.0, 4.0)
    yaws = [-math.pi + (number + 0.5) * 2.0 * math.pi / 5.0 for number in range(5)]
    assert np.allclose([euler_yaw(R) for R in bank(levelled)[:5]], yaws)
    assert np.allclose(gsf["P"][P_VN_VN, :5], 0.25)
    assert np.allclose(gsf["P"][P_YAW_YAW, :5], (math.pi / 5.0) ** 2)


def test_a_far_innovation_corrects_as_one_of_5_sigma_but_weighs_in_full(levelled):
    gsf = started(levelled, 0.0, 0.0)
    gsf["weight"][:] = 0.6, 0.1, 0.1, 0.1, 0.1
    # 6 σ of the innovation's variance of 0.25 + 0.25 for four models; the first agrees
    far = 6.0 * math.sqrt(0.5)
    gsf["x"][0, 0] = far
    yaw_bank.fuse_yaw_bank_velocity(levelled.ekf, far, 0.0, 0.5, True)
    # half of a correction that is shortened from 6 σ to 5 σ
    assert math.isclose(gsf["x"][0, 1], 0.5 * far * 5.0 / 6.0, rel_tol=1e-6)
    assert math.isclose(gsf["nis"][1], 36.0, rel_tol=1e-6)
    # density of the first: 1/(2π·0.5), weights of the others at least 1e-5 before they are normalised
    first = 0.6 / (2.0 * math.pi * 0.5)
    assert np.allclose(gsf["weight"], [first / (first + 4e-5), *[1e-5 / (first + 4e-5)] * 4], rtol=1e-5)


def test_models_that_all_weigh_nothing_start_anew(levelled):
    gsf = started(levelled, 0.0, 0.0)
    yaw_bank.fuse_yaw_bank_velocity(levelled.ekf, 20.0, 0.0, 0.5, True)
    assert not gsf["vel_fuse_started"]
    started(levelled, 20.0, 0.0)
    assert np.allclose(gsf["weight"], 0.2)


@pytest.mark.parametrize("in_air", [False, True])
def test_accelerations_are_twice_as_uncertain_on_the_ground(levelled, in_air):
    gsf = started(levelled, 0.0, 0.0)
    yaw_bank.predict_yaw_bank(levelled.ekf, imu(levelled, (0.0, 0.0, 0.0), (0.0, 0.0, -0.01)), in_air)
    expected = 0.25 + ((2.0 if in_air else 4.0) * 0.01) ** 2
    assert np.allclose(gsf["P"][P_VN_VN, :5], expected, rtol=1e-6)
    assert np.allclose(gsf["P"][P_VE_VE, :5], expected, rtol=1e-6)


# v1.14: GNSS is judged as it arrives


V114 = "v1.14"


def arrives(it: Flying, fix: np.record, slot: int = 0) -> None:
    gnss_arrival.look_at_arrived_gnss(it.ekf, it.params, fix, slot)


def test_a_message_has_whole_numbers_of_1e_7_degrees_and_millimetres(sample):
    sample["lat_deg"], sample["lon_deg"], sample["alt"] = 47.39776123456, 8.54556149999, 487.5475769
    gnss_arrival.round_to_message.py_func(sample)
    assert (sample["lat_deg"], sample["lon_deg"]) == (47.3977612, 8.5455615)
    assert sample["alt"] == float(np.float32(487548.0) * np.float32(1e-3))


def test_the_origin_is_placed_by_the_sample_that_arrives(sample):
    it = flying(V114, EKF2_REQ_GPS_H=10.0)
    it.ekf["filter_initialised"] = True
    it.ekf["gpos_alt"] = 0.0
    arrives(it, sample)
    assert not it.ekf["gnss"]["checks_passed"]
    assert not it.ekf["origin"]["valid"]
    # a rough fix tells the rotation of the Earth nevertheless
    assert math.isclose(it.ekf["earth_rate_ned"][0], 7.2921150e-5 * math.cos(math.radians(47.4)))
    set_time(it.ekf, START_US + 10_100_000)
    arrives(it, sample)
    assert it.ekf["origin"]["valid"]
    assert math.isclose(it.ekf["origin"]["alt"], 488.0, abs_tol=1e-4)


def test_checks_that_fail_take_the_result_back_at_once(sample):
    it = flying(V114, EKF2_REQ_GPS_H=10.0, EKF2_GPS_CHECK=1.0)
    arrives(it, sample)
    set_time(it.ekf, START_US + 10_100_000)
    arrives(it, sample)
    assert it.ekf["gnss"]["checks_passed"]
    sample["nsats"] = 3
    arrives(it, sample)
    assert not it.ekf["gnss"]["checks_passed"]


def test_a_position_that_arrives_before_the_origin_is_zero_for_good(sample):
    it = flying(V114)
    sample["lat_deg"] += math.degrees(10.0 / 6_371_000.0)
    arrives(it, sample, slot=3)
    place(it, 47.4, 8.5, 488.0)
    arrives(it, sample, slot=4)
    for slot, north in ((3, 0.0), (4, 10.0)):
        gnss_arrival.recall_arrived_gnss(it.ekf, slot)
        # 1e-7 degrees are 11 mm
        assert math.isclose(it.ekf["gnss_arrivals"]["north"], north, abs_tol=0.006)


@pytest.mark.parametrize(
    ("seconds", "trusted", "distrusted"),
    [((4.9, 6.0), False, True), ((5.1, 4.9), True, False), ((5.1, 5.1), True, True)],
)
def test_gnss_is_trusted_by_checks_of_5_s(seconds, trusted, distrusted):
    it = flying(V114)
    since_failure, since_pass = seconds
    it.ekf["gnss"]["last_fail_us"] = START_US - round(since_failure * 1e6)
    it.ekf["gnss"]["last_pass_us"] = START_US - round(since_pass * 1e6)
    assert gnss_arrival.is_gnss_trusted(it.ekf) == trusted
    assert gnss_arrival.is_gnss_distrusted(it.ekf) == distrusted
    assert asked(gnss_height_control._is_trusted, it) == (trusted and not distrusted)


@pytest.mark.parametrize("other", [False, True])
def test_a_distrusted_gnss_goes_on_where_it_is_the_only_aid(other, sample):
    it = flying(V114)
    starting(it, sample, gnss_vel=True, gnss_pos=True, opt_flow=other)
    it.ekf["gnss"]["last_pass_us"] = START_US - 6_000_000
    arrived_gnss_control._control_with_sample.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["gnss_pos"] == (not other)


def test_without_magnetometer_the_yaw_estimator_aligns_the_yaw(sample):
    it = flying(V114, EKF2_MAG_TYPE=5.0)
    starting(it, sample)
    it.ekf["cs"]["yaw_align"] = False
    it.ekf["gnss"]["last_fail_us"] = START_US - 6_000_000
    it.ekf["gnss"]["last_pass_us"] = START_US
    gsf = it.ekf["gsf"]
    gsf["vel_fuse_started"], gsf["yaw"], gsf["yaw_variance"] = True, 0.7, 0.01
    arrived_gnss_control._control_with_sample.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["yaw_align"]
    assert math.isclose(euler_yaw(it.ekf["R_to_earth"]), 0.7)
    assert it.ekf["vel"].tolist() == [1.0, 2.0, 0.5]
    # GNSS itself starts with the next sample
    assert not it.ekf["cs"]["gnss_pos"]


def test_a_yaw_put_right_blames_one_of_magnetometer_and_gnss():
    it = flying(V114)
    gsf = it.ekf["gsf"]
    gsf["vel_fuse_started"], gsf["yaw"], gsf["yaw_variance"] = True, 0.7, 0.01
    it.ekf["cs"]["mag_3d"] = it.ekf["cs"]["gnss_yaw"] = it.ekf["cs"]["ev_yaw"] = True
    assert asked(yaw_emergency.reset_yaw_to_ekf_gsf, it, it.params)
    assert it.ekf["cs"]["mag_fault"]
    assert not it.ekf["cs"]["gnss_yaw_fault"]
    assert it.ekf["gnss_arrivals"]["inhibits_ev_yaw"]


@pytest.mark.parametrize(("seconds", "other", "stopped"), [(2.0, False, False), (2.0, True, True), (10.1, False, True)])
def test_gnss_is_waited_for_10_s_or_with_others_1_s(seconds, other, stopped):
    it = flying(V114)
    it.ekf["cs"]["gnss_vel"] = it.ekf["cs"]["gnss_pos"] = True
    it.ekf["cs"]["opt_flow"] = other
    it.ekf["sensors"]["gnss"]["exists"] = True
    it.ekf["sensors"]["gnss"]["newest_time_us"] = START_US
    set_time(it.ekf, START_US + round(seconds * 1e6))
    arrived_gnss_control.control_arrived_gnss_fusion(it.ekf, it.params)
    assert it.ekf["cs"]["gnss_pos"] == (not stopped)


@pytest.fixture
def in_air() -> Flying:
    it = flying(V114)
    matrix_bank.run_matrix_bank_in_air(it.ekf, imu(it, (0.0, 0.0, 0.0), (0.0, 0.0, -CONSTANTS_ONE_G * 0.01)), True)
    assert it.ekf["gsf"]["tilt_aligned"]
    return it


def test_the_bank_of_v1_14_starts_in_the_air_with_the_gyro_bias_of_the_filter(in_air):
    # a bias is kept as increment over 10 ms
    in_air.ekf["quaternion"]["mean_dt"], in_air.ekf["gyro_bias"][2] = 0.01, 0.0003
    gsf, still = in_air.ekf["gsf"], imu(in_air, (0.0, 0.0, 0.0), (0.0, 0.0, -CONSTANTS_ONE_G * 0.01))
    matrix_bank.tell_matrix_bank_velocity(in_air.ekf, 3.0, 4.0, 0.5)
    matrix_bank.run_matrix_bank_in_air(in_air.ekf, still, False)
    assert not gsf["vel_fuse_started"]
    matrix_bank.tell_matrix_bank_velocity(in_air.ekf, 3.0, 4.0, 0.5)
    matrix_bank.run_matrix_bank_in_air(in_air.ekf, still, True)
    assert gsf["vel_fuse_started"]
    assert math.isclose(gsf["gyro_bias"][2, 4], 0.03)
    matrix_bank.run_matrix_bank_in_air(in_air.ekf, still, False)
    assert not gsf["vel_fuse_started"]


def test_the_yaw_of_v1_14_follows_every_sample(in_air):
    gsf = in_air.ekf["gsf"]
    matrix_bank.tell_matrix_bank_velocity(in_air.ekf, 3.0, 4.0, 0.5)
    matrix_bank.run_matrix_bank_in_air(in_air.ekf, in_air.ekf["imu_delayed"], True)
    gsf["weight"][:] = 0.0, 0.0, 1.0, 0.0, 0.0
    gsf["gyro_bias"][:] = 0.0
    matrix_bank.run_matrix_bank_in_air(in_air.ekf, imu(in_air, (0.0, 0.0, 0.01), (0.0, 0.0, -0.0981)), True)
    # the third model started at zero, and its variance grows by (0.1 · 0.01)² alone
    assert math.isclose(gsf["yaw"], 0.01, rel_tol=1e-3)
    assert math.isclose(gsf["yaw_variance"], (math.pi / 5.0) ** 2 + 1e-6, rel_tol=1e-9)


@pytest.mark.parametrize(("noise", "sigma"), [(0.5, 10.0), (20.0, 20.0)])
def test_the_fake_position_of_v1_14_needs_no_reason(noise, sigma):
    it = unaided(V114)
    it.params["EKF2_GPS_P_NOISE"] = noise
    fake_pos_until_v1_15.control_fake_position(it.ekf, it.params)
    assert it.ekf["cs"]["fake_pos"]
    assert math.isclose(it.ekf["aid"]["fake_pos"]["observation_variance"][0], sigma**2)


@pytest.mark.parametrize(("release", "at_first"), [("v1.13", True), ("v1.14", True), (V115, False), (NEW, False)])
def test_zero_velocity_is_found_for_all_axes_before_one_is_fused_until_v1_14(release, at_first, monkeypatch):
    it = flying(release)
    it.ekf["vel"][:] = 0.3, 0.2, 0.1
    innovations = []

    def fuse(ekf, params, innovation, *others):
        innovations.append(float(innovation))
        ekf["vel"][:] = 0.0

    monkeypatch.setattr(zero_velocity_update, "fuse_direct_state", fuse)
    asked(zero_velocity_update._fuse_zero, it, it.params, (1.0, 1.0, 1.0), 0.04)
    assert innovations == pytest.approx([0.3, 0.2, 0.1] if at_first else [0.3, 0.0, 0.0])
