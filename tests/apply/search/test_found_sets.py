"""What is told of what a search found."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from fusetune.apply.search.found_sets import nothing_found, write_search_document
from fusetune.design.search_settings import SearchSettings

ROW: dict[str, Any] = {"name": "found", "difference": -0.1, "lower": -0.15, "upper": -0.05, "error": 0.02}


def expected(tmp_path: Path, row: dict[str, Any], spread: float) -> dict[str, float | None]:
    found = nothing_found(SearchSettings(), {})
    found.document["spread_of_searches"] = spread  # type: ignore[index]
    decision = {"ranking": [row], "status": "keep", "exploratory": False, "paragraphs": []}
    told = write_search_document(tmp_path / "search.json", found, decision)["expected_gain"]
    assert isinstance(told, dict)
    return told


def test_the_interval_of_the_gain_is_that_of_as_many_flights_again_and_of_what_searches_find(tmp_path: Path) -> None:
    # half of the interval is 2.5 errors of 0.02; on as many flights again √2 of these, and the spread on top
    told = expected(tmp_path, ROW, 0.03)
    half = 2.5 * math.sqrt(2 * (1.1 * 0.02) ** 2 + 0.03**2)
    assert told["percent"] == pytest.approx(100 * (1 - math.exp(-0.1)))
    assert told["lower_percent"] == pytest.approx(100 * (1 - math.exp(-0.1 + half)))
    assert told["upper_percent"] == pytest.approx(100 * (1 - math.exp(-0.1 - half)))


def test_where_nothing_shows_the_spread_there_is_no_interval(tmp_path: Path) -> None:
    told = expected(tmp_path, ROW | {"lower": None, "upper": None, "error": None}, 0.03)
    assert (told["lower_percent"], told["upper_percent"]) == (None, None)
