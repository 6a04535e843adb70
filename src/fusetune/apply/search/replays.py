"""The ground of a search on a vehicle's flights: every set is replayed once, and what it did is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from fusetune.analyze.trials.tried_set import TriedSet
from fusetune.apply.search.comparison import Comparison, TriedBase, compare
from fusetune.apply.search.plan import OF_DELAYS
from fusetune.apply.search.requests import Ask, Request, Values
from fusetune.apply.settings import DecisionSettings

Batch = tuple[str, Values, tuple[Values, ...]]
"""A flight, a base and sets to be tried beside it."""

Tried = tuple[TriedBase, tuple[TriedSet, ...]]


def tells_place(batch: Batch) -> bool:
    """Whether it is asked where the receiver's antenna sits: it is read where the base itself is compared.

    It costs several replays, and follows from the batch alone, so that what is kept of one is the same whenever it is
    made.
    """
    _, base, sets = batch
    return base in sets


class Trier(Protocol):
    """What replays: in this process, or in others."""

    def try_batches(self, batches: Sequence[Batch]) -> Iterable[tuple[Batch, Tried]]:
        """What the sets of each batch did, in any order."""
        ...


class ReplayGround:
    """Compares sets on flights by replaying them.

    Parameters
    ----------
    trier : replays what is not known yet
    decision : how what is tried is weighed
    take : is given what is new as it comes, to be kept
    told : is told how many of the sets of a round were tried, and how many there are
    """

    def __init__(
        self,
        trier: Trier,
        decision: DecisionSettings,
        take: Callable[[Batch, Tried], None] = lambda batch, tried: None,
        told: Callable[[int, int], None] = lambda done, number: None,
    ) -> None:
        self._trier, self._decision, self._take, self._told = trier, decision, take, told
        self._bases: dict[tuple[str, Values], TriedBase] = {}
        self._tried: dict[Request, TriedSet] = {}
        self.replayed = 0
        """Sets that were replayed on a flight; those that were known are not counted."""

    def know(self, batch: Batch, tried: Tried) -> None:
        """Take over what was tried before."""
        flight, base, sets = batch
        before, now = self._bases.get((flight, base)), tried[0]
        # batches come in any order, and not all of them tell the place
        self._bases[flight, base] = replace(now, place=before.place) if before and now.place is None else now
        self._tried.update({Request(flight, base, one): did for one, did in zip(sets, tried[1], strict=True)})

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        """Compare the sets of each ask with its base on some flights; what is not known is replayed first."""
        self._try_all(asks)
        return [self._compared(flights, ask) for flights, ask in asks]

    def pairs(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[tuple[Batch, Tried]]:
        """All that some asks need to be compared, in batches; what is not known is replayed first."""
        self._try_all(asks)
        return [(batch, self._known(batch)) for batch in _batches(asks, {}, {})]

    def _known(self, batch: Batch) -> Tried:
        flight, base, sets = batch
        about = self._bases[flight, base]
        about = about if tells_place(batch) else replace(about, place=None)
        return about, tuple(self._tried[Request(flight, base, one)] for one in sets)

    def _compared(self, flights: Sequence[str], ask: Ask) -> Comparison:
        bases = [self._bases[flight, ask.base] for flight in flights]
        if ask.seen_by is not None:
            seen = [self._bases[flight, ask.seen_by].whiteness for flight in flights]
            bases = [replace(base, whiteness=one or base.whiteness) for base, one in zip(bases, seen, strict=True)]
        tried = [[self._tried[Request(flight, ask.base, one)] for flight in flights] for one in ask.sets]
        return compare(bases, tried, self.weighed_by(ask.stage))

    def weighed_by(self, stage: str) -> DecisionSettings:
        """Before the delays are right, the sources' errors look as if they wandered, and are trusted all the same."""
        if stage in OF_DELAYS:
            return replace(self._decision, distrust_white_share=0.0, trust_white_share=0.0)
        return self._decision

    def _try_all(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> None:
        batches = _batches(asks, self._tried, self._bases)
        number, done = sum(len(sets) for _, _, sets in batches), 0
        for batch, tried in self._trier.try_batches(batches):
            self.know(batch, tried)
            self._take(batch, tried)
            done += len(batch[2])
            self.replayed += len(batch[2])
            self._told(done, number)


MOST_IN_BATCH = 8
"""So that what was tried is kept soon, and cores share the work evenly."""


def _batches(
    asks: Sequence[tuple[Sequence[str], Ask]],
    tried: Mapping[Request, TriedSet],
    bases: Mapping[tuple[str, Values], object],
) -> list[Batch]:
    """What is not known, each once, by flight and base, in the order of the first ask."""
    wanted: dict[tuple[str, Values], dict[Values, None]] = {}
    for flights, ask in asks:
        for flight in flights:
            new = {one: None for one in ask.sets if Request(flight, ask.base, one) not in tried}
            if new or (flight, ask.base) not in bases:
                wanted.setdefault((flight, ask.base), {}).update(new)
            if ask.seen_by is not None and (flight, ask.seen_by) not in bases:
                wanted.setdefault((flight, ask.seen_by), {})
    batches: list[Batch] = []
    for (flight, base), sets in wanted.items():
        ordered = tuple(sets)
        for first in range(0, max(len(ordered), 1), MOST_IN_BATCH):
            batches.append((flight, base, ordered[first : first + MOST_IN_BATCH]))
    return batches
