"""Shares of evidence that a set lost, by hand."""

from pathlib import Path
from typing import Any

import pytest
from tests.apply.statistics.test_leave_one_out import flight

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.evidence_cost import evidence_lost_percent
from fusetune.apply.settings import DecisionSettings

SETTINGS = DecisionSettings(sources={"gnss_vel": 1.0}, withheld_sources={"gnss_pos": 3.0, "gnss_vel.z": 1.0})


def cost(mask: int, lacking: int = 0, after_reset: int = 0) -> dict[str, int]:
    return {"mask": mask, "lacking": lacking, "after_reset": after_reset}


def flights(*evidence: dict[str, Any]) -> list[AnalyzedFlight]:
    made = []
    for number, one in enumerate(evidence):
        summary, name = {"sets": {"b": {"evidence": one}}}, f"f{number}"
        found = flight(name, [0.0, 0.1])
        made.append(AnalyzedFlight(name, Path(), summary, METRICS_SCHEMA.empty_table(), found))
    return made


def test_samples_and_gaps_have_a_share_each_and_sources_their_weights() -> None:
    """30 of 400 measurements; of gaps (3 · 2 + 1 · 4) of (3 · 20 + 1 · 20): 7.5 and 12.5 %."""
    first = {
        "samples": {"gnss_vel": cost(300, 10, 20), "mag": cost(900, 900)},
        "gaps": {"gnss_pos": cost(10, 1, 1), "gnss_vel": cost(10, 4), "gnss_hgt": cost(10, 10)},
    }
    second = {"samples": {"gnss_vel": cost(100)}, "gaps": {"gnss_pos": cost(10), "gnss_vel": cost(10)}}
    assert evidence_lost_percent("b", flights(first, second), SETTINGS) == pytest.approx(0.5 * (7.5 + 12.5))


def test_without_gaps_the_measurements_count_alone_and_without_either_nothing_is_known() -> None:
    assert evidence_lost_percent("b", flights({"samples": {"gnss_vel": cost(50, 5)}}), SETTINGS) == pytest.approx(10.0)
    assert evidence_lost_percent("b", flights({}), SETTINGS) is None
    assert evidence_lost_percent("unknown", flights({}), SETTINGS) is None
