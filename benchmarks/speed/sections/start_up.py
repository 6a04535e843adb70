"""What one job takes beside its work: imports, and the replay of one saved flight with one set."""

from __future__ import annotations

import statistics
from collections.abc import Iterator

from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.sample_flights import simulated_logs
from benchmarks.speed.workplace import Workplace

QUANTITIES = {
    "numba": Quantity("imports of a replay", "CPU s"),
    "snakemake": Quantity("a dry run of the pipeline in which nothing is to be done", "CPU s"),
    "replay": Quantity("replay of one saved one-minute flight, one set, warm, on the clock", "s", Kind.WALL, 1.0),
    "replay_cpu": Quantity("… its CPU time", "CPU s"),
}
IMPORT = "import fusetune.analyze.replaying.replay_flight"
SAVE = "import sys; from fusetune.save import save_log; save_log(sys.argv[1], sys.argv[2])"
REPLAY = """
import sys
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
use_kernel_cache()
from fusetune.analyze.replaying.replay_flight import replay_saved_flight
replay_saved_flight(sys.argv[1], {"present": {}}, sys.argv[2])
"""
REPEATS = 3


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Times of whole processes; the first of each is not counted."""
    work.python(IMPORT)
    yield "numba", statistics.median(work.python(IMPORT).cpu_s for _ in range(REPEATS))
    [log] = simulated_logs(work, 1).values()
    saved, replayed = work.folder() / "flight", work.folder()
    work.python(SAVE, str(log), str(saved))
    costs = [work.python(REPLAY, str(saved), str(replayed)) for _ in range(REPEATS + 1)][1:]
    yield "replay", statistics.median(cost.wall_s for cost in costs)
    yield "replay_cpu", statistics.median(cost.cpu_s for cost in costs)
    project = work.project({"flight": log})
    work.pipeline(project, "design")
    yield "snakemake", work.pipeline(project, "--dry-run", "design").cpu_s
