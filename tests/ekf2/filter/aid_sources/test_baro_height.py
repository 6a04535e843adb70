"""Barometric height: filter, bias, static pressure, ground effect, start, reset and fault."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import at_time, make_estimator, make_parameters, set_attitude

from fusetune.ekf2.filter.aid_sources.barometer.baro_height_control import control_baro_height_fusion
from fusetune.ekf2.filter.aid_sources.barometer.ground_effect import apply_ground_effect_deadzone, update_ground_effect
from fusetune.ekf2.filter.aid_sources.barometer.static_pressure import (
    compensate_baro_for_dynamic_pressure,
    static_pressure_height_correction,
)
from fusetune.ekf2.filter.common.core_memory import HEIGHT_REF_BARO, HEIGHT_REF_GNSS, HEIGHT_REF_UNKNOWN

BARO, GNSS = 0, 1
G = 9.80665


def _feed(ekf: np.void, params: np.void, height: float, samples: int = 1, reset: bool = False) -> None:
    """Advance by 50 ms and one sample, `samples` times; the vertical acceleration is good."""
    for _ in range(samples):
        at_time(ekf, ekf["time_delayed_us"] * 1e-6 + 0.05)
        ekf["time_good_vert_accel"] = ekf["time_delayed_us"]
        ekf["baro_sample"]["time_us"] = ekf["time_delayed_us"] - 4_000
        ekf["baro_sample"]["hgt"] = height
        ekf["baro_sample"]["reset"] = reset
        ekf["baro_data_ready"] = True
        ekf["baro_newest_time_us"] = ekf["time_latest_us"]
        control_baro_height_fusion(ekf, params)


def _started(hgt_ref: int = GNSS) -> tuple[np.void, np.void]:
    ekf, params = make_estimator(), make_parameters(EKF2_HGT_REF=hgt_ref)
    ekf["time_last_hgt_fuse"] = ekf["time_delayed_us"]
    _feed(ekf, params, 500.0, samples=21)
    return ekf, params


def test_filter_follows_its_closed_form():
    ekf, params = make_estimator(), make_parameters()
    _feed(ekf, params, 100.0)
    _feed(ekf, params, 200.0, samples=9)
    assert ekf["baro"]["lpf"] == pytest.approx(200.0 - 100.0 * 0.9**9)
    _feed(ekf, params, 50.0, reset=True)
    assert ekf["baro"]["lpf"] == 50.0
    assert ekf["baro"]["counter"] == 1


def test_first_samples_set_the_bias_and_are_judged_with_the_state_variance():
    """PX4's replays start with innovation 0 and variance 112.25 = 3.5² + 100 while fake height holds the state."""
    ekf, params = make_estimator(), make_parameters(EKF2_BARO_NOISE=3.5)
    ekf["P"][8, 8] = 100.0
    ekf["gpos_alt"] = 3.0
    _feed(ekf, params, 480.0)
    assert ekf["baro_b_est"]["bias"] == 477.0
    aid = ekf["aid"]["baro_hgt"]
    assert aid["observation"][0] == -3.0
    assert aid["innovation"][0] == 0.0
    assert aid["innovation_variance"][0] == 112.25
    assert not ekf["cs"]["baro_hgt"]


def test_starts_after_one_buffer_of_samples_with_the_height_kept():
    ekf, params = make_estimator(), make_parameters(EKF2_HGT_REF=GNSS)
    _feed(ekf, params, 500.0, samples=20)
    assert not ekf["cs"]["baro_hgt"]
    _feed(ekf, params, 500.0)
    assert ekf["cs"]["baro_hgt"]
    assert ekf["gpos_alt"] == 0.0
    assert ekf["baro_b_est"]["bias"] == pytest.approx(500.0)
    assert ekf["baro_b_est"]["fusion_active"]
    assert ekf["height_sensor_ref"] == HEIGHT_REF_UNKNOWN


def test_as_reference_it_sets_altitude_and_origin():
    ekf, _ = _started(BARO)
    assert ekf["height_sensor_ref"] == HEIGHT_REF_BARO
    assert ekf["gpos_alt"] == pytest.approx(500.0, abs=1e-4)
    assert ekf["origin"]["alt"] == pytest.approx(500.0, abs=1e-4)
    assert ekf["P"][8, 8] == pytest.approx(3.5**2)
    assert ekf["baro_b_est"]["bias"] == 0.0
    assert ekf["events"]["reset_hgt_to_baro"]


def test_fusion_pulls_towards_the_measurement():
    ekf, params = _started(BARO)
    ekf["P"][...] = np.eye(24)
    _feed(ekf, params, 510.0)
    assert ekf["aid"]["baro_hgt"]["fused"]
    # scalar Kalman update: gain 1 / (1 + 3.5²)
    assert ekf["gpos_alt"] == pytest.approx(500.0 + 10.0 / (1.0 + 3.5**2), abs=1e-4)
    assert ekf["time_last_hgt_fuse"] == ekf["time_delayed_us"]


@pytest.mark.parametrize(
    ("innovation", "expected"), [(3.0, 3.0), (0.0, 0.0), (-1.0, 0.0), (-3.999, 0.0), (-4.0, 0.0), (-7.0, -3.0)]
)
def test_ground_effect_deadzone(innovation, expected):
    assert apply_ground_effect_deadzone(innovation, 4.0) == pytest.approx(expected)


