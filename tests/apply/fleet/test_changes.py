"""Steps and drifts of a vehicle's figures over its flights."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.stats import ranksums, spearmanr
from tests.apply.fleet.made_fleet import date, made_table

from fusetune.apply.fleet import changes as module
from fusetune.apply.fleet.changes import changes, family_chances, largest_steps, rank_correlations


@pytest.fixture(autouse=True)
def _fewer_shuffles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SHUFFLES", 499)


def flown(flights: int, figures: int, seed: int = 0) -> np.ndarray:
    """Figures that hang together: half of their variance is the flight's."""
    draw = np.random.default_rng(seed)
    return draw.normal(size=(flights, 1)) + draw.normal(size=(flights, figures))


def test_a_step_is_found_where_it_is() -> None:
    values = flown(24, 12)
    values[15:, 4] += 12.0
    firmware = ["v1.15.4"] * 15 + ["v1.16.0"] * 9
    steps, drifts = changes(made_table(values, firmware=firmware))
    (step,) = steps
    assert not drifts
    assert (step.id, step.flight, step.date) == ("gnss.figure_4", "flight_15", date(15))
    assert (step.flights_before, step.flights_after) == (15, 9)
    assert step.before == pytest.approx(np.median(values[:15, 4]))
    assert step.after == pytest.approx(np.median(values[15:, 4]))
    assert step.along == ("firmware",)
    assert step.chance <= 0.05


def test_two_steps_are_found_one_after_the_other() -> None:
    values = flown(40, 5, seed=1)
    values[12:, 2] += 15.0
    values[28:, 2] += 15.0
    steps, _ = changes(made_table(values))
    assert {one.flight for one in steps} == {"flight_12", "flight_28"}
    assert {one.id for one in steps} == {"gnss.figure_2"}


def test_a_drift_is_told_as_one() -> None:
    """Half a metre per flight is five per ten."""
    values = flown(24, 8)
    values[:, 3] = 0.5 * np.arange(24) + 0.3 * np.random.default_rng(2).normal(size=24)
    steps, (drift,) = changes(made_table(values))
    assert not steps
    assert (drift.id, drift.flights) == ("gnss.figure_3", 24)
    assert drift.lower < 5.0 < drift.upper
    assert drift.per_ten_flights == pytest.approx(5.0, rel=0.1)


def test_flights_that_do_not_tell_a_figure_are_passed_over() -> None:
    values = flown(30, 6)
    values[16:, 1] += 12.0
    values[[2, 9, 17, 18], 1] = np.nan
    steps, _ = changes(made_table(values))
    (step,) = [one for one in steps if one.id == "gnss.figure_1"]
    # flights 16 … 29 less two; before them 16 less two
    assert (step.flight, step.flights_before, step.flights_after) == ("flight_16", 14, 12)


def test_without_dates_or_with_few_flights_nothing_is_said() -> None:
    values = flown(24, 3)
    values[12:] += 20.0
    assert changes(made_table(values, dated=False)) == ((), ())
    assert changes(made_table(values[9:14])) == ((), ())


def test_a_step_that_does_not_matter_is_not_told() -> None:
    values = 200.0 + 0.01 * flown(24, 3)
    values[12:, 0] += 1.0
    assert changes(made_table(values))[0] == ()


def test_where_nothing_changes_next_to_nothing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps and drifts each in 5 of 100 fleets: of 60, more than 13 have a chance of 0.003 (binomial of 0.1)."""
    monkeypatch.setattr(module, "SHUFFLES", 199)
    named = 0
    for seed in range(60):
        steps, drifts = changes(made_table(np.where(flown(16, 8, seed) < 0.5, 0.0, flown(16, 8, seed))))
        named += bool(steps or drifts)
    assert named <= 13


def centred_ranks(series: np.ndarray) -> np.ndarray:
    return (np.argsort(np.argsort(series)) - 0.5 * (series.size - 1))[:, None]


def test_steps_are_wilcoxons_statistic_and_drifts_are_spearmans() -> None:
    series = np.random.default_rng(5).normal(size=15)
    ranks = centred_ranks(series)
    squares, known = (ranks**2).sum(axis=0), np.ones(ranks.shape, dtype=bool)
    expected = max(abs(ranksums(series[:cut], series[cut:]).statistic) for cut in range(3, 13))
    assert largest_steps(ranks, squares, known)[0] == pytest.approx(expected)
    rho = spearmanr(series, np.arange(15)).statistic
    assert rank_correlations(ranks, squares, known)[0] == pytest.approx(abs(rho) * np.sqrt(14))


def test_the_chance_of_a_step_is_its_share_of_all_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 7 flights all 5040 orders can be counted."""
    monkeypatch.setattr(module, "SHUFFLES", 4999)
    series = np.array([0.1, 0.4, 0.2, 0.9, 1.3, 1.1, 1.2])
    ranks = centred_ranks(series)
    squares, known = (ranks**2).sum(axis=0), np.ones(ranks.shape, dtype=bool)
    seen = largest_steps(ranks, squares, known)[0]
    orders = [largest_steps(ranks[list(order)], squares, known)[0] for order in permutations(range(7))]
    exact = np.mean(np.array(orders) >= seen - 1e-9)
    assert family_chances(series[:, None], largest_steps)[0] == pytest.approx(exact, abs=4 * np.sqrt(exact / 5000))
