"""The surface against functions that are known, and its formulas against their definitions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.apply.sensitivity.made_trials import drawn, made_trials

from fusetune.apply.sensitivity.kernels import MAIN_EFFECTS, QUADRATIC, SMOOTH, Kernel
from fusetune.apply.sensitivity.surface import HOPELESS, Surface, compressed, fit_surface
from fusetune.apply.trials import Trials


def bowl(at: np.ndarray) -> np.ndarray:
    """A quadratic with an interaction; 0 at the present set."""
    x, y, z = at.T
    return 0.01 * (x**2 + 2.0 * y**2) + 0.02 * x - 0.012 * x * y + 0.005 * z


def fitted(trials: Trials) -> Surface:
    surface = fit_surface(trials)
    assert surface is not None
    return surface


def test_a_quadratic_is_found_again_on_every_flight() -> None:
    surface = fitted(made_trials(drawn(40, 3, reach=2.0), [bowl, lambda at: 0.5 * bowl(at)]))
    assert surface.quality.kernel == QUADRATIC
    fresh = drawn(30, 3, reach=2.0, seed=2)
    assert surface.at(fresh) == pytest.approx(np.column_stack([bowl(fresh), 0.5 * bowl(fresh)]), abs=1e-3)
    assert surface.mean_at(fresh) == pytest.approx(0.75 * bowl(fresh), abs=1e-3)
    assert surface.at(np.zeros((1, 3))) == pytest.approx(np.zeros((1, 2)), abs=1e-15)


def test_a_kink_takes_the_smooth_kernel_and_is_predicted_better() -> None:
    """A gate that closes below the present value: flat above, steep below."""
    trials = made_trials(drawn(60, 2), [lambda at: 0.06 * np.maximum(-at[:, 0], 0.0) + 0.01 * at[:, 1] ** 2])
    surface = fitted(trials)
    fresh = drawn(200, 2, seed=3)
    truth = 0.06 * np.maximum(-fresh[:, 0], 0.0) + 0.01 * fresh[:, 1] ** 2
    left = np.sqrt(np.mean((surface.mean_at(fresh) - truth) ** 2))
    assert surface.quality.kernel == SMOOTH
    # The parabola nearest to 0.06 max(-x, 0) on -3 … 3 is off by 0.06 · 3 / √192 (RMS): |x|/2 less its projection on
    # 1 and x², 1/√192 of the half-width
    assert left < 0.5 * 0.06 * 3.0 / np.sqrt(192.0)
    # and it knows how well it predicts
    assert surface.quality.error == pytest.approx(left, rel=0.7)


def test_leave_one_out_errors_are_those_of_refits() -> None:
    rough = np.random.default_rng(4).normal(0.0, 0.02, 40)
    surface = fitted(made_trials(drawn(40, 3), [lambda at: bowl(at) + rough]))
    trials = made_trials(drawn(40, 3), [lambda at: bowl(at) + rough])
    seen = compressed(trials.differences[:, 0])
    matrix = np.linalg.inv(surface.inverse)
    errors = []
    for row in range(40):
        rest = np.arange(40) != row
        covariance = surface.kernel(surface.places[row : row + 1], surface.places[rest])[0]
        errors.append(seen[row] - covariance @ np.linalg.solve(matrix[np.ix_(rest, rest)], seen[rest]))
    assert surface.quality.error == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-6)
    assert surface.quality.explained == pytest.approx(1.0 - np.mean(np.square(errors)) / np.var(seen), rel=1e-6)


def test_left_out_sets_lie_within_what_it_says_of_its_errors() -> None:
    rough = np.random.default_rng(5).normal(0.0, 0.02, 90)
    surface = fitted(made_trials(drawn(90, 3), [lambda at: bowl(at) + rough]))
    fresh = drawn(60, 3, seed=6)
    errors = surface.mean_at(fresh) + np.random.default_rng(7).normal(0.0, 0.02, 60) - bowl(fresh)
    score = errors / surface.uncertainty(fresh, np.zeros(3))
    assert 0.4 < np.sqrt(np.mean(score**2)) < 1.5


def test_sets_tried_on_some_flights_count_where_they_were() -> None:
    """Of two flights with opposite slopes half of the sets were tried on the first alone, so their mean is a slope."""
    trials = made_trials(drawn(40, 1), [lambda at: 0.04 * at[:, 0], lambda at: -0.04 * at[:, 0]])
    partial = trials.differences.copy()
    partial[::2, 1] = np.nan
    fresh = np.linspace(-3.0, 3.0, 7)[:, None]
    found = fitted(replace(trials, differences=partial)).at(fresh)
    assert found[:, 0] == pytest.approx(0.04 * fresh[:, 0], abs=0.01)
    assert found[:, 1] == pytest.approx(-0.04 * fresh[:, 0], abs=0.01)


def test_few_sets_are_gone_through_and_resolve_their_own_factor_alone() -> None:
    """One at a time, up and down: a parabola through three points of each; the third factor was never moved."""
    coordinates = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 1.0]])
    surface = fitted(made_trials(coordinates, [bowl]))
    assert surface.quality.kernel == MAIN_EFFECTS
    assert surface.at(coordinates[:4])[:, 0] == pytest.approx(bowl(coordinates[:4]), abs=1e-5)
    assert surface.at(np.array([[0.5, 0.0, 0.0]]))[0, 0] == pytest.approx(0.01 * 0.25 + 0.02 * 0.5, abs=1e-5)
    resolution = [surface.resolution(np.eye(3)[[index]] * 0.5, np.zeros(3))[0] for index in range(3)]
    assert resolution[0] > 0.99
    # of a single value only what it shares with half of it: k(0.5, 1) = 0.5 + 0.25, k(1, 1) = 2, k(0.5, 0.5) = 0.3125
    assert resolution[2] == pytest.approx(0.75**2 / (2.0 * 0.3125), abs=0.01)


def test_no_set_beside_the_present_one_has_no_surface() -> None:
    assert fit_surface(made_trials(np.zeros((2, 2)), [lambda at: np.zeros(len(at))])) is None


def test_hopeless_differences_are_compressed() -> None:
    assert compressed(np.array([-1.0, 0.1, HOPELESS, 2.0 * HOPELESS])) == pytest.approx(
        [-1.0, 0.1, 0.25, 0.25 * (1.0 + np.log(2.0))]
    )
    assert np.isnan(compressed(np.array([np.nan]))[0])


@given(st.lists(st.floats(-5.0, 50.0), min_size=2, max_size=20))
def test_compressing_keeps_the_order(values: list[float]) -> None:
    ordered = compressed(np.sort(np.array(values)))
    assert np.all(np.diff(ordered) >= 0.0)


@pytest.mark.parametrize("name", [MAIN_EFFECTS, QUADRATIC, SMOOTH])
def test_kernels_vanish_at_the_present_set_and_are_covariances(name: str) -> None:
    kernel = Kernel(name, np.array([3.0, 2.0]), *((np.ones(2), 5.0) if name == SMOOTH else ()))
    places = drawn(12, 2)
    matrix = kernel(places, places)
    assert kernel(places, np.zeros((1, 2))) == pytest.approx(np.zeros((12, 1)), abs=1e-12)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    assert kernel.variance(places) == pytest.approx(np.diag(matrix))


def test_sets_that_contradict_a_sum_of_effects_are_not_gone_through() -> None:
    """Three sets and the same with another delay, which does 0.05 beside one of them and nothing beside the others:
    no sum of effects does that, and what is left over is not taken for a precise answer."""
    group = np.array([[-1.0, -1.1], [0.5, 0.55], [1.0, 1.1]])
    without, mended = np.column_stack([group, np.zeros(3)]), np.column_stack([group, np.ones(3)])
    effect = np.array([0.02, -0.01, -0.02, 0.02, -0.01, 0.03, 0.0])
    places = np.vstack([without, mended, [[0.0, 0.0, 1.0]]])
    surface = fitted(made_trials(places, [lambda at: effect, lambda at: 1.1 * effect]))
    assert not surface.quality.goes_through
    along = surface.uncertainty(np.array([[0.0, 0.0, 1.0]]), np.zeros(3))[0]
    assert 0.003 < along < 0.1
