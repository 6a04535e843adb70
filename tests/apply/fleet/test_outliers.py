"""Flights unlike the others of their vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from tests.apply.fleet.made_fleet import made_table

from fusetune.apply.fleet.distribution import robust_scale
from fusetune.apply.fleet.outliers import outliers


def normal(flights: int, figures: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(flights, figures))


def test_a_flight_far_off_is_named_in_the_figure_in_which_it_is() -> None:
    values = normal(20, 30)
    values[7, 11] = 15.0
    (found,) = outliers(made_table(values))
    assert (found.flight, found.id, found.value) == ("flight_7", "gnss.figure_11", 15.0)
    column = values[:, 11]
    assert found.usual == pytest.approx(np.median(column))
    assert found.z == pytest.approx((15.0 - np.median(column)) / robust_scale(column))
    assert found.chance < 0.05


def test_figures_above_zero_are_compared_by_factors() -> None:
    """e² of a spread of e^0.1 lies 20 standard deviations off; the same below, at e⁻², too."""
    values = np.exp(0.1 * normal(20, 5))
    values[3, 2], values[4, 2] = np.exp(2.0), np.exp(-2.0)
    found = {one.flight: one.z for one in outliers(made_table(values))}
    assert set(found) == {"flight_3", "flight_4"}
    assert found["flight_3"] > 10
    assert found["flight_4"] < -10


def test_what_is_far_off_and_yet_no_matter_is_not_named() -> None:
    values = 200.0 + 0.01 * normal(20, 3)
    values[5, 1] = 201.0
    assert not outliers(made_table(values))


def test_what_many_flights_show_is_another_way_of_flying() -> None:
    values = 5.0 + 0.001 * normal(20, 2)
    values[:6, 0] = 10.0
    assert not outliers(made_table(values))


def test_few_flights_do_not_tell() -> None:
    values = normal(9, 3)
    values[0, 0] = 1e6
    assert not outliers(made_table(values))


def test_where_nothing_is_wrong_next_to_nothing_is_named() -> None:
    """At most 5 of 100 fleets are to name anything; of 100, more than 13 have a chance of 0.0005 (binomial)."""
    named = [bool(outliers(made_table(normal(12, 20, seed)))) for seed in range(100)]
    assert sum(named) <= 13
