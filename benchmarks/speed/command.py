"""The command: chooses sections and revisions, lets revisions take turns, and tells what was found."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.speed.comparison import compare
from benchmarks.speed.machine import machine_words
from benchmarks.speed.results import SectionResults
from benchmarks.speed.revisions import KEPT, Revision, at_hand, other
from benchmarks.speed.table import written
from benchmarks.speed.workplace import ROOT

REPEATS = {
    "estimator": 3,
    "scoring": 3,
    "start_up": 3,
    "compiling": 1,
    "demonstration": 1,
    "real_flights": 1,
    "pipeline": 1,
    "long_flight": 1,
    "many_sets": 1,
}
"""Section → how often it is measured, in the order in which that is done; with another revision at least twice."""

DONE, REGRESSION, FAILED = 0, 1, 2
TABLE = "measured by python -m benchmarks --write"
"""Between the marks of this name it stands in benchmarks/README.md."""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="How fast everything is.")
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=f"{', '.join(REPEATS)}; by default all")
    parser.add_argument("--quick", action="store_true", help="less work of each kind, one repeat: whether it runs")
    parser.add_argument("--repeats", type=int, help="of each section, instead of its own number")
    parser.add_argument("--against", metavar="REV", help="measure another revision in turns with this one")
    parser.add_argument("--cores", type=int, default=2, help="that the pipeline may use")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every value of every repeat")
    parser.add_argument("--write", action="store_true", help="renew the table in benchmarks/README.md")
    options = parser.parse_args(arguments)
    unknown = set(options.sections) - set(REPEATS)
    if unknown:
        parser.error(f"there is no section {', '.join(sorted(unknown))}; there are {', '.join(REPEATS)}")
    revisions = [at_hand(), *([other(options.against)] if options.against else [])]
    words, begun = machine_words(), time.monotonic()
    found: dict[str, list[SectionResults]] = {}
    loops: list[float] = []
    for section in [name for name in REPEATS if name in options.sections or not options.sections]:
        repeats = options.repeats or (1 if options.quick else max(REPEATS[section], len(revisions)))
        quantities = importlib.import_module(f"benchmarks.speed.sections.{section}").QUANTITIES
        found[section] = [SectionResults(quantities) for _ in revisions]
        for repeat in range(repeats):
            # who comes first takes turns, too
            for number in sorted(range(len(revisions)), reverse=repeat % 2 == 1):
                told = _measured(section, revisions[number], options)
                found[section][number].add(told)
                loops += [told["loop_s"]] if "loop_s" in told else []
        print(f"{time.monotonic() - begun:5.0f} s  {section}", file=sys.stderr, flush=True)
    words |= {"load after": f"{os.getloadavg()[0]:.1f}"} if hasattr(os, "getloadavg") else {}
    table = written(revisions, found, words, statistics.median(loops or [0.0]))
    print(table)
    if options.json:
        options.json.write_text(json.dumps(_document(revisions, found, words), indent=1), encoding="utf-8")
    if options.write:
        _renew_table(table)
    return status_of(found)


def _measured(section: str, revision: Revision, options: argparse.Namespace) -> dict[str, Any]:
    """One section, once, on one revision."""
    KEPT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="fusetune-speed-", ignore_cleanup_errors=True) as scratch:
        command = [sys.executable, "-P", "-m", "benchmarks.speed.inside", section, "--tree", str(revision.tree)]
        command += ["--scratch", scratch, "--kept", str(KEPT), "--cores", str(options.cores)]
        command += ["--quick"] * options.quick
        paths = f"{revision.tree / 'src'}{os.pathsep}{ROOT}"
        environment = os.environ | {"PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
        environment.pop("NUMBA_CACHE_DIR", None)
        done = subprocess.run(command, env=environment, cwd=scratch, capture_output=True, text=True, check=False)
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        return {"values": {}, "lacking": "", "failed": done.stderr[-2000:] or f"status {done.returncode}"}
    return json.loads(lines[-1])


def status_of(found: Mapping[str, Sequence[SectionResults]]) -> int:
    """`FAILED` where something of the revision at hand could not be measured, `REGRESSION` where it is slower."""
    if any(results[0].failed for results in found.values()):
        return FAILED
    for results in found.values():
        for other_results in results[1:]:
            for name in results[0].samples.keys() & other_results.samples.keys():
                pair = results[0].samples[name], other_results.samples[name]
                if compare(results[0].quantities[name], *pair).is_regression:
                    return REGRESSION
    return DONE


def _document(
    revisions: Sequence[Revision], found: Mapping[str, Sequence[SectionResults]], words: Mapping[str, str]
) -> dict[str, Any]:
    of_revisions = {
        revision.name: {section: results[number].document() for section, results in found.items()}
        for number, revision in enumerate(revisions)
    }
    return {"machine": dict(words), "revisions": of_revisions}


def _renew_table(table: str) -> None:
    from benchmarks.decision_study.tables import between_marks

    file = ROOT / "benchmarks" / "README.md"
    file.write_text(between_marks(file.read_text(encoding="utf-8"), TABLE, table), encoding="utf-8")
