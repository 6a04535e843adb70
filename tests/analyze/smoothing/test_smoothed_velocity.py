"""The smoothed velocity of a made flight: near the truth, and the same whatever filter it is made of."""

import json

import numpy as np
import pytest
from tests.analyze.smoothing.made_steps import MadeMotion, motion, replayed

from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet, ReplayedSteps
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.smoothing.smoothed_velocity import FEWEST_MEASUREMENTS, SmoothedVelocity, smoothed_velocity
from fusetune.px4.flight import Flight

SECONDS = 60.0
GYRO_BIAS, ACCEL_BIAS = np.array([2e-5, -2e-5, 3e-5]), np.array([0.02, -0.03, 0.01])
MADE = motion(SECONDS, GYRO_BIAS, ACCEL_BIAS)
EVERY = 20
ROWS = np.arange(EVERY, MADE.time.size, EVERY)
NOISE = 0.1 * np.random.default_rng(8).normal(size=(ROWS.size, 3))
FLIGHT = Flight(name="made")
INSIDE = ((int(MADE.time[0]), int(MADE.time[-1]) + 1),)


def samples_of(time: np.ndarray, observation: np.ndarray) -> AxisSamples:
    ones, fused = np.ones(time.size), np.ones(time.size, bool)
    return AxisSamples(time, ones, 0.0 * ones, ones, ones, ~fused, fused, observation)


def record_of(steps: ReplayedSteps, measured: np.ndarray, heights: np.ndarray | None = None) -> ReplayedSet:
    samples = {("gnss_vel", axis): samples_of(MADE.time[ROWS], measured[:, axis]) for axis in range(3)}
    if heights is not None:
        samples["baro_hgt", 0] = samples_of(MADE.time[ROWS], heights)
    ones = np.ones((steps.time.size, 3))
    states = FilterStates(steps.time, steps.quaternion, steps.velocity, ones, ones, ones)
    return ReplayedSet("present", {}, {}, {}, samples, {}, {}, lambda: states, lambda: steps)


def a_replay(seed: int | None = 1, rotation: float = 2e-3) -> ReplayedSteps:
    corrections = None if seed is None else np.random.default_rng(seed)
    return replayed(MADE, np.full(3, rotation), np.array([0.1, -0.2, 0.05]), corrections)


def smoothed(record: ReplayedSet, intervals: tuple[tuple[int, int], ...] = INSIDE) -> SmoothedVelocity:
    found = smoothed_velocity(record, FLIGHT, intervals, 50_000)
    assert found is not None
    return found


def truth_at(time: np.ndarray, made: MadeMotion = MADE) -> np.ndarray:
    return made.velocity[np.searchsorted(made.time, time)]


def test_it_is_several_times_nearer_to_the_truth_than_measurement_and_filter() -> None:
    """A mean over some 5 s of measurements at 5 Hz of 0.1 m/s is good to 0.1/√25 = 0.02 m/s."""
    steps = a_replay()
    found = smoothed(record_of(steps, MADE.velocity[ROWS] + NOISE))
    error = found.velocity - truth_at(found.time)
    assert np.sqrt(np.mean(np.square(error), axis=0)).max() < 0.025
    assert np.sqrt(np.mean(np.square(steps.velocity - MADE.velocity), axis=0)).min() > 0.05
    assert found.horizontal.is_white
    assert found.horizontal.white == pytest.approx(0.1, rel=0.15)


def test_it_does_not_favour_the_filter_that_it_is_made_of() -> None:
    """Filters that differ by decimetres per second, and one that nothing corrected.

    What is left is of the second order, and that other noises may be found likeliest.
    """
    measured = MADE.velocity[ROWS] + NOISE
    replays = [a_replay(1), a_replay(2, -3e-3), a_replay(None, 1e-3)]
    apart = np.abs(replays[0].velocity - replays[2].velocity).max()
    one, *others = (smoothed(record_of(steps, measured)) for steps in replays)
    assert apart > 0.3
    for other in others:
        assert np.sqrt(np.mean(np.square(other.velocity - one.velocity))) < 0.005


