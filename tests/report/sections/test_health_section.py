"""What is wrong, by finding, and the flights that it is found on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tests.apply.fleet.made_fleet import found, made_diagnosis
from tests.report.read_page import told

from fusetune.report.sections.flights_section import Logs
from fusetune.report.sections.health_section import health_answer, health_section


def logs_of(diagnoses: Sequence[dict[str, Any]]) -> Logs:
    verdicts = [{"flight": one["flight"], "recorded": ""} for one in diagnoses]
    pages = [f"results/report/flights/{one['flight']}.html" for one in diagnoses if one["flight"] != "unlinked"]
    return Logs.of(verdicts, diagnoses, [], pages, "results/report.html")


def test_a_finding_is_one_row_with_its_flights_the_worst_first() -> None:
    logs = logs_of(
        [
            made_diagnosis("a<1>", [found("vibration", "warning", 0.7), found("gnss_delay", "note", 0.6)]),
            made_diagnosis("unlinked", [found("vibration", "fail", 0.97)]),
            made_diagnosis("sound", []),
        ]
    )
    section = health_section(logs)
    first, second = section.split("<tr>")[2:]
    assert 'id="cause-vibration"' in first
    assert "do not fly like this" in first
    assert "2 flights: a&lt;1&gt;, unlinked" in told(first)
    assert '<a href="report/flights/a%3C1%3E.html#at=cause-vibration">a&lt;1&gt;</a>' in first
    assert "70 to 97 %" in told(first)
    assert "possible (60 %)" in told(second)
    assert "<a<1>" not in section


def test_the_answer_counts_each_log_once_by_its_worst() -> None:
    logs = logs_of(
        [
            made_diagnosis("bad", [found("vibration", "warning"), found("gnss_loss", "fail")]),
            made_diagnosis("sound", []),
            made_diagnosis("x", [], "the log is empty", readable=False),
        ]
    )
    words = told(health_answer(logs))
    assert words.startswith("1 of 3 logs show what must be mended before flying again")
    assert "do not fly like this 1 nothing found 1 tells too little 1" in words


def test_logs_that_tell_nothing_are_not_counted_as_sound() -> None:
    silent = [made_diagnosis(name, [], "the log is empty", readable=False) for name in ("x", "y")]
    words = told(health_section(logs_of([made_diagnosis("sound", []), *silent])))
    assert "2 logs tell too little to say whether anything is wrong" in words
    assert "x, y the log is empty Log the flight again" in words, "a reason is told once"
    assert "These logs tell too little" in health_answer(logs_of(silent))


def test_where_nothing_is_wrong_there_is_no_section() -> None:
    logs = logs_of([made_diagnosis("a", [])])
    assert health_section(logs) == ""
    assert "No cause of trouble shows on 1 of 1 log" in health_answer(logs)


def test_more_findings_than_a_screen_holds_are_behind_a_click() -> None:
    causes = [found(f"cause_{number}", "note") for number in range(11)]
    section = health_section(logs_of([made_diagnosis("a", causes)]))
    assert "3 more findings" in section
    assert section.count('id="cause-') == 11
