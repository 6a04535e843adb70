"""Effects of several flights together, by hand."""

import math

import numpy as np
import pytest

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.pooled import pooled
from fusetune.analyze.metrics.random_effects import random_effects

T_OF_ONE = 12.7062047
"""97.5 % quantile of Student's t with one degree of freedom."""


def told(name: str, value: float, error: float = 0.1, now: float | None = 0.15) -> Effect:
    return Effect("drag", (Estimate(name, "1/s", now, value, value - 2 * error, value + 2 * error, error, 100),))


def test_flights_that_differ_by_more_than_their_errors_widen_the_interval() -> None:
    """1 and 3, each ± 0.1: mean 2; the scatter gives √(2/2) = 1 for its error, whatever the flights promise."""
    one = pooled([told("EKF2_MCOEF", 1.0), told("EKF2_MCOEF", 3.0)])["EKF2_MCOEF"]
    assert one.value == pytest.approx(2.0)
    assert one.standard_error == pytest.approx(1.0)
    assert one.upper == pytest.approx(2.0 + T_OF_ONE)
    assert one.n == 200
    assert not one.is_apart_from_told


def test_flights_that_agree_are_as_good_as_they_promise() -> None:
    """Weights 100 and 25: mean (100·1 + 25·1.05)/125 = 1.01, error 1/√125."""
    found = random_effects([1.0, 1.05], [0.1, 0.2])
    assert found.mean == pytest.approx(1.01)
    assert found.standard_error == pytest.approx(1.0 / math.sqrt(125.0))
    assert found.between == 0.0


def test_of_a_single_flight_its_own_interval_stands() -> None:
    effect = told("EKF2_MCOEF", 0.4, error=0.05)
    assert pooled([effect, Effect("drag", refusal="nothing")])["EKF2_MCOEF"] == effect.estimates[0]
    assert effect.estimates[0].is_apart_from_told


def test_ballistic_coefficients_are_pooled_as_their_reciprocals() -> None:
    """1/20 and 1/30, whose errors are alike: mean 1/24."""
    flights = [told("EKF2_BCOEF_X", 20.0, error=0.4), told("EKF2_BCOEF_X", 30.0, error=0.9)]
    assert pooled(flights)["EKF2_BCOEF_X"].value == pytest.approx(24.0)


def test_what_the_newest_flight_was_told_counts() -> None:
    flights = [told("EKF2_MCOEF", 0.3, now=0.15), told("EKF2_MCOEF", 0.3, now=0.3)]
    assert pooled(flights)["EKF2_MCOEF"].told == 0.3


def test_a_value_without_an_error_is_joined_too() -> None:
    """The least noise of the drag that EKF2 takes is the same on every flight."""
    one = pooled([told("EKF2_DRAG_NOISE", 0.5, error=0.0)] * 3)["EKF2_DRAG_NOISE"]
    assert one.value == 0.5
    assert np.isfinite([one.lower, one.upper]).all()
