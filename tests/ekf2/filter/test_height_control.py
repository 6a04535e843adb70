"""Fallback of the height reference and health of the vertical acceleration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import at_time, make_estimator, make_parameters

from fusetune.ekf2.filter.common.height_reference import (
    HEIGHT_REF_BARO,
    HEIGHT_REF_EV,
    HEIGHT_REF_GNSS,
    HEIGHT_REF_RANGE,
    HEIGHT_REF_UNKNOWN,
)
from fusetune.ekf2.filter.height_control import (
    FALLING_LIKELY,
    FALLING_POSSIBLE,
    FALLING_UNLIKELY,
    check_height_sensor_ref_fallback,
    check_vertical_acceleration_health,
    estimate_inertial_nav_falling_likelihood,
)

FLAG_OF_REF = {
    HEIGHT_REF_BARO: "baro_hgt",
    HEIGHT_REF_GNSS: "gps_hgt",
    HEIGHT_REF_RANGE: "rng_hgt",
    HEIGHT_REF_EV: "ev_hgt",
}


@pytest.mark.parametrize(
    ("wanted", "order"),
    [
        (HEIGHT_REF_BARO, (HEIGHT_REF_BARO, HEIGHT_REF_GNSS, HEIGHT_REF_EV, HEIGHT_REF_RANGE)),
        (HEIGHT_REF_GNSS, (HEIGHT_REF_GNSS, HEIGHT_REF_BARO, HEIGHT_REF_EV, HEIGHT_REF_RANGE)),
        (HEIGHT_REF_RANGE, (HEIGHT_REF_RANGE, HEIGHT_REF_EV, HEIGHT_REF_BARO, HEIGHT_REF_GNSS)),
        (HEIGHT_REF_EV, (HEIGHT_REF_EV, HEIGHT_REF_RANGE, HEIGHT_REF_BARO, HEIGHT_REF_GNSS)),
    ],
)
def test_fallback_order(wanted, order):
    params = make_parameters(EKF2_HGT_REF=wanted)
    for first in range(4):
        ekf = make_estimator()
        for source in order[first:]:
            ekf["cs"][FLAG_OF_REF[source]] = True
        check_height_sensor_ref_fallback(ekf, params)
        assert ekf["height_sensor_ref"] == order[first]


def test_a_running_reference_stays_and_none_stays_unknown():
    params = make_parameters(EKF2_HGT_REF=HEIGHT_REF_BARO)
    ekf = make_estimator()
    check_height_sensor_ref_fallback(ekf, params)
    assert ekf["height_sensor_ref"] == HEIGHT_REF_UNKNOWN
    ekf["height_sensor_ref"] = HEIGHT_REF_EV
    ekf["cs"]["baro_hgt"] = True
    check_height_sensor_ref_fallback(ekf, params)
    assert ekf["height_sensor_ref"] == HEIGHT_REF_EV


def _observe(ekf: np.void, flag: str, source: str, normalised: float, axis: int = 0) -> None:
    ekf["cs"][flag] = True
    ekf["aid"][source]["innovation_variance"][axis] = 4.0
    ekf["aid"][source]["innovation"][axis] = 2.0 * normalised


def test_falling_is_unlikely_without_a_large_innovation():
    ekf = make_estimator()
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_UNLIKELY
    _observe(ekf, "baro_hgt", "baro_hgt", 2.999)
    _observe(ekf, "gps_hgt", "gnss_hgt", 2.999)
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_UNLIKELY


def test_falling_is_possible_by_one_kind_of_reference():
    ekf = make_estimator()
    _observe(ekf, "gps_hgt", "gnss_hgt", 3.001)
    _observe(ekf, "gnss_vel", "gnss_vel", 5.0, axis=2)
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_POSSIBLE


@pytest.mark.parametrize(("other", "likelihood"), [(0.9, FALLING_POSSIBLE), (1.1, FALLING_LIKELY)])
def test_falling_is_likely_by_two_kinds_of_reference(other, likelihood):
    ekf = make_estimator()
    _observe(ekf, "baro_hgt", "baro_hgt", 3.1)
    _observe(ekf, "gnss_vel", "gnss_vel", other, axis=2)
    assert estimate_inertial_nav_falling_likelihood(ekf) == likelihood


def test_rising_is_not_falling_and_range_counts_reversed():
    ekf = make_estimator()
    _observe(ekf, "baro_hgt", "baro_hgt", -8.0)
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_UNLIKELY
    _observe(ekf, "rng_hgt", "rng_hgt", 8.0)
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_UNLIKELY
    _observe(ekf, "rng_hgt", "rng_hgt", -8.0)
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_POSSIBLE


def test_sources_not_in_use_do_not_count():
    ekf = make_estimator()
    _observe(ekf, "baro_hgt", "baro_hgt", 5.0)
    _observe(ekf, "gps_hgt", "gnss_hgt", 5.0)
    ekf["cs"]["gps_hgt"] = False
    assert estimate_inertial_nav_falling_likelihood(ekf) == FALLING_POSSIBLE


def test_bad_acceleration_persists_for_three_seconds():
    ekf = make_estimator()
    _observe(ekf, "baro_hgt", "baro_hgt", 4.0)
    _observe(ekf, "gps_hgt", "gnss_hgt", 4.0)
    check_vertical_acceleration_health(ekf)
    assert ekf["fs"]["bad_acc_vertical"]
    assert ekf["time_bad_vert_accel"] == ekf["time_delayed_us"]
    assert ekf["time_good_vert_accel"] == 0
    _observe(ekf, "gps_hgt", "gnss_hgt", 0.0)
    for later, bad in ((2.99, True), (3.01, False)):
        at_time(ekf, 100.0 + later)
        check_vertical_acceleration_health(ekf)
        assert ekf["fs"]["bad_acc_vertical"] == bad
        assert ekf["time_good_vert_accel"] == ekf["time_delayed_us"]


def _clip(ekf: np.void, axes: tuple[int, ...], updates: int) -> None:
    ekf["imu_delayed"]["delta_vel_clipping"][:] = [axis in axes for axis in range(3)]
    for _ in range(updates):
        check_vertical_acceleration_health(ekf)


def test_clipping_of_one_axis_is_critical_after_a_second():
    ekf = make_estimator()
    limit = math.floor(1.0 / ekf["dt_ekf_avg"])
    _clip(ekf, (0,), limit - 1)
    assert not ekf["fs"]["bad_acc_clipping"]
    _clip(ekf, (0,), 1)
    assert ekf["fs"]["bad_acc_clipping"]
    _clip(ekf, (0,), 50)
    assert ekf["clip_counter"][0] == limit
    _clip(ekf, (), 1)
    assert not ekf["fs"]["bad_acc_clipping"]
    _clip(ekf, (), 2 * limit)
    assert ekf["clip_counter"][0] == 0


def test_clipping_of_all_axes_is_bad_after_half_a_second():
    ekf = make_estimator()
    _clip(ekf, (0, 1, 2), 49)
    assert not ekf["fs"]["bad_acc_clipping"]
    _clip(ekf, (0, 1, 2), 1)
    assert ekf["fs"]["bad_acc_clipping"]


def test_frequent_vertical_clipping_makes_a_possible_fall_bad():
    ekf = make_estimator()
    _observe(ekf, "baro_hgt", "baro_hgt", 4.0)
    _clip(ekf, (2,), 49)
    assert not ekf["fs"]["bad_acc_vertical"]
    _clip(ekf, (2,), 1)
    assert ekf["fs"]["bad_acc_vertical"]
    assert not ekf["fs"]["bad_acc_clipping"]
