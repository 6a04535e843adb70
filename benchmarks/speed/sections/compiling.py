"""Kernels from nothing: the estimator compiled in a copy of the sources that has no byte code either."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.workplace import Workplace

QUANTITIES = {
    "cpu": Quantity("kernels from nothing", "CPU s", reach=40.0),
    "wall": Quantity("kernels from nothing, on the clock", "s", Kind.WALL, 60.0),
    "loaded": Quantity("kernels loaded, with all imports", "CPU s"),
}
COMPILE = """
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
use_kernel_cache()
from fusetune.ekf2.replay.warm_up import compile_kernels
compile_kernels()
"""


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Time of the first process that needs the estimator, and of the next one."""
    tree = work.copy_of_tree()
    first = work.python(COMPILE, tree=tree)
    yield "cpu", first.cpu_s
    yield "wall", first.wall_s
    yield "loaded", work.python(COMPILE, tree=tree).cpu_s
