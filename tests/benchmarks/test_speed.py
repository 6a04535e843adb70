"""The one command of benchmarks: what counts as slower, and that everything it measures is told of."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest
from benchmarks.speed.command import DONE, FAILED, REGRESSION, REPEATS, status_of
from benchmarks.speed.comparison import compare
from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.results import Samples, SectionResults
from benchmarks.speed.revisions import Revision
from benchmarks.speed.table import written

CPU = Quantity("work", "CPU s", reach=1.0)
RATE = Quantity("pairs", "1/CPU s", more_is_better=True)


def samples(*values: float, loop_s: float = 0.1) -> Samples:
    return Samples(list(values), [loop_s] * len(values))


def test_a_machine_that_is_half_as_fast_is_no_regression() -> None:
    """Twice the time where the loop takes twice the time: 2.0 / 0.2 = 1.0 / 0.1."""
    told = compare(CPU, samples(2.0, 2.2, loop_s=0.2), samples(1.0, 1.1))
    assert told.ratio == pytest.approx(1.0)
    assert not told.is_regression
    told = compare(RATE, samples(5.0, 5.5, loop_s=0.2), samples(10.0, 11.0))
    assert told.ratio == pytest.approx(1.0)
    assert not told.is_regression


@pytest.mark.parametrize(
    ("quantity", "new", "old", "regression"),
    [
        (CPU, (1.2, 1.25, 1.3), (1.0, 1.02, 1.1), True),
        (CPU, (1.05, 1.06, 1.07), (1.0, 1.01, 1.02), False),  # within 10 %
        (CPU, (1.0, 1.3, 1.4), (0.9, 1.0, 1.1), False),  # 30 % in the median, but its best is as good as their worst
        (RATE, (5.0, 5.1), (10.0, 10.1), True),
        (RATE, (20.0, 20.1), (10.0, 10.1), False),
        (Quantity("clock", "s", Kind.WALL), (1.2, 1.2), (1.0, 1.0), False),  # within 25 %
    ],
)
def test_slower_is_what_chance_does_not_explain(
    quantity: Quantity, new: tuple[float, ...], old: tuple[float, ...], regression: bool
) -> None:
    assert compare(quantity, samples(*new), samples(*old)).is_regression is regression


def test_the_table_marks_what_became_worse_and_the_status_says_so() -> None:
    new, old = SectionResults({"cpu": CPU, "rate": RATE}), SectionResults({"cpu": CPU, "rate": RATE})
    for results, cpu in ((new, 2.0), (old, 1.0)):
        for _ in range(2):
            results.add({"values": {"cpu": cpu, "rate": 7.0}, "lacking": "", "failed": "", "loop_s": 0.1})
    revisions = [Revision("new", Path()), Revision("old", Path())]
    table = written(revisions, {"part": [new, old]}, {}, 0.1)
    assert "| work | 2 CPU s | 0% | 1 | 0% | **2.00 worse** | ≤ 1 (not reached) |" in table
    assert "| pairs | 7 1/CPU s | 0% | 7 | 0% | 1.00 |  |" in table
    assert status_of({"part": [new, old]}) == REGRESSION
    assert status_of({"part": [old, new]}) == DONE
    old.add({"values": {}, "lacking": "", "failed": "no such function", "loop_s": 0.1})
    assert "part on old: failed, no such function" in written(revisions, {"part": [new, old]}, {}, 0.1)
    assert status_of({"part": [old]}) == FAILED


def test_every_section_is_in_the_command_and_in_the_manual(project_root: Path) -> None:
    folder = project_root / "benchmarks" / "speed" / "sections"
    files = {file.stem for file in folder.glob("*.py")} - {"__init__"}
    assert files == set(REPEATS)
    manual = (project_root / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", manual, re.MULTILINE) == list(REPEATS)
    for name in files:
        assert importlib.import_module(f"benchmarks.speed.sections.{name}").QUANTITIES
