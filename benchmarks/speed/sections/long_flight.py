"""A flight of an hour: memory of its jobs, and their time over that of a shorter flight."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.long_flights import in_own_process
from benchmarks.save_speed import simulated
from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.workplace import Workplace

JOBS = {"save": "saved", "replay": "replayed with one set", "diagnose": "diagnosed", "analyse": "analysed with 7 sets"}
SHORT_MINUTES, LONG_MINUTES, QUICK_MINUTES = 10.0, 60.0, 15.0
QUANTITIES = {
    **{f"{job}_mb": Quantity(f"60 minutes {words}", "MB", Kind.MEMORY, 700.0) for job, words in JOBS.items()},
    **{f"{job}_cpu": Quantity(f"60 minutes {words}, each minute", "CPU s") for job, words in JOBS.items()},
    **{
        f"{job}_linear": Quantity(f"a minute of 60 over one of 10, {words}", "", Kind.RATIO, 1.15)
        for job, words in JOBS.items()
    },
}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Peak memory and CPU time of each job, in processes of their own."""
    minutes = {length: _jobs(work, length) for length in (SHORT_MINUTES, QUICK_MINUTES if work.quick else LONG_MINUTES)}
    short, long = minutes.values()
    for job in JOBS:
        yield f"{job}_mb", long[job]["peak"] / 1e6
        yield f"{job}_cpu", long[job]["cpu_s"] / long["minutes"]
        yield f"{job}_linear", long[job]["cpu_s"] / long["minutes"] / (short[job]["cpu_s"] / short["minutes"])


def _jobs(work: Workplace, minutes: float) -> dict[str, Any]:
    from fusetune.save.flight_folder import read_metadata

    folder = work.kept / "long"
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / f"{minutes:g}_minutes.ulg"
    if not log.is_file():
        unfinished, _ = simulated(log.with_suffix(".unfinished"), minutes, True)
        unfinished.rename(log)
    linked = work.folder() / log.name
    linked.symlink_to(log)
    found: dict[str, Any] = {job: in_own_process(job, Path(linked)) for job in JOBS}
    told = read_metadata(linked.with_suffix(".saved"))
    return found | {"minutes": (told["last_timestamp"] - told["start_timestamp"]) / 6e7}
