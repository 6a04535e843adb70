"""What `make` does when the packages are installed: everything from nothing, estimator and demonstration included."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.workplace import Cost, Workplace

STAGES = {
    "compiled": ("… until the estimator is compiled", ".cache/numba/*/ready.json"),
    "flown": ("… until the flights are flown", "results/execute/*.ulg"),
    "saved": ("… until they are saved and listed", "results/save/present.json"),
    "scored": ("… until they are scored", "results/analyze/*/scoring.json"),
    "decided": ("… until it is decided", "results/apply/decision.json"),
    "diagnosed": ("… until all is diagnosed", "results/apply/fleet.json"),
}
"""Name → words, and the files of which the last one ends the stage."""

QUANTITIES = {
    "wall": Quantity("make after the packages are installed, demonstration included", "s", Kind.WALL, 75.0),
    "cpu": Quantity("… its CPU time", "CPU s"),
    **{name: Quantity(words, "s", Kind.WALL) for name, (words, _) in STAGES.items()},
}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Time on the clock, and when each stage ended."""
    tree = work.copy_of_tree()
    (tree / "flights").mkdir()
    cost = work.pipeline(tree, tree=tree)
    yield "wall", cost.wall_s
    yield "cpu", cost.cpu_s
    for name, (_, pattern) in STAGES.items():
        yield name, _until(tree, pattern, cost)


def _until(folder: Path, pattern: str, cost: Cost) -> float:
    return max(file.stat().st_mtime for file in folder.glob(pattern)) - cost.begun
