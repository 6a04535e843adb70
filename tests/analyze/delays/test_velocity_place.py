"""The delay of a source of velocity, on a made replay whose velocities are measured late."""

import numpy as np
import pytest
from tests.analyze.smoothing.made_steps import motion, replayed

from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.velocity_place import velocity_place
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples

MADE = motion(60.0, np.array([2e-5, -2e-5, 3e-5]), np.array([0.02, -0.03, 0.01]))
STEPS = replayed(MADE, np.full(3, 2e-3), np.array([0.1, -0.2, 0.05]), np.random.default_rng(1))
ROWS = np.arange(100, MADE.time.size, 20)
UPDATE_US = int(np.median(np.diff(MADE.time)))
TOLD_S = 0.11


def record(late_s: float, moving: bool = True) -> ReplayedSet:
    """A replay that was told `TOLD_S`; its measurements are older than that by `late_s`, and good to 0.1 m/s."""
    # PX4 takes half an update off the stamps
    stamps = MADE.time[ROWS] - UPDATE_US // 2
    at = MADE.time[ROWS] - late_s * 1e6
    true = np.column_stack([np.interp(at, MADE.time, column) for column in MADE.velocity.T])
    measured = true + 0.1 * np.random.default_rng(8).normal(size=true.shape)
    ones, fused = np.ones(ROWS.size), np.ones(ROWS.size, bool)
    samples = {
        ("gnss_vel", axis): AxisSamples(stamps, ones, 0.0 * ones, ones, ones, ~fused, fused, measured[:, axis])
        for axis in range(3)
    }
    wide = np.ones((STEPS.time.size, 3))
    states = FilterStates(STEPS.time, STEPS.quaternion, STEPS.velocity, wide, wide, wide)
    return ReplayedSet("present", {}, {}, {}, samples, {}, {}, lambda: states, lambda: STEPS)


def found(late_s: float, seconds: float = 60.0) -> Lag | None:
    begin = int(MADE.time[0])
    place = velocity_place(record(late_s), "gnss_vel", [(begin, begin + int(seconds * 1e6) + 1)], TOLD_S)
    return None if place is None else place.lag


@pytest.mark.parametrize("late_s", [-0.08, 0.0, 0.1])
def test_the_interval_holds_the_delay_that_the_measurements_have(late_s: float) -> None:
    lag = found(late_s)
    assert lag is not None
    assert abs(lag.delay_s - (TOLD_S + late_s)) <= lag.half_width_s(0.95) < 0.03


def test_a_flight_that_is_too_short_tells_nothing() -> None:
    assert found(0.0, seconds=2.0) is None
