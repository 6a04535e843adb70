"""A flight in which the primary estimator instance, and with it the IMU, changes."""

from dataclasses import replace

import numpy as np
import pytest

from fusetune.ekf2.feed.inputs import ARRIVAL, ARRIVAL_FIELDS, EstimatorInputs, build_inputs
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.handover import handover_runs, without_resets_at
from fusetune.ekf2.replay.replay import replay
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.logged_state import Handover, logged_states

OTHER_ACCEL_BIAS = np.array([0.25, -0.2, 0.1])
OTHER_GYRO_BIAS = np.array([0.01, -0.01, 0.02])
CHANGE_S = 50.0


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


@pytest.fixture(scope="module")
def handover(flight) -> Handover:
    """An instance on an IMU of other biases, which it knows."""
    time = int(flight.topics["sensor_combined", 0]["timestamp"][0] + CHANGE_S * 1e6)
    state = min(logged_states(flight), key=lambda one: abs(one.time_us - time))
    known = replace(state, gyro_bias=state.gyro_bias + OTHER_GYRO_BIAS, accel_bias=state.accel_bias + OTHER_ACCEL_BIAS)
    return Handover(time, known)


@pytest.fixture(scope="module")
def changed(flight, handover) -> EstimatorInputs:
    """The flight on another IMU from the handover on."""
    imu = dict(flight.topics["sensor_combined", 0])
    after = imu["timestamp"].astype(np.int64) > handover.time_us
    for axis in range(3):
        for name, bias in (("gyro_rad", OTHER_GYRO_BIAS), ("accelerometer_m_s2", OTHER_ACCEL_BIAS)):
            column = f"{name}[{axis}]"
            imu[column] = (imu[column] + after * bias[axis]).astype(imu[column].dtype)
    return build_inputs(flight.with_topics(flight.topics | {("sensor_combined", 0): imu}))


def parameters(flight: Flight) -> dict[str, float]:
    return complete(flight.parameters.initial, {}, flight.release)


def velocity_rms(result: ReplayResult, since: int) -> float:
    """Of GNSS velocity innovations in the ten seconds after a time."""
    rows = result.innovations[result.source_names() == "gnss_vel"]
    late = (rows["timestamp_sample"] > since) & (rows["timestamp_sample"] < since + 10_000_000)
    return float(np.sqrt(np.mean(rows["innovation"][late] ** 2)))


def test_filter_goes_on_with_what_the_new_instance_knew(flight, handover, changed):
    """The same flight on one IMU is the measure: with the handover as good, without it the biases are off."""
    params = parameters(flight)
    undisturbed = velocity_rms(replay(build_inputs(flight), params), handover.time_us)
    taken = velocity_rms(replay(changed, params, handovers=(handover,)), handover.time_us)
    ignored = velocity_rms(replay(changed, params), handover.time_us)
    assert taken < 1.1 * undisturbed
    assert ignored > 1.5 * undisturbed


def test_position_and_attitude_stay_the_filters_own(flight, handover, changed):
    elsewhere = replace(handover.state, velocity=handover.state.velocity + 5.0, q=np.array([0.0, 0.0, 0.0, 1.0]))
    params = parameters(flight)
    one, other = (
        replay(changed, params, handovers=(Handover(handover.time_us, state),)) for state in (handover.state, elsewhere)
    )
    np.testing.assert_array_equal(one.states["states"], other.states["states"])


def test_biases_are_taken_when_the_horizon_comes_to_the_new_sensors(flight, handover, changed):
    params = parameters(flight)
    result = replay(changed, params, handovers=(handover,))
    time, bias = result.states["timestamp_sample"], result.states["states"][:, 13:16]
    # EKF2_DELAY_MAX, 200 ms, is 20 updates of 10 ms; at 250 Hz an update is 8 ms, so the horizon lags by 40 ms less
    after = int(np.argmax(np.abs(bias - handover.state.accel_bias).max(axis=1) < 0.02))
    assert abs(int(time[after]) - handover.time_us) < 60_000
    assert np.abs(bias[after - 1] - handover.state.accel_bias).max() > 0.1


def test_no_bias_is_reset_at_a_handover(flight, handover, changed):
    row = int(np.searchsorted(changed.arrays.imu["time_us"], handover.time_us))
    reset = ARRIVAL_FIELDS.index("reset_accel_bias")
    arrivals = np.append(changed.arrays.arrivals, np.array([(row, reset, 1), (row + 2000, reset, 1)], ARRIVAL))
    told = replace(changed, arrays=changed.arrays._replace(arrivals=np.sort(arrivals, order="run")))
    without = without_resets_at(told, (handover,)).arrays
    left = without.arrivals["run"][without.arrivals["field"] == reset].tolist()
    assert row not in left
    assert row + 2000 in left
    assert without_resets_at(told, ()) is told


def test_runs_are_those_that_the_delay_puts_at_the_horizon(changed, handover):
    ((run, state),) = handover_runs(changed, 110.0, (handover,))
    time = changed.arrays.imu["time_us"]
    assert state is handover.state
    assert time[run - 1] < handover.time_us + 110_000 <= time[run]
