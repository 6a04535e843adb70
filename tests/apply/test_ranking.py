"""What the ranking says of a set beside its own figures."""

from pathlib import Path

import numpy as np
import pytest
from tests.apply.statistics.test_leave_one_out import flight

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.ranking import proved_sets, rank
from fusetune.apply.settings import DecisionSettings


def analyzed(number: int, scores: list[float]) -> AnalyzedFlight:
    one = flight(str(number), scores)
    summary = {"sets": {name: {"same_results_as_present": False} for name in one.sets}}
    return AnalyzedFlight(one.flight, Path(), summary, METRICS_SCHEMA.empty_table(), one, "")


def test_sets_are_measured_against_the_best_proved_one() -> None:
    """b and d are surely better than a; c is so on the average, but not on every flight."""
    settings = DecisionSettings(draws=2000)
    small, large = np.array([1.0, -1.0] * 4), np.array([1.0, 1.0, -1.0, -1.0] * 2)
    columns = np.column_stack([np.zeros(8), -0.1 + 0.01 * small, -0.12 + 0.3 * large, -0.095 + 0.01 * large])
    flights = [analyzed(number, list(row)) for number, row in enumerate(columns)]
    found = {one.name: one for one in rank("abcd", "a", flights, {}, settings)}
    assert found["c"].is_eligible
    assert found["c"].score < found["b"].score
    assert [one.name for one in proved_sets(list(found.values()), settings)] == ["b", "d"]
    assert (found["b"].behind_best, found["b"].behind_best_error) == (0.0, 0.0)
    assert found["d"].behind_best == pytest.approx(0.005)
    # d less b is 0.005 + 0.01 (large − small), with values 0 and ±2 in parentheses, mean square 2, on 8 flights
    assert found["d"].behind_best_error == pytest.approx(0.01 * np.sqrt(2.0 / 8.0), rel=0.06)


def test_without_a_proved_set_all_that_may_be_flown_count() -> None:
    noise = np.array([1.0, -1.0] * 3)
    flights = [analyzed(number, [0.0, -0.01 + 0.5 * one]) for number, one in enumerate(noise)]
    found = {one.name: one for one in rank("ab", "a", flights, {}, DecisionSettings(draws=500))}
    assert found["a"].behind_best == pytest.approx(0.01)
    assert found["b"].behind_best == 0.0
