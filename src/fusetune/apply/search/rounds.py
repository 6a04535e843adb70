"""All searches of a study side by side: one on all flights, one with each part of them kept aside.

They go on in rounds, a generation of each at a time, so that what they ask for is tried together.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.folds import folds
from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.proposals import Proposing, propose
from fusetune.apply.search.requests import Ask
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Asking, Found, search_stages
from fusetune.design.search_settings import SearchSettings

ON_ALL = "all flights"

T = TypeVar("T")

AskedOfFlights = tuple[tuple[str, ...], Ask]
"""Flights, and what is to be compared on them."""

Rounds = Generator[list[AskedOfFlights], list[Comparison], T]
"""Rounds, a list of what is asked in each; it is sent how that compares."""


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


@dataclass(frozen=True, eq=False)
class AskedRound:
    """What one search asked in a round, from 1, and how it compared."""

    number: int
    search: Searched
    ask: Ask
    compared: Comparison


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
    begin: Callable[[int], None] = lambda number: None,
) -> tuple[list[Found], list[AskedRound]]:
    """Run all searches to their ends.

    Parameters
    ----------
    begin : is told the number of each round before it begins

    Returns
    -------
    What each found, and all that they asked
    """
    return answered(search_rounds(studied, space, settings), ground, begin)


def search_rounds(
    studied: Sequence[Searched], space: Space, settings: SearchSettings, proposing: Proposing = propose
) -> Rounds[tuple[list[Found], list[AskedRound]]]:
    """All searches, a round at a time; what each found, and all that they asked."""
    plan = plan_of(space, settings)
    running = [search_stages(space, plan, settings, proposing) for _ in studied]
    found: dict[int, Found] = {}
    asks = dict(enumerate(map(next, running)))
    asked: list[AskedRound] = []
    number = 0
    while asks:
        number += 1
        answers = yield [(studied[place].flights, ask) for place, ask in asks.items()]
        asked += [
            AskedRound(number, studied[place], ask, answer)
            for (place, ask), answer in zip(asks.items(), answers, strict=True)
        ]
        following = {place: _next(running[place], answer) for place, answer in zip(asks, answers, strict=True)}
        found |= {place: one for place, one in following.items() if isinstance(one, Found)}
        asks = {place: one for place, one in following.items() if isinstance(one, Ask)}
    return [found[place] for place in range(len(studied))], asked


def answered(rounds: Rounds[T], ground: Ground, begin: Callable[[int], None] = lambda number: None) -> T:
    """What rounds lead to when a ground answers them all."""
    number, answers = 0, None
    while True:
        try:
            asks = next(rounds) if answers is None else rounds.send(answers)
        except StopIteration as ended:
            result: T = ended.value
            return result
        number += 1
        begin(number)
        answers = ground.compare(asks)


def _next(search: Asking, answer: Comparison) -> Ask | Found:
    try:
        return search.send(answer)
    except StopIteration as ended:
        result: Found = ended.value
        return result
