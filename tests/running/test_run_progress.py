"""How far a run is, from made events."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusetune.running.run_progress import ASKED_LATER, COSTS_S, UNSTEADY, RunProgress
from fusetune.running.workflow_events import Counted, JobBegun, JobDone, JobFailed, Planned


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def work(progress: RunProgress, number: int, rule: str, flight: str = "") -> None:
    progress.take(JobBegun(number, rule, rule, flight))
    progress.take(JobDone(number))


def test_share_and_time_left_follow_from_what_jobs_cost() -> None:
    """Two flights: 2 × (0.25 + 2) + 0.4 of the list; when 0.5 + 0.4 + 2 = 2.9 of 4.9 took 14.5 s, 10 s are left."""
    clock = Clock()
    clock.now = -5.0
    progress = RunProgress(clock)
    progress.take(Planned({"save_flight": 2, "list_flights": 1}))
    assert progress.flights == 2
    # planning is no part of the pace
    clock.now = 0.0
    for number in (1, 2):
        work(progress, number, "save_flight", f"flight_{number}")
    assert progress.share == pytest.approx(0.5 / 4.9)
    assert progress.left_s is None, "too little is done"
    work(progress, 3, "list_flights")
    work(progress, 4, "analyze_flight", "flight_1")
    clock.now = 14.5
    progress.take(Counted(4, 5))
    assert (progress.done, progress.total) == (4, 5)
    assert progress.share == pytest.approx(2.9 / 4.9)
    assert progress.left_s == pytest.approx(10.0)
    assert (progress.flights_done, progress.flights) == (1, 2)


def test_a_job_that_was_not_planned_counts_when_it_begins() -> None:
    progress = RunProgress(Clock())
    progress.take(Planned({"tell_flight": 1}))
    work(progress, 1, "tell_flight", "one")
    assert progress.share == 1.0
    progress.take(JobBegun(2, "tell_flight", "words", "two"))
    assert progress.share == 0.5
    assert [job.words for job in progress.now.values()] == ["words"]
    progress.take(JobFailed(2, "tell_flight", "two", ""))
    assert not progress.now


def test_compiling_says_nothing_of_the_time_left() -> None:
    clock = Clock()
    progress = RunProgress(clock)
    progress.take(Planned({UNSTEADY: 1, "tell_flight": 4}))
    progress.take(JobBegun(1, UNSTEADY, "compile", ""))
    clock.now = 100.0
    assert progress.left_s is None
    progress.take(JobDone(1))
    for number in (2, 3, 4):
        work(progress, number, "tell_flight", str(number))
    clock.now = 106.0
    assert progress.left_s == pytest.approx(2.0)


def test_rules_that_are_named_exist(project_root: Path) -> None:
    text = "\n".join(file.read_text(encoding="utf-8") for file in (project_root / "workflow" / "rules").glob("*.smk"))
    rules = set(re.findall(r"^\s*(?:rule|checkpoint) (\w+):", text, re.MULTILINE))
    rules |= set(re.findall(r'name:\s+f?"(\w+?)_?\{', text))
    assert {*COSTS_S, *ASKED_LATER, UNSTEADY} <= rules
    assert {name for later in ASKED_LATER.values() for pair in later.items() for name in pair} <= rules
