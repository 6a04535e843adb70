"""One step ahead a filter that follows its receiver's wander predicts best: alone, that decides nothing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.choice import choose
from fusetune.apply.evidence import (
    MISLEADING,
    AnalyzedFlight,
    BlockSums,
    NoEvidence,
    _why_misleading,
    flight_evidence,
)
from fusetune.apply.ranking import rank
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.wording import paragraph

N = np.full((2, 1), 10.0)
AIDED_SUMS = BlockSums(("a", "b"), (("gnss_vel", "gnss_vel x"),), N, np.stack([N, 0.5 * N]), np.zeros((2, 2, 1)))


@pytest.mark.parametrize(("white_share", "has_evidence"), [(0.01, False), (0.6, False), (0.61, True), (0.95, True)])
def test_aided_predictions_alone_count_only_as_far_as_they_can_be_trusted(
    white_share: float, has_evidence: bool
) -> None:
    found = flight_evidence("f", AIDED_SUMS, None, {"gnss_vel": white_share}, DecisionSettings())
    assert (found is not None) == has_evidence


def test_where_nothing_can_be_trusted_the_answer_says_so() -> None:
    why = _why_misleading(AIDED_SUMS, {"gnss_vel": 0.01}, DecisionSettings())
    assert "white share of gnss_vel 0.01" in why
    flights = [
        AnalyzedFlight(f"f{number}", Path(), {"scored_s": 8.0, "sets": {}}, METRICS_SCHEMA.empty_table(), None,
                       NoEvidence(MISLEADING, why))
        for number in range(5)
    ]  # fmt: skip
    settings = DecisionSettings()
    ranked = rank(["a", "b"], "a", flights, {}, settings)
    choice = choose(ranked, "a", [], {}, settings)
    assert (choice.status, choice.chosen) == ("no_evidence", "a")
    text = paragraph(choice, ranked, flights, settings)
    assert text.startswith("Keep the parameters that fly now: none of the 5 replayed flights has a say")
    assert "nothing on this flight can be trusted to tell sets apart" in text
    assert not math.isfinite(ranked[0].score)
