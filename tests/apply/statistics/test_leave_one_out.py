"""Choices judged on the flight that had no part in them."""

import numpy as np
import pytest
from scipy import stats

from fusetune.apply.evidence import AIDED, AimEvidence, FlightEvidence
from fusetune.apply.statistics.leave_one_out import leave_one_out


def flight(name: str, scores: list[float]) -> FlightEvidence:
    """One flight with given scores: one column whose ½ ln(ν²) is the score."""
    nis = np.exp(2.0 * np.array(scores)).reshape(-1, 1, 1)
    part = AimEvidence(AIDED, 1.0, ("x",), np.ones(1), np.ones((1, 1)), nis, np.zeros_like(nis))
    return FlightEvidence(name, tuple("abcdefgh"[: len(scores)]), (part,))


def test_by_hand() -> None:
    flights = [flight("1", [0.0, -0.2, 0.1]), flight("2", [0.0, -0.1, -0.3]), flight("3", [0.0, -0.3, 0.2])]
    found = leave_one_out(flights, ["b", "c"], "a", 0.95)
    assert found is not None
    # Sums of b: −0.6, of c: 0.0. Without any flight b stays ahead: −0.4/−0.1, −0.5/+0.3, −0.3/−0.2.
    assert found.chosen == {"1": "b", "2": "b", "3": "b"}
    assert found.stays == 3
    assert found.difference == pytest.approx(-0.2)
    reach = stats.t.ppf(0.975, 2) * 0.1 / np.sqrt(3)
    assert (found.lower, found.upper) == (pytest.approx(-0.2 - reach), pytest.approx(-0.2 + reach))


def test_a_choice_that_rests_on_one_flight_is_worth_nothing_there() -> None:
    flights = [flight("1", [0.0, -3.0]), flight("2", [0.0, 0.1]), flight("3", [0.0, 0.1]), flight("4", [0.0, 0.1])]
    found = leave_one_out(flights, ["b"], "a", 0.95)
    assert found is not None
    # From all flights b looks best; without flight 1 the present set is, and with it b is 0.1 worse on the others.
    assert found.chosen["1"] == "a"
    assert found.differences == pytest.approx({"1": 0.0, "2": 0.1, "3": 0.1, "4": 0.1})
    assert found.stays == 3


def test_two_flights_are_too_few() -> None:
    assert leave_one_out([flight("1", [0.0, -1.0])] * 2, ["b"], "a", 0.95) is None
