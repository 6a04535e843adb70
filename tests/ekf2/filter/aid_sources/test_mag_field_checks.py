"""Strength and inclination checks at their thresholds, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import at_time, make_estimator, make_parameters, set_attitude

from fusetune.ekf2.filter.aid_sources.magnetometer.field_checks import check_mag_field

STRENGTH, INCLINATION, FORCE_WMM = 1, 2, 4


def _with_wmm(strength: float = 0.5, inclination_deg: float = 60.0) -> np.void:
    ekf = make_estimator()
    ekf["mag"]["wmm_strength"] = strength
    ekf["mag"]["wmm_inclination"] = np.radians(inclination_deg)
    return ekf


def _field(strength: float, inclination_deg: float) -> np.ndarray:
    inclination = np.radians(inclination_deg)
    return strength * np.array([np.cos(inclination), 0.0, np.sin(inclination)])


@pytest.mark.parametrize(
    ("strength", "disturbed"), [(0.5, False), (0.699, False), (0.701, True), (0.301, False), (0.299, True)]
)
def test_strength_within_tolerance_of_the_model(strength, disturbed):
    ekf = _with_wmm()
    check_mag_field(ekf, make_parameters(EKF2_MAG_CHECK=STRENGTH, EKF2_MAG_CHK_STR=0.2), _field(strength, 60.0))
    assert ekf["cs"]["mag_field_disturbed"] == disturbed


@pytest.mark.parametrize(("strength", "disturbed"), [(0.051, False), (0.049, True), (0.849, False), (0.851, True)])
def test_strength_without_model_must_be_one_found_on_earth(strength, disturbed):
    ekf = make_estimator()
    check_mag_field(ekf, make_parameters(EKF2_MAG_CHECK=STRENGTH), _field(strength, 60.0))
    assert ekf["cs"]["mag_field_disturbed"] == disturbed


@pytest.mark.parametrize(("inclination", "disturbed"), [(79.9, False), (80.1, True), (40.1, False), (39.9, True)])
@pytest.mark.parametrize("pitch_deg", [0.0, 25.0])
def test_inclination_is_taken_in_the_earth_frame(inclination, disturbed, pitch_deg):
    ekf = _with_wmm()
    set_attitude(ekf, 0.1, np.radians(pitch_deg), 0.7)
    body_field = ekf["R_to_earth"].T @ _field(0.5, inclination)
    check_mag_field(ekf, make_parameters(EKF2_MAG_CHECK=INCLINATION, EKF2_MAG_CHK_INC=20.0), body_field)
    assert ekf["cs"]["mag_field_disturbed"] == disturbed
    assert ekf["mag"]["inclination"] == pytest.approx(np.radians(inclination), abs=1e-9)


def test_healthy_only_after_more_than_a_second_without_failure():
    ekf, params = _with_wmm(), make_parameters(EKF2_MAG_CHECK=STRENGTH)
    good, bad = _field(0.5, 60.0), _field(0.1, 60.0)
    verdicts = []
    for time_s, field in [(10.0, good), (11.0, good), (11.001, good), (11.5, bad), (12.5, good), (12.51, good)]:
        at_time(ekf, time_s)
        verdicts.append(check_mag_field(ekf, params, field))
    # the clock starts with the first check and again with the failure at 11.5 s
    assert verdicts == [False, False, True, False, False, True]


def test_forced_model_fails_without_disturbance_while_it_is_unknown():
    ekf = make_estimator()
    params = make_parameters(EKF2_MAG_CHECK=STRENGTH | INCLINATION | FORCE_WMM)
    for time_s in np.arange(10.0, 15.0, 0.5):
        at_time(ekf, time_s)
        assert not check_mag_field(ekf, params, _field(0.5, 60.0))
        assert not ekf["cs"]["mag_field_disturbed"]


def test_no_checks_pass_at_once():
    ekf = make_estimator()
    assert check_mag_field(ekf, make_parameters(EKF2_MAG_CHECK=0), _field(5.0, 0.0))
    assert not ekf["cs"]["mag_field_disturbed"]
