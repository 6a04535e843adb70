"""The whole pipeline over the number of flights, simulated ones of about a minute, each with seven sets."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.sample_flights import simulated_logs
from benchmarks.speed.workplace import Workplace

NUMBERS = (5, 25, 100)
QUANTITIES = {
    **{f"wall_{number}": Quantity(f"pipeline, {number} flights × 7 sets", "s", Kind.WALL) for number in NUMBERS},
    **{f"cpu_{number}": Quantity(f"pipeline, {number} flights × 7 sets", "CPU s") for number in NUMBERS},
    "slope_few": Quantity("each flight more, from 5 to 25", "CPU s"),
    "slope_many": Quantity("each flight more, from 25 to 100", "CPU s"),
    "linear": Quantity("the latter over the former", "", Kind.RATIO, 1.1),
}
STUDY = {"study": "config/studies/paper_table11.yaml"}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """Times of runs from logs to the page, with the estimator compiled."""
    cpu = {}
    for number in NUMBERS[:2] if work.quick else NUMBERS:
        project = work.project(simulated_logs(work, number), STUDY)
        cost = work.pipeline(project)
        cpu[number] = cost.cpu_s
        yield f"wall_{number}", cost.wall_s
        yield f"cpu_{number}", cost.cpu_s
    few, some, *many = cpu
    slope = (cpu[some] - cpu[few]) / (some - few)
    yield "slope_few", slope
    for number in many:
        steeper = (cpu[number] - cpu[some]) / (number - some)
        yield "slope_many", steeper
        yield "linear", steeper / slope
