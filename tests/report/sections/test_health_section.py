"""Flights with findings on the page of the decision."""

from __future__ import annotations

import re
from pathlib import Path

from tests.apply.fleet.made_fleet import found

from fusetune.report.sections.health_section import health_section

RESULTS = Path("results")
PAGES = {"worst": RESULTS / "report" / "flights" / "worst.html"}


def test_the_worst_flight_stands_first_with_a_link_to_its_page() -> None:
    diagnoses = [
        {"flight": "sound", "diagnoses": []},
        {"flight": "mild", "diagnoses": [found("gnss_delay", "note", 0.6)]},
        {"flight": "worst", "diagnoses": [found("baro_drift", "warning"), found("vibration", "fail", 0.97)]},
    ]
    section = health_section(diagnoses, PAGES, RESULTS / "report.html")
    first, second = section.split("<tr>")[2:]
    assert '<a href="report/flights/worst.html">worst</a>' in first
    # the cause that explains most is told, the severity is the worst one
    assert "It is baro_drift (and 1 more)" in first
    assert "do not fly like this" in first
    assert ">mild<" in second
    assert "possible (60 %)" in second
    assert "On 1 of 3 flights nothing wrong was found." in re.sub("&nbsp;", " ", section)


def test_without_diagnoses_there_is_no_section_and_without_findings_no_table() -> None:
    assert health_section([], {}, "report.html") == ""
    section = health_section([{"flight": "a", "diagnoses": []}], {}, "report.html")
    assert "<table" not in section
    assert "On 1 of 1 flight nothing wrong was found." in section
