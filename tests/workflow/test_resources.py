"""What the jobs ask for: enough for what was measured, more for a larger log and at another attempt, in every rule."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

FULL_RATE_MB, THINNED_MB = 271e6, 134e6
"""Sizes of simulated logs of 60 minutes; benchmarks/long_flights.py."""


@pytest.fixture
def resources(project_root: Path, tmp_path: Path) -> dict[str, Any]:
    logs = {"hour": tmp_path / "hour.ulg", "thinned": tmp_path / "thinned.ulg", "to_come": tmp_path / "to_come.ulg"}
    for name, size in (("hour", FULL_RATE_MB), ("thinned", THINNED_MB)):
        with logs[name].open("wb") as file:
            file.truncate(int(size))
    namespace: dict[str, Any] = {"LOGS": {name: str(log) for name, log in logs.items()}}
    exec((project_root / "workflow/rules/resources.smk").read_text(encoding="utf-8"), namespace)
    return namespace


def of(flight: str) -> SimpleNamespace:
    return SimpleNamespace(flight=flight)


@pytest.mark.parametrize(("flight", "measured_mb"), [("hour", 706), ("thinned", 783)])
def test_an_hour_gets_the_memory_that_was_measured_and_not_thrice_it(
    resources: dict[str, Any], flight: str, measured_mb: int
) -> None:
    asked = resources["replay_resources"](8, 7)["mem_mb"](of(flight), attempt=1)
    assert measured_mb < asked < 3 * measured_mb


@pytest.mark.parametrize(("flight", "measured_mb"), [("hour", 960), ("thinned", 935)])
def test_the_diagnosis_of_an_hour_gets_the_memory_that_was_measured(
    resources: dict[str, Any], flight: str, measured_mb: int
) -> None:
    needed = resources["of_its_logs"](resources["KERNELS_MB"], resources["DIAGNOSED_MB_PER_MB"])
    assert measured_mb < needed(of(flight), attempt=1) < 3 * measured_mb


def test_each_attempt_asks_for_as_much_again(resources: dict[str, Any]) -> None:
    needed = resources["of_its_logs"](300, 2.0)
    assert [needed(of("thinned"), attempt=n) for n in (1, 2, 3)] == [568, 1136, 1704]


def test_a_log_that_is_yet_to_be_simulated_counts_as_one_of_the_demonstration(resources: dict[str, Any]) -> None:
    assert resources["of_its_logs"](300, 2.0)(of("to_come"), attempt=1) == 320


def test_a_job_of_no_flight_works_on_all(resources: dict[str, Any]) -> None:
    assert resources["of_its_logs"](100, 1.0)(SimpleNamespace(), attempt=1) == 100 + 271 + 134 + 10


def test_more_sets_take_more_memory_and_time(resources: dict[str, Any]) -> None:
    few, many = (resources["replay_resources"](sets, sets) for sets in (8, 80))
    for name in ("mem_mb", "runtime"):
        assert many[name](of("hour"), attempt=1) > few[name](of("hour"), attempt=1)


def test_every_rule_says_what_it_takes(project_root: Path) -> None:
    rules = [
        (path.name, block)
        for path in sorted((project_root / "workflow/rules").glob("*.smk"))
        for block in re.split(r"^ *(?=(?:rule|checkpoint)\b[^\n]*:$)", path.read_text(encoding="utf-8"), flags=re.M)[1:]
    ]
    assert len(rules) >= 11
    for file, block in rules:
        assert re.search(r"resources:\n +(mem_mb=.*\n +runtime=|\*\*replay_resources)", block), f"{file}: {block[:40]}"
