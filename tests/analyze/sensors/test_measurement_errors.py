"""What is left of a measurement once the inertial motion is taken out, on a filter made by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.sensors.measurement_errors import measurement_errors
from fusetune.px4.flight import Flight

UPDATES = 2000
TIME = np.arange(UPDATES, dtype=np.int64) * 10_000
EVERY = 20
"""Updates per measurement."""
RNG = np.random.default_rng(11)
EMPTY = Flight(name="f")


def samples(time: np.ndarray, observation: np.ndarray, innovation: np.ndarray) -> AxisSamples:
    ones, fused = np.ones(time.size), np.ones(time.size, dtype=bool)
    return AxisSamples(time, ones, innovation, ones, ones, ~fused, fused, observation)


def record_of(source: str, time: np.ndarray, observation: np.ndarray, innovation: np.ndarray) -> ReplayedSet:
    axes = {
        (source, axis): samples(time, observation[:, axis], innovation[:, axis]) for axis in range(observation.shape[1])
    }
    return ReplayedSet("present", {}, {}, {}, axes, {}, {})


def states_of(velocity: np.ndarray, quaternion: np.ndarray | None = None) -> FilterStates:
    level = np.tile([1.0, 0.0, 0.0, 0.0], (UPDATES, 1))
    ones = np.ones((UPDATES, 3))
    return FilterStates(TIME, level if quaternion is None else quaternion, velocity, ones, ones, ones)


@pytest.mark.parametrize("gain", [0.05, 0.5, 0.95])
def test_velocity_errors_come_out_whatever_the_gain_of_the_filter(gain: float) -> None:
    """A filter with perfect inertial sensors that corrects by `gain`: y is the error itself, up to a constant."""
    truth = np.column_stack([np.sin(TIME * 1e-6), np.cos(2e-6 * TIME), 0.1 * TIME * 1e-6])
    velocity, error = truth.copy(), np.zeros(3)
    rows, observation, innovation, errors = [], [], [], []
    for k in range(UPDATES):
        velocity[k] = truth[k] + error
        if k % EVERY == EVERY - 1:
            noise = 0.1 * RNG.standard_normal(3)
            rows.append(k)
            errors.append(noise)
            observation.append(truth[k] + noise)
            innovation.append(velocity[k] - observation[-1])
            error = error - gain * innovation[-1]
            velocity[k] = truth[k] + error
    record = record_of("gnss_vel", TIME[rows], np.array(observation), np.array(innovation))
    found = measurement_errors(record, states_of(velocity), EMPTY, "gnss_vel")
    assert found is not None
    difference = found.values - np.array(errors)
    np.testing.assert_allclose(difference - difference[0], 0.0, atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_heights_are_held_against_the_way_fallen_whichever_way_they_count(sign: float) -> None:
    speed = np.sin(0.5e-6 * TIME)
    velocity = np.column_stack([np.zeros(UPDATES), np.zeros(UPDATES), speed])
    fallen = np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 0.01)]
    rows = np.arange(EVERY, UPDATES, EVERY)
    errors = 0.2 * RNG.standard_normal(rows.size)
    observation = sign * fallen[rows] + 40.0 + errors
    innovation = -errors + 0.01 * RNG.standard_normal(rows.size)
    record = record_of("baro_hgt", TIME[rows], observation[:, None], innovation[:, None])
    found = measurement_errors(record, states_of(velocity), EMPTY, "baro_hgt")
    assert found is not None
    np.testing.assert_allclose(found.values[:, 0], sign * (40.0 + errors), atol=1e-9)


def test_gnss_positions_are_taken_from_the_log_in_full_resolution() -> None:
    velocity = np.tile([3.0, -2.0, 0.0], (UPDATES, 1))
    rows = np.arange(EVERY, UPDATES, EVERY)
    seconds = TIME[rows] * 1e-6
    errors = 0.02 * RNG.standard_normal((rows.size, 2))
    north, east = 3.0 * seconds + errors[:, 0], -2.0 * seconds + errors[:, 1]
    latitude = 47.0 + np.degrees(north / 6371000.0)
    longitude = 8.0 + np.degrees(east / 6371000.0 / np.cos(np.radians(latitude[0])))
    delay = 110_000
    table = {"timestamp": TIME[rows] + delay, "latitude_deg": latitude, "longitude_deg": longitude}
    flight = Flight(name="f", topics={("vehicle_gps_position", 0): table})
    coarse = np.column_stack([latitude, longitude]).astype(np.float32).astype(np.float64)
    record = record_of("gnss_pos", TIME[rows], coarse, errors)
    record.parameters["EKF2_GPS_DELAY"] = 110.0
    found = measurement_errors(record, states_of(velocity), flight, "gnss_pos")
    assert found is not None
    difference = found.values - errors
    # Kilometres of cos(latitude) away would matter; over 60 m the projection is good to micrometres.
    np.testing.assert_allclose(difference - difference[0], 0.0, atol=1e-4)
    assert measurement_errors(record, states_of(velocity), EMPTY, "gnss_pos") is None


def test_magnetometer_errors_are_what_no_earth_field_and_no_bias_explain() -> None:
    turn = Rotation.from_euler("ZYX", np.column_stack([4.0 * TIME, 0.3e6 * np.sin(1e-6 * TIME), 1.0 * TIME]) * 1e-6)
    rows = np.arange(0, UPDATES, 2)
    errors = 0.006 * RNG.standard_normal((rows.size, 3))
    field, bias = np.array([0.21, 0.01, 0.43]), np.array([0.03, -0.02, 0.01])
    observation = turn[rows].inv().apply(field) + bias + errors
    record = record_of("mag", TIME[rows], observation, errors)
    quaternion = turn.as_quat(scalar_first=True)
    found = measurement_errors(record, states_of(np.zeros((UPDATES, 3)), quaternion), EMPTY, "mag")
    assert found is not None
    # Six fitted numbers against a thousand samples.
    assert np.sqrt(np.mean((found.values - errors) ** 2)) < 0.001


def test_a_velocity_in_another_frame_than_the_state_is_not_used() -> None:
    velocity = np.tile([5.0, 0.0, 0.0], (UPDATES, 1))
    rows = np.arange(EVERY, UPDATES, EVERY)
    innovation = 0.01 * RNG.standard_normal((rows.size, 3))
    record = record_of("ev_vel", TIME[rows], np.tile([0.0, 5.0, 0.0], (rows.size, 1)), innovation)
    assert measurement_errors(record, states_of(velocity), EMPTY, "ev_vel") is None


def test_sources_that_are_not_there_have_no_series() -> None:
    record = ReplayedSet("present", {}, {}, {}, {}, {}, {})
    assert measurement_errors(record, states_of(np.zeros((UPDATES, 3))), EMPTY, "gnss_vel") is None
    assert measurement_errors(record, states_of(np.zeros((UPDATES, 3))), EMPTY, "drag") is None