def test_ground_effect_deadzone_applies_to_the_fused_innovation():
    ekf, params = _started(BARO)
    ekf["cs"]["gnd_effect"] = True
    _feed(ekf, params, 497.0)
    # the barometer reads low, 3 m of which ground effect may explain
    assert ekf["aid"]["baro_hgt"]["innovation"][0] == 0.0
    _feed(ekf, params, 503.0)
    assert ekf["aid"]["baro_hgt"]["innovation"][0] == pytest.approx(3.0, abs=0.01)


def test_ground_effect_ends_with_height_or_time():
    ekf, params = make_estimator(), make_parameters(EKF2_GND_MAX_HGT=0.5)
    ekf["cs"]["in_air"] = True
    ekf["terrain_valid"] = True
    for hagl, expected in ((0.49, True), (0.51, False)):
        ekf["gpos_alt"] = hagl
        update_ground_effect(ekf, params)
        assert ekf["cs"]["gnd_effect"] == expected

    ekf["terrain_valid"] = False
    ekf["cs"]["gnd_effect"] = True
    ekf["time_last_gnd_effect_on"] = ekf["time_delayed_us"]
    for later, expected in ((9.9, True), (10.1, False)):
        at_time(ekf, 100.0 + later)
        update_ground_effect(ekf, params)
        assert ekf["cs"]["gnd_effect"] == expected

    for grounded, fixed_wing in ((True, False), (False, True)):
        ekf["cs"]["gnd_effect"] = True
        ekf["cs"]["in_air"] = not grounded
        ekf["cs"]["fixed_wing"] = fixed_wing
        update_ground_effect(ekf, params)
        assert not ekf["cs"]["gnd_effect"]


@pytest.mark.parametrize(
    ("airspeed", "expected"),
    [
        ((10.0, 0.0, 0.0), 0.5 * 0.2 * 100.0 / G),
        ((-10.0, 0.0, 0.0), 0.5 * -0.1 * 100.0 / G),
        ((0.0, 5.0, 0.0), 0.5 * 0.3 * 25.0 / G),
        ((0.0, -5.0, 0.0), 0.5 * 0.4 * 25.0 / G),
        ((0.0, 0.0, -4.0), 0.5 * 0.05 * 16.0 / G),
        ((40.0, 0.0, 0.0), 0.5 * 0.2 * 400.0 / G),  # limited by EKF2_ASPD_MAX
        ((3.0, -4.0, 2.0), 0.5 * (0.2 * 9.0 + 0.4 * 16.0 + 0.05 * 4.0) / G),
    ],
)
def test_static_pressure_formula(airspeed, expected):
    params = make_parameters(
        EKF2_PCOEF_XP=0.2, EKF2_PCOEF_XN=-0.1, EKF2_PCOEF_YP=0.3, EKF2_PCOEF_YN=0.4, EKF2_PCOEF_Z=0.05, EKF2_ASPD_MAX=20
    )
    assert static_pressure_height_correction(params, *airspeed) == pytest.approx(expected, rel=1e-6)


def test_static_pressure_uses_the_airflow_at_the_imu_free_point():
    params = make_parameters(EKF2_PCOEF_XP=0.2, EKF2_IMU_POS_Y=0.5)
    ekf = make_estimator()
    set_attitude(ekf, 0.0, 0.0, math.radians(90.0))
    ekf["vel"][:] = (0.0, 12.0, 0.0)  # flies east, nose east
    ekf["wind_vel"][:] = (0.0, 4.0)
    ekf["imu_delayed"]["delta_ang_dt"] = 0.01
    ekf["imu_delayed"]["delta_ang"][:] = (0.0, 0.0, 0.02)  # 2 rad/s; IMU 0.5 m right moves 1 m/s back
    assert compensate_baro_for_dynamic_pressure(ekf, params, 100.0) == 100.0
    ekf["cs"]["wind"] = True
    ekf["horizontal_deadreckon_time_exceeded"] = False
    expected = 100.0 + 0.5 * 0.2 * (12.0 - 4.0 + 1.0) ** 2 / G
    assert compensate_baro_for_dynamic_pressure(ekf, params, 100.0) == pytest.approx(expected, rel=1e-6)


def test_lasting_rejection_is_a_fault_when_another_source_agrees():
    ekf, params = _started()
    ekf["height_sensor_ref"] = HEIGHT_REF_GNSS
    ekf["baro_b_est"]["fusion_active"] = False  # hold the bias, so that the step stays visible
    for _ in range(110):
        ekf["time_last_hgt_fuse"] = ekf["time_delayed_us"]
        ekf["P"][...] = np.eye(24)
        _feed(ekf, params, 560.0)
    assert not ekf["cs"]["baro_hgt"]
    assert ekf["cs"]["baro_fault"]
    _feed(ekf, params, 500.0, reset=True)
    assert not ekf["cs"]["baro_fault"]


def test_lasting_rejection_of_the_reference_resets_the_height():
    ekf, params = _started(BARO)
    resets = ekf["state_reset"]["pos_d_counter"]
    for _ in range(110):
        ekf["P"][...] = np.eye(24)
        _feed(ekf, params, 560.0)
    assert ekf["cs"]["baro_hgt"]
    assert ekf["gpos_alt"] == pytest.approx(560.0, abs=0.1)
    assert ekf["state_reset"]["pos_d_counter"] == resets + 1


def test_stops_without_data():
    ekf, params = _started(BARO)
    ekf["baro_data_ready"] = False
    last = ekf["baro_newest_time_us"]
    for seconds, running in ((0.39, True), (0.41, False)):
        ekf["time_latest_us"] = last + round(seconds * 1e6)
        control_baro_height_fusion(ekf, params)
        assert ekf["cs"]["baro_hgt"] == running
    assert ekf["height_sensor_ref"] == HEIGHT_REF_UNKNOWN
