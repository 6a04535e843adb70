"""A value that changes from one run of the estimator to another: a parameter, or what follows from one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

Steps = tuple[tuple[int, float], ...]
"""(run, value from that run on), the first of run 0; two neighbours differ."""

TIMELINE = np.dtype([("run", "i8"), ("value", "f8")], align=True)


def steps_of(initial: float, changes: Iterable[tuple[int, float]], meaning: Callable[[float], float] = float) -> Steps:
    """What follows from a parameter and its changes in flight.

    Parameters
    ----------
    initial : at the first run
    changes : (run, new value) in their order, each in effect from its run on
    meaning : of the parameter's value; by default itself
    """
    steps = [(0, meaning(initial))]
    for run, value in sorted(changes, key=lambda change: change[0]):
        if meaning(value) != steps[-1][1]:
            steps.append((run, meaning(value)))
    return tuple(steps)


def timeline(steps: Sequence[tuple[int, float]]) -> np.ndarray:
    """Steps as an array of TIMELINE."""
    return np.array(list(steps), TIMELINE)


@kernel
def place_at(steps, run):
    """Index of the step that is in effect at a run."""
    place = len(steps) - 1
    while place > 0 and steps[place].run > run:
        place -= 1
    return place


@kernel
def value_at(steps, run):
    """The value in effect at a run."""
    return steps[place_at(steps, run)].value


@kernel
def first_at(numbers, number):
    """Index of the first of ascending numbers, of runs or updates, that is not below one."""
    low, high = 0, len(numbers)
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] < number:
            low = middle + 1
        else:
            high = middle
    return low
