"""The likelihood finds the noises that made the measurements."""

import math

import numpy as np
import pytest

from fusetune.analyze.smoothing.error_model import ErrorModel, PositionErrors, likeliest_errors
from fusetune.analyze.smoothing.inertial_steps import InertialSteps
from fusetune.analyze.smoothing.velocity_models import (
    DOWN,
    ROTATION_TO_VELOCITY,
    PositionSeries,
    Stretch,
    horizontal_model,
)

STEP_S, UPDATES_PER_STEP = 0.2, 20
WALK = 0.01


def still(seconds: float) -> InertialSteps:
    """The sums of a level vehicle at rest: the force is that against gravity, and nothing was corrected."""
    count = round(seconds / STEP_S) * UPDATES_PER_STEP + 1
    t = np.arange(count) * STEP_S / UPDATES_PER_STEP
    force = np.column_stack([0.0 * t, 0.0 * t, -9.80665 * t])
    turned = np.eye(3) * t[:, None, None]
    zero = np.zeros((count, 3))
    lever = np.array([[0.0, 9.80665, 0.0], [-9.80665, 0.0, 0.0], [0.0, 0.0, 0.0]])
    turned_force = 0.5 * np.square(t)[:, None, None] * lever
    half_square = 0.5 * np.square(t)[:, None] * [0.0, 0.0, -9.80665]
    time = np.rint(t * 1e6).astype(np.int64)
    return InertialSteps(time, zero, zero, force, turned, turned_force, zero, zero, half_square, zero)


def gauss_markov(generator: np.random.Generator, steps: int, sigma: float, tau: float) -> np.ndarray:
    """(N, 3) of standard deviation `sigma` that forget over `tau` s."""
    kept = math.exp(-STEP_S / tau)
    drive = generator.normal(size=(steps, 3)) * sigma * math.sqrt(1.0 - kept**2)
    values = [sigma * generator.normal(size=3)]
    for one in drive[1:]:
        values.append(kept * values[-1] + one)
    return np.array(values)


def found(white: float, correlated: float, tau: float, seed: int, seconds: float = 240.0) -> ErrorModel:
    generator = np.random.default_rng(seed)
    sums = still(seconds)
    epoch = np.arange(UPDATES_PER_STEP, sums.time.size, UPDATES_PER_STEP)
    steps = epoch.size
    walks = np.cumsum(generator.normal(size=(2, steps, 3)) * WALK * math.sqrt(STEP_S), axis=1)
    # the attitude walks, too, and lets gravity accelerate the inertial solution
    error = walks[0] + np.cumsum(ROTATION_TO_VELOCITY * 9.80665 * walks[1] * STEP_S, axis=0)
    measured = error + white * generator.normal(size=(steps, 3))
    if tau:
        measured = measured + gauss_markov(generator, steps, correlated, tau)
    model = horizontal_model(Stretch(sums, epoch, measured))
    return likeliest_errors([model], ErrorModel(0.1, 0.0, 0.0, WALK))


@pytest.mark.parametrize("seed", range(3))
def test_white_errors_are_found_white(seed: int) -> None:
    errors = found(0.1, 0.0, 0.0, seed)
    assert errors.is_white
    assert errors.white == pytest.approx(0.1, rel=0.1)
    assert 0.4 * WALK < errors.walk < 2.5 * WALK


@pytest.mark.parametrize("tau", [0.5, 2.0, 4.0])
def test_the_time_over_which_errors_wander_is_found(tau: float) -> None:
    errors = found(0.05, 0.15, tau, seed=5)
    assert 0.5 * tau < errors.correlation_time_s < 2.0 * tau
    # how far 240 s of a process that forgets over τ tell its size: 1/√(2 · 240/τ) is 9 % for 4 s
    assert math.hypot(errors.white, errors.correlated) == pytest.approx(math.hypot(0.05, 0.15), rel=0.4)


def test_all_noises_scale_together() -> None:
    errors = ErrorModel(0.1, 0.2, 3.0, 0.01, (PositionErrors(0.4, 0.05),))
    assert errors.scaled(2.0) == ErrorModel(0.2, 0.4, 3.0, 0.02, (PositionErrors(0.8, 0.1),))


def test_measurements_twice_as_large_have_noises_twice_as_large() -> None:
    """All that scales is searched in ratios; only the walk is drawn to its usual size."""
    sums = still(60.0)
    epoch = np.arange(UPDATES_PER_STEP, sums.time.size, UPDATES_PER_STEP)
    measured = 0.1 * np.random.default_rng(2).normal(size=(epoch.size, 3))
    models = [horizontal_model(Stretch(sums, epoch, scale * measured)) for scale in (1.0, 2.0)]
    one, two = (likeliest_errors([m], ErrorModel(0.1, 0.0, 0.0, WALK)) for m in models)
    assert two.white == pytest.approx(2.0 * one.white, rel=0.03)


def test_heights_do_not_count_in_the_plane() -> None:
    sums = still(20.0)
    epoch = np.arange(UPDATES_PER_STEP, sums.time.size, UPDATES_PER_STEP)
    heights = PositionSeries("baro_hgt", DOWN, np.zeros((epoch.size, 1)), is_delayed=False)
    model = horizontal_model(Stretch(sums, epoch, np.zeros((epoch.size, 3)), (heights,)))
    assert (model.axes, model.series, model.measured.shape[1]) == (2, 0, 2)
