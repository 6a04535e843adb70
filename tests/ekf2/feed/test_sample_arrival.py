"""What a parameter says of a sample acts when the sample arrives, as in PX4's module, not when it is due."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import at_time, make_estimator, make_parameters

from fusetune.ekf2.feed.buffers import reset_ring
from fusetune.ekf2.feed.sample_arrival import pop_ev, pop_gnss, receive_ev, receive_gnss
from fusetune.ekf2.feed.sensor_samples import EV_SAMPLE, GNSS_SAMPLE

TIME_US = 5_000_000


class OneSample(NamedTuple):
    gnss: np.ndarray
    ev: np.ndarray


@pytest.fixture
def inputs() -> OneSample:
    gnss, ev = np.zeros(1, GNSS_SAMPLE), np.zeros(1, EV_SAMPLE)
    gnss["time_us"] = ev["time_us"] = TIME_US
    gnss["yaw"], gnss["yaw_offset"] = 0.3, np.nan
    ev["position_var"], ev["velocity_var"], ev["orientation_var"] = 0.04, 0.04, 0.04
    return OneSample(gnss, ev)


@pytest.fixture
def ekf() -> np.void:
    estimator = make_estimator()
    for ring in ("gnss", "ev"):
        reset_ring(estimator["buffers"][ring], 5)
    at_time(estimator, TIME_US * 1e-6)
    return estimator


def test_vision_noise_is_that_of_the_arrival(ekf, inputs):
    """Reported 0.04; at arrival the parameters stand for themselves (mode 1): 0.5² m², 0.4² m²/s², 0.3² rad²."""
    at_arrival = {"EKF2_EV_NOISE_MD": 1, "EKF2_EVP_NOISE": 0.5, "EKF2_EVV_NOISE": 0.4, "EKF2_EVA_NOISE": 0.3}
    receive_ev(ekf, make_parameters(**at_arrival, EKF2_EV_DELAY=0.0), inputs, 0)
    pop_ev(ekf, inputs)
    assert ekf["ev_data_ready"]
    np.testing.assert_allclose(ekf["ev_sample"]["position_var"], 0.25)
    np.testing.assert_allclose(ekf["ev_sample"]["velocity_var"], 0.16)
    np.testing.assert_allclose(ekf["ev_sample"]["orientation_var"], 0.09)


def test_vision_noise_is_a_floor_to_what_is_reported(ekf, inputs):
    noise = {"EKF2_EV_NOISE_MD": 0, "EKF2_EVP_NOISE": 0.5, "EKF2_EVV_NOISE": 0.1, "EKF2_EVA_NOISE": 0.1}
    receive_ev(ekf, make_parameters(**noise, EKF2_EV_DELAY=0.0), inputs, 0)
    pop_ev(ekf, inputs)
    np.testing.assert_allclose(ekf["ev_sample"]["position_var"], 0.25)
    np.testing.assert_allclose(ekf["ev_sample"]["velocity_var"], 0.04)


@pytest.mark.parametrize(("offset_deg", "yaw"), [(0.0, 0.3), (90.0, 0.3 - np.pi / 2)])
def test_antenna_yaw_is_turned_by_the_offset_of_the_arrival(ekf, inputs, offset_deg, yaw):
    receive_gnss(ekf, make_parameters(EKF2_GPS_YAW_OFF=offset_deg, EKF2_GPS_DELAY=0.0), inputs, 0)
    pop_gnss(ekf, inputs)
    assert ekf["gnss_data_ready"]
    assert ekf["gnss_sample"]["yaw"] == pytest.approx(yaw)
