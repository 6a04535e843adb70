"""Bias states as rates, with the update interval that the log itself tells."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.layouts.bias_states import bias_limits, bias_states

TIME = np.arange(50) * 200_000 + 1_000_000
BIASES = np.array([0.01, -0.02, 0.005, 0.1, 0.2, -0.05])


def states(interval: float, variances: int = 24) -> TopicTable:
    rows = np.r_[1.0, np.zeros(6), 1.0, 1.0, 1.0, BIASES * interval, np.zeros(8)]
    table: TopicTable = {"timestamp": TIME, "timestamp_sample": TIME}
    table |= {f"states[{place}]": np.full(len(TIME), value) for place, value in enumerate(rows)}
    return table | {f"covariances[{place}]": np.full(len(TIME), 1e-9) for place in range(variances)}


def imu(interval_us: int) -> TopicTable:
    return {"timestamp": TIME, "gyro_integral_dt": np.full(len(TIME), interval_us)}


@pytest.mark.parametrize(
    ("imu_us", "update_s"), [(4000, 0.008), (4490, 0.00898), (5000, 0.01), (5250, 0.0105), (2500, 0.01)]
)
def test_the_interval_is_a_whole_number_of_imu_intervals_near_ten_milliseconds(imu_us: int, update_s: float) -> None:
    """As logs with both forms of the biases have it: 8 ms at 250 Hz, 8.98 ms at 4.49 ms, 10.5 ms at 5.25 ms."""
    topics = {("estimator_states", 0): states(update_s), ("sensor_combined", 0): imu(imu_us)}
    found = bias_states(Flight("made", topics), 0)
    assert found is not None
    assert found.interval_s == pytest.approx(update_s)
    np.testing.assert_allclose(found.gyro, np.tile(BIASES[:3], (50, 1)))
    np.testing.assert_allclose(found.accel, np.tile(BIASES[3:], (50, 1)))


def test_biases_that_are_logged_as_rates_as_well_tell_the_interval() -> None:
    rates: TopicTable = {"timestamp": TIME}
    for axis in range(3):
        rates |= {f"gyro_bias[{axis}]": np.full(50, BIASES[axis]), f"accel_bias[{axis}]": np.full(50, BIASES[3 + axis])}
    topics = {
        ("estimator_states", 0): states(0.0123),
        ("estimator_sensor_bias", 0): rates,
        ("sensor_combined", 0): imu(5000),
    }
    found = bias_states(Flight("made", topics), 0)
    assert found is not None
    assert found.interval_s == pytest.approx(0.0123)


def test_states_of_an_error_state_are_rates_already() -> None:
    found = bias_states(Flight("made", {("estimator_states", 0): states(1.0, variances=23)}), 0)
    assert found is not None
    assert found.interval_s == 1.0
    np.testing.assert_allclose(found.accel[0], BIASES[3:])


def test_what_is_no_state_of_any_release_tells_nothing() -> None:
    assert bias_states(Flight("made", {}), 0) is None
    table = {name: values for name, values in states(1.0).items() if not name.startswith("covariances[2")}
    assert bias_states(Flight("made", {("estimator_states", 0): table}), 0) is None
    nothing = states(0.01) | {"states[11]": np.full(50, np.nan)}
    assert bias_states(Flight("made", {("estimator_states", 0): nothing}), 0) is None


def test_limits_are_those_of_the_log_before_those_of_its_release() -> None:
    """20 °/s for the gyro before EKF2_GYR_B_LIM came with v1.14, as logs of v1.11 to v1.13 tell."""
    parameters = {"EKF2_GYR_B_LIM": 0.15, "EKF2_ABL_LIM": 0.4}
    old, new = ({"ver_sw_release": 1 << 24 | minor << 16 | 255} for minor in (13, 14))
    assert bias_limits(Flight("old", info=old), 0, parameters) == (pytest.approx(0.349, abs=1e-3), 0.4)
    assert bias_limits(Flight("new", info=new), 0, parameters) == (0.15, 0.4)
    told: TopicTable = {"timestamp": TIME, "gyro_bias_limit": np.full(50, 0.2), "accel_bias_limit": np.full(50, 0.3)}
    assert bias_limits(Flight("new", {("estimator_sensor_bias", 0): told}, info=new), 0, parameters) == (0.2, 0.3)
