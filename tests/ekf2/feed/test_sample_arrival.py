"""Samples on their way to the fusion time horizon, and what parameters said of them when they arrived."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import at_time, make_estimator, make_parameters

from fusetune.ekf2.feed.buffers import reset_ring
from fusetune.ekf2.feed.sample_arrival import (
    apply_antenna_yaw_offset,
    apply_vision_noise,
    is_fusion_due,
    note_antenna_yaw_offset,
    note_vision_noise,
    pop,
    receive,
    receive_drag,
)
from fusetune.ekf2.feed.sensor_samples import BARO_SAMPLE, DRAG_SAMPLE, EV_SAMPLE, GNSS_SAMPLE

TIME_US = 5_000_000


@pytest.fixture
def gnss() -> np.ndarray:
    samples = np.zeros(1, GNSS_SAMPLE)
    samples["time_us"] = TIME_US
    samples["yaw"], samples["yaw_offset"] = 0.3, np.nan
    return samples


@pytest.fixture
def vision() -> np.ndarray:
    samples = np.zeros(1, EV_SAMPLE)
    samples["time_us"] = TIME_US
    samples["position_var"], samples["velocity_var"], samples["orientation_var"] = 0.04, 0.04, 0.04
    return samples


@pytest.fixture
def ekf() -> np.void:
    estimator = make_estimator()
    for sensor in ("gnss", "ev", "baro", "drag"):
        reset_ring(estimator["sensors"][sensor]["ring"], 5)
    at_time(estimator, TIME_US * 1e-6)
    return estimator


def test_sample_is_measured_its_delay_and_half_an_interval_before_it_arrives(ekf):
    """PX4: the time stamp less EKF2_BARO_DELAY (30 ms) and half of the mean interval (10 ms here)."""
    samples, baro = np.zeros(2, BARO_SAMPLE), ekf["sensors"]["baro"]
    samples["time_us"], samples["hgt"] = TIME_US + 100_000, [0.0, 7.0]
    assert receive(ekf, baro, samples, 1, 30.0)
    assert baro["exists"]
    assert baro["newest_time_us"] == ekf["time_latest_us"]
    ekf["time_delayed_us"] = TIME_US + 64_999
    assert pop(ekf, baro, samples, True) == -1
    assert not baro["data_ready"]
    ekf["time_delayed_us"] = TIME_US + 65_000
    assert pop(ekf, baro, samples, True) >= 0
    assert baro["data_ready"]
    assert (baro["sample"]["hgt"], baro["sample"]["time_us"]) == (7.0, TIME_US + 65_000)


def test_refused_sample_is_not_the_newest_but_the_sensor_exists(ekf):
    samples, baro = np.zeros(1, BARO_SAMPLE), ekf["sensors"]["baro"]
    samples["time_us"] = TIME_US
    ekf["buffers"]["min_observation_interval_us"] = 2 * TIME_US
    assert not receive(ekf, baro, samples, 0, 0.0)
    assert baro["exists"]
    assert baro["newest_time_us"] == 0


def test_what_is_not_wanted_stays_in_the_ring(ekf):
    samples, baro = np.zeros(1, BARO_SAMPLE), ekf["sensors"]["baro"]
    samples["time_us"] = TIME_US
    receive(ekf, baro, samples, 0, 0.0)
    baro["data_ready"] = True
    assert pop(ekf, baro, samples, False) == -1
    assert not baro["data_ready"]
    assert pop(ekf, baro, samples, True) >= 0
    assert baro["data_ready"]


@pytest.mark.parametrize(("ready", "withheld", "due"), [(True, False, True), (True, True, False), (False,) * 3])
def test_fusion_is_due_of_a_sample_that_is_not_withheld(ekf, ready, withheld, due):
    sensor = ekf["sensors"]["mag"]
    sensor["data_ready"], sensor["withheld"] = ready, withheld
    assert is_fusion_due(sensor) == due


def test_drag_comes_back_in_the_order_in_which_it_was_made(ekf):
    drag, made = ekf["sensors"]["drag"], np.zeros(1, DRAG_SAMPLE)
    for i in range(3):
        made["time_us"], made["accel_xy"] = TIME_US + i, i
        receive_drag(drag, made[0])
    for i in range(3):
        ekf["time_delayed_us"] = TIME_US + i
        pop(ekf, drag, drag["made"], True)
        assert drag["sample"]["accel_xy"].tolist() == [i, i]


def received_vision(ekf: np.void, vision: np.ndarray, **parameters: float) -> np.void:
    """The sample as the filter gets it, if these were the parameters when it arrived."""
    sensor = ekf["sensors"]["ev"]
    assert receive(ekf, sensor, vision, 0, 0.0)
    note_vision_noise(sensor, make_parameters(**parameters))
    apply_vision_noise(sensor, pop(ekf, sensor, vision, True))
    assert sensor["data_ready"]
    return sensor["sample"]


def test_vision_noise_is_that_of_the_arrival(ekf, vision):
    """Reported 0.04; at arrival the parameters stand for themselves (mode 1): 0.5² m², 0.4² m²/s², 0.3² rad²."""
    noise = {"EKF2_EV_NOISE_MD": 1, "EKF2_EVP_NOISE": 0.5, "EKF2_EVV_NOISE": 0.4, "EKF2_EVA_NOISE": 0.3}
    sample = received_vision(ekf, vision, **noise)
    np.testing.assert_allclose(sample["position_var"], 0.25)
    np.testing.assert_allclose(sample["velocity_var"], 0.16)
    np.testing.assert_allclose(sample["orientation_var"], 0.09)


def test_vision_noise_is_a_floor_to_what_is_reported(ekf, vision):
    noise = {"EKF2_EV_NOISE_MD": 0, "EKF2_EVP_NOISE": 0.5, "EKF2_EVV_NOISE": 0.1, "EKF2_EVA_NOISE": 0.1}
    sample = received_vision(ekf, vision, **noise)
    np.testing.assert_allclose(sample["position_var"], 0.25)
    np.testing.assert_allclose(sample["velocity_var"], 0.04)


@pytest.mark.parametrize(("offset_deg", "yaw"), [(0.0, 0.3), (90.0, 0.3 - np.pi / 2)])
def test_antenna_yaw_is_turned_by_the_offset_of_the_arrival(ekf, gnss, offset_deg, yaw):
    sensor = ekf["sensors"]["gnss"]
    assert receive(ekf, sensor, gnss, 0, 0.0)
    note_antenna_yaw_offset(sensor, make_parameters(EKF2_GPS_YAW_OFF=offset_deg))
    apply_antenna_yaw_offset(sensor, pop(ekf, sensor, gnss, True))
    assert sensor["data_ready"]
    assert sensor["sample"]["yaw"] == pytest.approx(yaw)
