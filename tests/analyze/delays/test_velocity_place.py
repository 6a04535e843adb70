"""Delay and place of a source of velocity, on a made replay whose velocities are measured late and off the centre."""

import numpy as np
import pytest
from tests.analyze.smoothing.made_steps import motion, replayed

from fusetune.analyze.delays.velocity_place import VelocityPlace, velocity_place
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.quaternions import rotation_matrix

Vector = tuple[float, float, float]
NOWHERE = (0.0, 0.0, 0.0)
GYRO_BIAS = np.array([2e-5, -2e-5, 3e-5])

MADE = motion(60.0, GYRO_BIAS, np.array([0.02, -0.03, 0.01]))
STEPS = replayed(MADE, np.full(3, 2e-3), np.array([0.1, -0.2, 0.05]), np.random.default_rng(1))
ROWS = np.arange(100, MADE.time.size, 20)
UPDATE_US = int(np.median(np.diff(MADE.time)))
TOLD_S = 0.11


def record(late_s: float, arm_m: np.ndarray, told_m: np.ndarray) -> ReplayedSet:
    """A replay that was told `TOLD_S`; its measurements are older than that by `late_s`, and good to 0.1 m/s.

    The velocity of a place r of the body is v + R (ω × r); the filter takes the told place's away again, with the rate
    that its gyro shows when it takes the sample.
    """
    # PX4 takes half an update off the stamps
    stamps = MADE.time[ROWS] - UPDATE_US // 2
    at = MADE.time[ROWS] - late_s * 1e6
    true = np.column_stack([np.interp(at, MADE.time, column) for column in moving(arm_m).T])
    measured = true + 0.1 * np.random.default_rng(8).normal(size=true.shape)
    rate = STEPS.delta_angle[ROWS] / STEPS.delta_angle_dt[ROWS, None] - STEPS.gyro_bias[ROWS]
    measured -= np.einsum("kij,kj->ki", rotation_matrix(STEPS.quaternion[ROWS]), np.cross(rate, told_m))
    ones, fused = np.ones(ROWS.size), np.ones(ROWS.size, bool)
    samples = {
        ("gnss_vel", axis): AxisSamples(stamps, ones, 0.0 * ones, ones, ones, ~fused, fused, measured[:, axis])
        for axis in range(3)
    }
    wide = np.ones((STEPS.time.size, 3))
    states = FilterStates(STEPS.time, STEPS.quaternion, STEPS.velocity, wide, wide, wide)
    return ReplayedSet("present", {}, {}, {}, samples, {}, {}, lambda: states, lambda: STEPS)


def moving(arm_m: np.ndarray) -> np.ndarray:
    """True velocity of a place of the body."""
    rate = MADE.delta_angle / (UPDATE_US * 1e-6) - GYRO_BIAS
    return MADE.velocity + np.einsum("kij,kj->ki", rotation_matrix(MADE.quaternion), np.cross(rate, arm_m))


def found(
    late_s: float, seconds: float = 60.0, arm_m: Vector = NOWHERE, told_m: Vector = NOWHERE
) -> VelocityPlace | None:
    begin = int(MADE.time[0])
    flight = [(begin, begin + int(seconds * 1e6) + 1)]
    return velocity_place(record(late_s, np.array(arm_m), np.array(told_m)), "gnss_vel", flight, TOLD_S, told_m)


@pytest.mark.parametrize("late_s", [-0.08, 0.0, 0.1])
def test_the_interval_holds_the_delay_that_the_measurements_have(late_s: float) -> None:
    place = found(late_s)
    assert place is not None
    assert abs(place.lag.delay_s - (TOLD_S + late_s)) <= place.lag.half_width_s(0.95) < 0.03


@pytest.mark.parametrize(("arm_m", "told_m"), [((-0.5, 0.4, 0.6), NOWHERE), ((0.3, 0.0, 0.0), (0.6, -0.2, 0.1))])
def test_the_sensor_is_found_where_it_sits_whatever_the_filter_is_told(arm_m: Vector, told_m: Vector) -> None:
    place = found(0.05, arm_m=arm_m, told_m=told_m)
    assert place is not None
    errors = np.sqrt(np.diag(place.arm_covariance))
    # turning at 0.3 rad/s, 0.1 m/s of noise in 300 samples of each axis: 0.1 / (0.3 √300) is 0.02 m
    assert np.all(errors < 0.1)
    assert np.all(np.abs(place.arm - arm_m) <= 2.5 * errors)
    assert abs(place.lag.delay_s - (TOLD_S + 0.05)) <= place.lag.half_width_s(0.95)


def test_what_was_found_is_read_as_it_was_written() -> None:
    place = found(0.0)
    assert place is not None
    again = VelocityPlace.from_document(place.document())
    assert again.lag == place.lag
    assert np.array_equal(again.arm, place.arm)
    assert np.array_equal(again.arm_covariance, place.arm_covariance)


def test_a_flight_that_is_too_short_tells_nothing() -> None:
    assert found(0.0, seconds=2.0) is None
