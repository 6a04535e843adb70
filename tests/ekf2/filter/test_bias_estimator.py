"""Expected values: the scalar Kalman filter written out by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.ekf2.filter.bias_estimator import bias_estimator as be
from fusetune.ekf2.filter.bias_estimator import height_bias_estimator as hbe
from fusetune.ekf2.filter.bias_estimator import position_bias_estimator as pbe

EKF = np.dtype([("height_sensor_ref", "i8"), ("position_sensor_ref", "i8"), ("P", "f8", (24, 24))])


@pytest.fixture
def estimator():
    record = np.zeros(1, be.BIAS_ESTIMATOR)[0]
    be.initialise_bias_estimator(record, 0.1)
    be.set_max_state_noise(record, 2.0)
    return record


def test_follows_the_scalar_kalman_filter(estimator):
    be.set_process_noise_spectral_density(estimator, 0.13)
    x, p = 0.0, 0.1
    for observation in (0.3, -0.1, 0.4, 0.2):
        be.predict_bias(estimator, 0.01)
        p += 0.13**2 * 0.01
        be.fuse_bias(estimator, observation, 0.5)
        gain = p / (p + 0.5)
        x += gain * (observation - x)
        p *= 1.0 - gain
        assert estimator["bias"] == pytest.approx(x, rel=1e-12)
        assert estimator["bias_var"] == pytest.approx(p, rel=1e-12)


def test_an_innovation_beyond_three_sigma_is_noted_but_not_fused(estimator):
    be.fuse_bias(estimator, 3.01 * np.sqrt(0.6), 0.5)
    assert estimator["bias"] == 0.0
    assert estimator["bias_var"] == 0.1
    assert estimator["innovation"] == pytest.approx(3.01 * np.sqrt(0.6))
    assert estimator["innovation_test_ratio"] == pytest.approx((3.01 / 3.0) ** 2)


def test_variance_stays_below_the_limit_and_observations_are_never_perfect(estimator):
    be.set_process_noise_spectral_density(estimator, 10.0)
    for _ in range(100):
        be.predict_bias(estimator, 0.01)
    assert estimator["bias_var"] == 4.0
    be.fuse_bias(estimator, 0.0, 0.0)
    assert estimator["innovation_variance"] == pytest.approx(4.0 + 1e-4)


def test_innovations_of_one_sign_raise_the_process_noise_a_thousandfold(estimator):
    be.set_process_noise_spectral_density(estimator, 1e-3)
    # at the nominal 10 ms per observation, 10 s are 1000 observations
    for _ in range(1000):
        be.fuse_bias(estimator, estimator["bias"] + 1e-3, 1e6)
    assert not be.is_offset_detected(estimator)
    be.fuse_bias(estimator, estimator["bias"] + 1e-3, 1e6)
    assert be.is_offset_detected(estimator)
    before = estimator["bias_var"]
    be.predict_bias(estimator, 0.01)
    assert estimator["bias_var"] - before == pytest.approx(1e-6 * 0.01 * 1e3, rel=1e-6)
    be.fuse_bias(estimator, estimator["bias"] - 1e-3, 1e6)
    assert not be.is_offset_detected(estimator)


def test_the_test_ratio_filter_has_no_gain_at_the_nominal_interval_and_px4s_otherwise(estimator):
    be.predict_bias(estimator, 0.0105)
    be.fuse_bias(estimator, 2.0, 0.5)
    assert estimator["test_ratio_lpf"] == 0.0
    be.predict_bias(estimator, 0.02)
    be.fuse_bias(estimator, 2.0, 0.5)
    assert estimator["test_ratio_lpf"] == pytest.approx(0.02 / 10.02 * estimator["innovation_test_ratio"])


@settings(deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=30))
def test_variance_never_grows_by_an_observation(observations):
    record = np.zeros(1, be.BIAS_ESTIMATOR)[0]
    be.initialise_bias_estimator(record, 0.1)
    for observation in observations:
        before = record["bias_var"]
        be.fuse_bias(record, observation, 0.3)
        assert 0.0 < record["bias_var"] <= before


def test_height_bias_rests_while_its_source_is_the_reference_or_not_fused():
    ekf = np.zeros(1, EKF)[0]
    record = np.zeros(1, hbe.HEIGHT_BIAS_ESTIMATOR)[0]
    hbe.initialise_height_bias_estimator(record)
    be.set_process_noise_spectral_density(record, 0.13)
    for reference, active, moves in ((1, True, False), (0, False, False), (0, True, True)):
        ekf["height_sensor_ref"] = reference
        record["fusion_active"] = active
        hbe.predict_height_bias(ekf, record, 1, 0.01)
        hbe.update_height_bias(ekf, record, 1, 1e-3, 0.5)
        assert bool(record["bias"] != 0.0) is moves
        assert bool(record["bias_var"] != 0.0) is moves


def test_position_bias_axes_are_independent():
    ekf = np.zeros(1, EKF)[0]
    record = np.zeros(1, pbe.POSITION_BIAS_ESTIMATOR)[0]
    pbe.initialise_position_bias_estimator(record)
    record["fusion_active"] = True
    pbe.fuse_position_bias(ekf, record, 1, 0.5, 0.0, 0.1, 0.1)
    assert record["north"]["bias"] == pytest.approx(0.25)
    assert record["east"]["bias"] == 0.0
    pbe.set_position_bias(record, 1.0, -2.0)
    assert (record["north"]["bias"], record["east"]["bias"]) == (1.0, -2.0)
    pbe.reset_position_bias(record)
    assert (record["north"]["bias"], record["east"]["bias_var"]) == (0.0, 0.0)
