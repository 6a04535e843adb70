"""The generations of a search: their number and sizes follow from the space and the settings alone.

So the whole search is planned before the first set is tried.
"""

from __future__ import annotations

from dataclasses import dataclass

from fusetune.apply.search.settings import SearchSettings
from fusetune.apply.search.space import DELAY_SUFFIX, Space

FIRST_SUFFIXES = (DELAY_SUFFIX, "_POS_X", "_POS_Y", "_POS_Z")
"""Delays and lever arms come first: where they are wrong, a sensor's errors look as if they wandered, and all else is
tuned to hide it."""

DELAYS, ALL, PUTTING_BACK = "delays", "all", "putting back"
STAGES = (DELAYS, ALL, PUTTING_BACK)
PUTTING_BACK_ROUNDS = 3

_FIRST_SIZE, _FIRST_GENERATIONS = 6, 2
_START_SHARE = 0.35
_GENERATIONS = 6
FIRST_RADIUS, RADIUS, SHRINKS = 0.5, 0.6, 0.75
"""How far from the best set the first generation of a stage looks, in half ranges, and what share of that the next."""


@dataclass(frozen=True)
class Plan:
    """Sizes of the generations.

    Attributes
    ----------
    first : parameters of the first stage
    first_generations : sizes after the start of the first stage
    start : number of sets that the second stage starts with
    generations : sizes of its generations
    """

    first: tuple[str, ...]
    first_generations: tuple[int, ...]
    start: int
    generations: tuple[int, ...]
    factors: int

    @property
    def rounds(self) -> tuple[tuple[str, int], ...]:
        """Stage and number of sets of every generation; putting back asks for no more than this."""
        first = [(DELAYS, start_size(len(self.first))), *((DELAYS, size) for size in self.first_generations)]
        second = [(ALL, self.start), *((ALL, size) for size in self.generations)]
        return (*(first if self.first else ()), *second, *[(PUTTING_BACK, self.factors + 1)] * PUTTING_BACK_ROUNDS)


def plan_of(space: Space, settings: SearchSettings) -> Plan:
    """Share the evaluations out; putting back takes those that are left."""
    first = tuple(name for name in space.parameters if name.endswith(FIRST_SUFFIXES))
    spent = 3 * len(space.parameters) + (start_size(len(first)) + _FIRST_SIZE * _FIRST_GENERATIONS if first else 0)
    left = max(settings.evaluations - spent, 16)
    start = max(round(_START_SHARE * left), 8)
    size = max((left - start) // _GENERATIONS, 1)
    return Plan(
        first,
        (_FIRST_SIZE,) * _FIRST_GENERATIONS if first else (),
        start,
        (size,) * _GENERATIONS,
        len(space.parameters),
    )


def start_size(factors: int) -> int:
    """Of a star with four points along each factor."""
    return 4 * factors
