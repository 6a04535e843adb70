"""The lists of sources hold all that a job's script imports, directly or through others."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

import fusetune
from fusetune.ekf2.compiled.kernel_cache import KERNEL_SOURCES
from fusetune.running.job_sources import JOB_SOURCES, TRIED

PACKAGE = Path(fusetune.__file__).parent
SCRIPTS = PACKAGE.parents[1] / "workflow" / "scripts"

MADE_BY = {
    "design": ("design",),
    "mission_map": ("mission",),
    "covariance_design": ("covariance",),
    "simulate_flight": ("execute",),
    "save_flight": ("save",),
    "list_flights": ("score", "save"),
    "tell_flight": ("diagnose", "conformance", "save"),
    "join_delays": ("delays", "diagnose", "replay", "save"),
    "join_health": ("diagnose", "save"),
    "join_conformance": ("conformance", "score", "diagnose", "save"),
    "analyze_flight": ("replay", "score", "save"),
    "search_flights": ("search",),
    "search_ask": ("search",),
    "search_try": ("search",),
    "search_found": ("search",),
    "decide": ("apply", "conformance", "score", "replay", "save"),
    "measure_change": ("change", "apply", "replay", "save"),
    "keep_history": ("apply", "score", "replay", "save"),
    "join_fleet": ("apply", "diagnose", "save"),
    "flight_page": ("report", "apply", "diagnose", "save"),
    "all_sensors_page": ("report", "apply", "diagnose", "save"),
    "sensor_page": ("report", "apply", "diagnose", "save"),
    "build_report": ("report", "apply", "conformance", "diagnose", "score", "replay", "save"),
}
"""Script → kind of job, and the kinds before it, of whose outcome it is made."""

WITHOUT_OUTCOME = ("__init__.py", "analyze/__init__.py", "ekf2/__init__.py", "ekf2/compiled", "running")
"""What jobs import that changes no file they make: settings of the process, and who is at work."""

WITHOUT_KERNELS = (*WITHOUT_OUTCOME, "errors.py", "px4/__init__.py", "px4/releases.py", "storage")
"""What the compiled modules import beside kernels, and the values and types that are compiled into them."""


@cache
def imported(file: Path) -> frozenset[Path]:
    """Files of the package that a file imports, itself or a package on the way to it."""
    return frozenset(_imported(file))


def _imported(file: Path) -> Iterator[Path]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names = [module, *(f"{module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            if name.split(".")[0] == "fusetune":
                yield from _files_of(name)


def _files_of(name: str) -> Iterator[Path]:
    parts = name.split(".")[1:]
    for length in range(len(parts) + 1):
        path = PACKAGE.joinpath(*parts[:length])
        yield from (file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file())


def closure(files: Iterable[Path]) -> set[str]:
    """Names, within the package, of all files that some import, directly or through others."""
    known: set[Path] = set()
    waiting = list(files)
    while waiting:
        for file in imported(waiting.pop()):
            if file not in known:
                known.add(file)
                waiting.append(file)
    return {file.relative_to(PACKAGE).as_posix() for file in known}


def covered(name: str, parts: Iterable[str]) -> bool:
    return any(name == part or name.startswith(f"{part}/") for part in parts)


def test_what_trying_a_set_imports_makes_it_be_tried_again() -> None:
    names = closure([PACKAGE / "analyze" / "trials" / "tried_flight.py"])
    assert "analyze/trials/tried_set.py" in names
    assert [name for name in sorted(names) if not covered(name, {*TRIED, *WITHOUT_OUTCOME})] == []


@pytest.mark.parametrize("script", MADE_BY)
def test_what_a_job_imports_makes_it_run_again(script: str) -> None:
    parts = {part for kind in MADE_BY[script] for part in JOB_SOURCES[kind]}
    names = closure([SCRIPTS / f"{script}.py"])
    assert any(covered(name, parts) for name in names)
    assert [name for name in sorted(names) if not covered(name, {*parts, *WITHOUT_OUTCOME})] == []


def test_every_script_that_makes_results_is_compared() -> None:
    # the kernels have a digest of their own
    assert {file.stem for file in SCRIPTS.glob("*.py")} - set(MADE_BY) == {"compile_kernels"}


def test_kernels_are_known_by_all_that_they_are_made_of() -> None:
    names = closure([PACKAGE / "ekf2" / "replay" / "loop.py"])
    assert "ekf2/filter/estimator.py" in names
    assert [name for name in sorted(names) if not covered(name, (*KERNEL_SOURCES, *WITHOUT_KERNELS))] == []
