"""The real logs beside the checkout, with the six sets of the shipped study and the present one."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.sample_flights import real_logs
from benchmarks.speed.sections.pipeline import STUDY
from benchmarks.speed.workplace import Workplace

UNDRAWN = ("decide", "join_fleet", "join_conformance")
"""What makes everything but pictures and pages."""

COMPILE = """
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
use_kernel_cache()
try:
    from fusetune.ekf2.releases.behaviours import MODELLED
except ImportError:  # of a revision that knows v1.16 alone
    from fusetune.ekf2.replay.warm_up import compile_kernels
    compile_kernels()
else:
    from fusetune.ekf2.compiled.compilation import ensure_compiled
    for release in MODELLED:
        ensure_compiled(release)
"""

QUANTITIES = {
    "kernels": Quantity("estimators of all releases compiled where they are not, which is done once", "CPU s"),
    "undrawn_wall": Quantity("real logs × 7 sets, without pictures", "s", Kind.WALL, 60.0),
    "undrawn_cpu": Quantity("… its CPU time", "CPU s"),
    "wall": Quantity("real logs × 7 sets, with pictures and pages", "s", Kind.WALL, 75.0),
    "cpu": Quantity("… its CPU time", "CPU s"),
}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Times of runs from logs to the decision, and to the page, with the estimators of all releases at hand."""
    logs = real_logs()
    if work.quick:
        logs = dict(list(logs.items())[-6:])
    yield "kernels", work.python(COMPILE).cpu_s
    for name, targets in (("undrawn_", UNDRAWN), ("", ())):
        cost = work.pipeline(work.project(logs, STUDY), *targets)
        yield f"{name}wall", cost.wall_s
        yield f"{name}cpu", cost.cpu_s
