"""What was flown, on the pages: verdict, map, legs; the sets by manoeuvre."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest
from benchmarks.conformance import SHAPES, mission_of
from tests.analyze.conformance.made_track import flown_in_order, track_of
from tests.report.read_page import told

from fusetune.analyze.conformance.conformance_files import conformance_document, rounded_figures
from fusetune.analyze.conformance.mission_totals import mission_totals
from fusetune.px4.flight import Flight
from fusetune.report.flight_page import conformance_section as of_flight
from fusetune.report.results import Results
from fusetune.report.sections.conformance_section import conformance_section, not_flown


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """A box of which the third waypoint was left out."""
    asked = mission_of("box", SHAPES["box"]())
    track = track_of(flown_in_order(asked, [0, 1, 3, 4, 5, 6, 7]))
    return cast(dict[str, Any], rounded_figures(conformance_document(Flight("boxed"), track, [asked])))


def test_the_page_of_a_flight_says_what_was_flown_over_its_map(document: dict[str, Any]) -> None:
    asked = mission_of("box", SHAPES["box"]())
    track = track_of(flown_in_order(asked, [0, 1, 3, 4, 5, 6, 7]))
    page = told(of_flight.conformance_section(document, track))
    assert "It flew a part of the mission box: it missed waypoint 3 of 8 waypoints" in page
    assert "to waypoint 3 not flown" in page
    assert "3 missed" in page
    assert "straight" in page


def test_the_page_of_the_decision_has_the_sets_by_manoeuvre_and_the_legs(document: dict[str, Any]) -> None:
    row = {"name": "better", "mission": "", "leg": None, "manoeuvre": "turn", "flights": 4, "difference": -0.1278,
           "lower": -0.2, "upper": -0.05}  # fmt: skip
    rows = [
        row,
        row | {"manoeuvre": "hover", "difference": 0.0, "lower": None, "upper": None, "flights": 3},
        row | {"manoeuvre": "", "mission": "box", "leg": 1},
    ]
    results = cast(Results, SimpleNamespace(decision={"by_manoeuvre": rows}, shown=("present", "better")))
    page = told(conformance_section(results, mission_totals([document])))
    assert "0 flights flew the mission box, 1 in part or otherwise (boxed)." in page
    # e^-0.1278 − 1
    assert "turn (4)" in page
    assert "−12.0 (−18.1 to −4.9)" in page
    assert "hover (3)" in page
    assert "The sets on each leg of box" in page
    assert "Legs of box" in page
    assert conformance_section(cast(Results, SimpleNamespace(decision={}, shown=())), []) == ""


def test_of_a_mission_that_nobody_flew_there_is_a_line_and_no_section(document: dict[str, Any]) -> None:
    (mission,) = mission_totals([document])
    flown = {how: [] for how in mission["flights"]} | {"not this mission": ["boxed"]}
    unflown = [mission | {"flights": flown, "legs": []}]
    assert not_flown(unflown) == ["No flight flew the mission box."]
    assert conformance_section(cast(Results, SimpleNamespace(decision={}, shown=())), unflown) == ""
