"""Flights with findings on the page of the decision."""

from __future__ import annotations

import re
from pathlib import Path

from tests.apply.fleet.made_fleet import found, made_diagnosis

from fusetune.report.sections.health_section import health_section

RESULTS = Path("results")
PAGES = {"worst": RESULTS / "report" / "flights" / "worst.html"}


def test_the_worst_flight_stands_first_with_a_link_to_its_page() -> None:
    diagnoses = [
        made_diagnosis("sound", []),
        made_diagnosis("mild", [found("gnss_delay", "note", 0.6)]),
        made_diagnosis("worst", [found("baro_drift", "warning"), found("vibration", "fail", 0.97)]),
    ]
    section = health_section(diagnoses, PAGES, RESULTS / "report.html")
    first, second = section.split("<tr>")[2:]
    assert '<a href="report/flights/worst.html">worst</a>' in first
    # the cause that explains most is told, the severity is the worst one
    assert "It is baro_drift (and 1 more)" in first
    assert "do not fly like this" in first
    assert ">mild<" in second
    assert "possible (60 %)" in second
    assert "On 1 of 3 flights no cause of trouble was found." in re.sub("&nbsp;", " ", section)


def test_without_diagnoses_there_is_no_section_and_without_findings_no_table() -> None:
    assert health_section([], {}, "report.html") == ""
    section = health_section([made_diagnosis("a", [])], {}, "report.html")
    assert "<table" not in section
    assert "On 1 of 1 flight no cause of trouble was found." in section


def test_logs_that_tell_nothing_are_not_counted_as_sound() -> None:
    diagnoses = [made_diagnosis("sound", []), made_diagnosis("x", [], "the log is empty", readable=False)]
    section = re.sub("&nbsp;", " ", health_section(diagnoses, {}, "report.html"))
    assert "On 1 of 2 flights no cause of trouble was found." in section
    assert "1 log tells nothing, or too little to say whether anything is wrong" in section
    assert "<td>the log is empty</td><td>Log the flight again</td>" in section
