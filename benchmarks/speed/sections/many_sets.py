"""A thousand sets on ten flights, as a search or a grid asks for: planned, run to the decision, and one set added."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import yaml
from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.sample_flights import noise_sets, simulated_logs, study_of
from benchmarks.speed.workplace import Workplace

SETS, FLIGHTS = 1000, 10
QUICK_SETS, QUICK_FLIGHTS = 60, 3
QUANTITIES = {
    "planned": Quantity(f"{FLIGHTS} flights × {SETS} sets planned", "s", Kind.WALL, 15.0),
    "wall": Quantity(f"{FLIGHTS} flights × {SETS} sets scored with gaps and decided", "s", Kind.WALL, 480.0),
    "pair": Quantity("… each pair", "CPU s"),
    "one_more": Quantity("one set more, as a share of that run's CPU time", "", Kind.RATIO),
}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Times of a dry run, of a run, and of another one with a set more."""
    number, flights = (QUICK_SETS, QUICK_FLIGHTS) if work.quick else (SETS, FLIGHTS)
    project = work.project(simulated_logs(work, flights), {"study": "config/made.yaml"})
    sets = noise_sets(number)
    _write_study(project, sets)
    # which jobs there are is known when the flights are listed
    listed = work.pipeline(project, "results/save/present.json")
    yield "planned", work.pipeline(project, "--dry-run", "--quiet", "all", "--", "decide").wall_s
    decided = work.pipeline(project, "decide")
    yield "wall", listed.wall_s + decided.wall_s
    yield "pair", (listed.cpu_s + decided.cpu_s) / (number * flights)
    _write_study(project, sets | {"one_more": {"EKF2_GPS_V_NOISE": 0.25}})
    yield "one_more", work.pipeline(project, "decide").cpu_s / decided.cpu_s


def _write_study(project: Path, sets: dict[str, dict[str, float]]) -> None:
    (project / "config" / "made.yaml").write_text(yaml.safe_dump(study_of(sets)), encoding="utf-8")
