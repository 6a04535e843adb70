"""All searches of a study side by side: one on all flights, one with each part of them kept aside.

They go on in rounds, a generation of each at a time, so that what they ask for is tried together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.folds import folds
from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.settings import SearchSettings
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import PUTTING_BACK_ROUNDS, Ask, Asking, Found, search_stages

ON_ALL = "all flights"


class Ground(Protocol):
    """Where sets are compared: on replays of flights, or on anything else that answers."""

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        """Compare the sets of each ask with its base on some flights."""
        ...


@dataclass(frozen=True)
class Searched:
    """A search and the flights that it saw.

    Attributes
    ----------
    name : `ON_ALL`, or which part was kept aside
    flights : that it saw
    aside : that were kept aside; empty of the one on all
    """

    name: str
    flights: tuple[str, ...]
    aside: tuple[str, ...]


@dataclass(frozen=True)
class Round:
    """A generation of all searches.

    Attributes
    ----------
    number : from 1
    stage : of the search on all flights
    """

    number: int
    stage: str


def searches(flights: Sequence[str], settings: SearchSettings) -> list[Searched]:
    """The searches of a study; the flights are in order of time."""
    parts = folds(flights, settings.folds)
    others = [
        Searched(f"without part {number}", tuple(one for one in flights if one not in part), part)
        for number, part in enumerate(parts, 1)
    ]
    return [Searched(ON_ALL, tuple(flights), ()), *others]


def run_searches(
    studied: Sequence[Searched],
    space: Space,
    settings: SearchSettings,
    ground: Ground,
    told: Callable[[Round], None] = lambda one: None,
) -> list[Found]:
    """Run all searches to their ends; what each found."""
    plan = plan_of(space, settings)
    running = [search_stages(space, plan, settings) for _ in studied]
    found: list[Found | None] = [None] * len(running)
    asks = dict(enumerate(map(next, running)))
    number = 0
    while asks:
        number += 1
        told(Round(number, next(iter(asks.values())).stage))
        places = list(asks)
        answers = ground.compare([(studied[place].flights, asks[place]) for place in places])
        asks = {}
        for place, answer in zip(places, answers, strict=True):
            ask = _next(running[place], answer)
            if isinstance(ask, Found):
                found[place] = ask
            else:
                asks[place] = ask
    return [one for one in found if one is not None]


def _next(search: Asking, answer: Comparison) -> Ask | Found:
    try:
        return search.send(answer)
    except StopIteration as ended:
        result: Found = ended.value
        return result


def rounds_of(space: Space, settings: SearchSettings) -> int:
    """How many generations a search has: as many as are planned, those of putting back among them."""
    plan = plan_of(space, settings)
    first = 1 + len(plan.first_generations) if plan.first else 0
    return first + 1 + len(plan.generations) + PUTTING_BACK_ROUNDS
