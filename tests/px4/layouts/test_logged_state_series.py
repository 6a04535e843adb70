"""States of the vehicle's own estimator over a flight: the same as those that are read one at a time."""

from __future__ import annotations

import numpy as np
import pytest
from tests.px4.layouts.test_logged_state import HORIZON, made_flight, release, table

from fusetune.px4.layouts.logged_state import logged_states
from fusetune.px4.layouts.logged_state_series import logged_biases, logged_state_series

_VARIANCES = {
    "velocity": slice(3, 6),
    "position": slice(6, 9),
    "gyro_bias": slice(9, 12),
    "accel_bias": slice(12, 15),
    "mag_earth": slice(15, 18),
    "mag_body": slice(18, 21),
    "wind": slice(21, 23),
}
"""In the error state of v1.16, which `LoggedState.variances` has."""


@pytest.mark.parametrize(
    ("minor", "covariances"),
    [(13, 1e-7 * np.arange(1.0, 25.0)), (15, 1e-4 * np.arange(1.0, 24.0))],
    ids=["increments and a quaternion", "rates and a rotation"],
)
def test_the_series_are_those_of_single_states(minor: int, covariances: np.ndarray) -> None:
    states = 1e-3 * np.arange(24.0)
    states[:4] = [1.0, 0.0, 0.0, 0.0]
    flight = made_flight(release(1, minor), states, covariances)
    (state,) = logged_states(flight)
    series = logged_state_series(flight)
    assert series is not None
    for name, values in series.values.items():
        np.testing.assert_allclose(values[0], getattr(state, name), err_msg=name)
    for name, part in _VARIANCES.items():
        np.testing.assert_allclose(series.variances[name][0], state.variances[part], err_msg=name)
    # that of a quaternion is not brought to a rotation here
    assert ("attitude" in series.variances) == (minor == 15)


def test_variances_of_biases_are_taken_from_where_they_are_those_of_rates() -> None:
    """v1.12 and v1.13 publish variances of increments over the update interval, once: 2e-9 for (1.4e-5 rad)² in 0.01 s,
    where the rate has 2e-7 (rad/s)²."""
    states, covariances = np.zeros(24), np.full(24, 2e-11)
    states[0], states[10] = 1.0, 2e-5
    flight = made_flight(release(1, 13), states, covariances)
    bias = {"gyro_bias": [2e-3, 0.0, 0.0], "accel_bias": [0.0] * 3}
    spread = {"gyro_bias_variance": [2e-9] * 3, "accel_bias_variance": [2e-9] * 3}
    flight.topics["estimator_sensor_bias", 0] = table(timestamp=HORIZON, **bias, **spread)
    found = logged_biases(flight)
    assert found is not None
    np.testing.assert_allclose(found.values["gyro_bias"][0], bias["gyro_bias"])
    np.testing.assert_allclose(found.variances["gyro_bias"][0], 2e-7)
    newer = made_flight(release(1, 15), states, np.full(23, 2e-7))
    newer.topics["estimator_sensor_bias", 0] = table(timestamp=HORIZON + 7, **bias, **spread)
    found = logged_biases(newer)
    assert found is not None
    assert found.time.tolist() == [HORIZON + 7]
    np.testing.assert_allclose(found.variances["gyro_bias"][0], 2e-9)


def test_a_log_without_states_has_none() -> None:
    flight = made_flight(release(1, 15), np.zeros(24), np.zeros(23))
    del flight.topics["estimator_states", 0]
    assert logged_state_series(flight) is None
    assert logged_biases(flight) is None
