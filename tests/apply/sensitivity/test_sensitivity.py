"""What is told of parameters whose effects are known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.apply.sensitivity.made_trials import NAMES, drawn, made_trials

from fusetune.apply.sensitivity.result import FLAT, MATTERS, NOT_TOLD
from fusetune.apply.sensitivity.sensitivity import sensitivity

GNSS, ACCELEROMETER, BAROMETER = NAMES[:3]


def flights_of(slopes: np.ndarray):  # type: ignore[no-untyped-def]
    """Flights on which the first factor has a curve of its own, the second a slope, and the third nothing."""
    return [lambda at, one=one: one * at[:, 0] ** 2 - 0.02 * at[:, 1] + 0.0003 * at[:, 2] for one in slopes]


@pytest.fixture(scope="module")
def told():  # type: ignore[no-untyped-def]
    slopes = np.array([0.030, 0.035, 0.045, 0.032, 0.040, 0.038])
    return sensitivity(made_trials(drawn(60, 3), flights_of(slopes)))


def test_what_matters_matters_and_the_flat_one_is_flat(told) -> None:  # type: ignore[no-untyped-def]
    by_name = {one.parameter: one for one in told.parameters}
    assert [by_name[name].verdict for name in (GNSS, ACCELEROMETER, BAROMETER)] == [MATTERS, MATTERS, FLAT]
    assert [one.parameter for one in told.of_verdict(MATTERS)] == [GNSS, ACCELEROMETER]
    # within a factor of two the mean changes by 0.0367 · 1² and 0.02 · 1
    assert by_name[GNSS].change == pytest.approx(0.0367, abs=2e-3)
    assert by_name[ACCELEROMETER].change == pytest.approx(0.02, abs=2e-3)


def test_the_flat_one_could_be_anything_that_was_tried(told) -> None:  # type: ignore[no-untyped-def]
    flat = told.parameters[2]
    assert flat.same_within == pytest.approx(flat.tried)
    # 0.0367 c² = ln 1.01 at c = 0.521, on a grid of 6/40
    low, high = told.parameters[0].same_within
    assert np.log2(high / 0.3) == pytest.approx(0.521, abs=0.16)
    assert np.log2(low / 0.3) == pytest.approx(-0.521, abs=0.16)


def test_a_best_at_the_end_is_not_determined(told) -> None:  # type: ignore[no-untyped-def]
    assert [one.at_bound for one in told.parameters] == [False, True, False]


def test_parameters_that_move_together_are_not_told() -> None:
    """As in the paper's study: four sets, all parameters up and down together."""
    steps = np.array([-1.5, 0.5, 1.0, 2.0])
    coordinates = np.column_stack([steps, 1.1 * steps, 0.9 * steps])
    found = sensitivity(made_trials(coordinates, flights_of(np.array([0.03, 0.04, 0.05]))))
    assert [one.verdict for one in found.parameters] == [NOT_TOLD] * 3
    assert [(one.curve, one.first, one.same_within) for one in found.parameters] == [(None, None, None)] * 3
    assert found.trade_offs == ()


def test_around_an_incumbent_the_others_are_held_there() -> None:
    """With an interaction x y the slope along x at y = 1 is 0.05; at y = 0 there is none."""
    trials = made_trials(drawn(60, 2), [lambda at, s=s: s * at[:, 0] * at[:, 1] for s in (0.04, 0.05, 0.06)])
    at_one = sensitivity(trials, [0.3, 0.6]).parameters[0]
    assert at_one.curve is not None
    slope = np.polyfit(np.log2(np.array(at_one.curve.values) / 0.3), at_one.curve.differences, 1)[0]
    assert slope == pytest.approx(0.05, abs=3e-3)
    assert at_one.incumbent == pytest.approx(0.3)
    # the other at its best within its neighbourhood -1 … 2, where x is 1: y = -1
    best = np.interp(0.6, at_one.curve.values, at_one.curve.others_at_best)
    assert best == pytest.approx(-0.05, abs=5e-3)
    at_present = sensitivity(trials).parameters[0]
    assert at_present.verdict == FLAT


def test_the_interval_covers_the_true_change() -> None:
    """A parabola whose height differs from flight to flight, drawn anew: the mean over all flights lies within."""
    coordinates = drawn(24, 2)
    generator = np.random.default_rng(11)
    held = 0
    for _ in range(40):
        slopes = generator.normal(0.03, 0.015, 6)
        trials = made_trials(coordinates, [lambda at, s=s: s * at[:, 0] ** 2 + 0.01 * at[:, 1] for s in slopes])
        curve = sensitivity(trials).parameters[0].curve
        assert curve is not None
        low, high = (np.interp(0.6, curve.values, ends) for ends in (curve.lower, curve.upper))
        held += low <= 0.03 <= high
    # 95 % wanted; of 40 draws with that rate fewer than 34 have a chance of 0.3 %, by the binomial distribution
    assert held >= 34


def test_of_one_flight_no_interval_is_known() -> None:
    one = sensitivity(made_trials(drawn(30, 2), [lambda at: 0.03 * at[:, 0] ** 2])).parameters[0]
    assert one.curve is not None
    assert one.curve.lower == ()
    assert one.verdict == "unsure"
    assert one.total_interval is None


def test_sets_without_any_score_are_left_out() -> None:
    trials = made_trials(drawn(20, 2), [lambda at: 0.03 * at[:, 0]] * 3)
    silent = trials.differences.copy()
    silent[3] = np.nan
    found = sensitivity(replace(trials, differences=silent))
    assert found.quality is not None
    assert found.quality.sets == 19
    assert "set3" not in [one.name for one in found.tried]


def test_sets_that_do_nothing_at_all_are_flat() -> None:
    found = sensitivity(made_trials(drawn(30, 2), [lambda at: np.zeros(len(at))] * 3))
    assert [one.verdict for one in found.parameters] == [FLAT, FLAT]
    assert found.spread is None


def test_a_factor_that_no_set_changes_is_not_told_and_spoils_nothing() -> None:
    coordinates = drawn(40, 3)
    coordinates[:, 2] = 0.0
    found = sensitivity(made_trials(coordinates, flights_of(np.array([0.03, 0.04, 0.05]))))
    assert [one.verdict for one in found.parameters] == [MATTERS, MATTERS, NOT_TOLD]