def test_a_constant_error_of_the_receiver_is_followed_whole() -> None:
    """Nothing else tells it from motion: all that is measured shifted, the reference is shifted."""
    steps, shift = a_replay(), np.array([0.3, -0.2, 0.1])
    plain = smoothed(record_of(steps, MADE.velocity[ROWS] + NOISE))
    shifted = smoothed(record_of(steps, MADE.velocity[ROWS] + NOISE + shift))
    # but for the prior of the first error, 1 m/s
    np.testing.assert_allclose(
        shifted.velocity - plain.velocity, np.broadcast_to(shift, plain.velocity.shape), atol=1e-3
    )


def test_one_outlier_moves_it_little() -> None:
    measured = MADE.velocity[ROWS] + NOISE
    plain = smoothed(record_of(a_replay(), measured))
    spoiled = measured.copy()
    spoiled[100] += 20.0
    found = smoothed(record_of(a_replay(), spoiled))
    # a plain mean over 25 measurements would move by 0.8 m/s
    assert np.abs(found.velocity - plain.velocity).max() < 0.1


def test_heights_of_a_barometer_hold_the_vertical_velocity() -> None:
    """Where the receiver wanders and the barometer does not."""
    t = MADE.time[ROWS] * 1e-6
    wander = np.column_stack([0.0 * t, 0.0 * t, 0.3 * np.sin(1.1 * t) + 0.3 * np.sin(0.37 * t + 1.0)])
    measured = MADE.velocity[ROWS] + 0.3 * NOISE + wander
    fallen = np.r_[0.0, np.cumsum(0.5 * (MADE.velocity[1:, 2] + MADE.velocity[:-1, 2]) * 0.01)][ROWS]
    heights = fallen + 0.02 * np.random.default_rng(3).normal(size=ROWS.size)
    steps = a_replay()
    errors = []
    for record in (record_of(steps, measured), record_of(steps, measured, heights)):
        found = smoothed(record)
        errors.append(np.sqrt(np.mean(np.square(found.velocity - truth_at(found.time))[:, 2])))
    alone, with_heights = errors
    assert with_heights < 0.3 * alone


def test_it_says_how_it_was_made() -> None:
    heights = np.random.default_rng(3).normal(size=ROWS.size)
    found = smoothed(record_of(a_replay(), MADE.velocity[ROWS] + NOISE, heights)).document
    assert (found["source"], found["horizontal"]["positions"], [*found["vertical"]["positions"]]) == (
        "gnss_vel", {}, ["baro_hgt"],
    )  # fmt: skip
    assert json.loads(json.dumps(found)) == found


def test_it_is_known_in_the_intervals_alone_and_at_times_in_order() -> None:
    intervals = ((INSIDE[0][0] + 5_000_000, INSIDE[0][0] + 20_000_000), (INSIDE[0][0] + 30_000_000, INSIDE[0][1]))
    found = smoothed(record_of(a_replay(), MADE.velocity[ROWS] + NOISE), intervals)
    inside = [(found.time >= start) & (found.time < stop) for start, stop in intervals]
    assert (inside[0] | inside[1]).all()
    assert all(one.any() for one in inside)
    assert (np.diff(found.time) > 0).all()


def test_there_is_none_without_the_imu_a_source_or_enough_of_it() -> None:
    steps, measured = a_replay(), MADE.velocity[ROWS] + NOISE
    record = record_of(steps, measured)
    few = {key: one.rows(np.arange(FEWEST_MEASUREMENTS - 1)) for key, one in record.samples.items()}
    for none in (
        ReplayedSet("present", {}, {}, {}, record.samples, {}, {}, record.states),
        ReplayedSet("present", {}, {}, {}, {}, {}, {}, record.states, record.steps),
        ReplayedSet("present", {}, {}, {}, few, {}, {}, record.states, record.steps),
    ):
        assert smoothed_velocity(none, FLIGHT, INSIDE, 50_000) is None
    assert smoothed_velocity(record, FLIGHT, (), 50_000) is None
