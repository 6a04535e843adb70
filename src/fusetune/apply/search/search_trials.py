"""What the search on all flights tried, as trials: every set of it against the present one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIMS
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.plan import ALL, DELAYS
from fusetune.apply.search.requests import Values, values_of
from fusetune.apply.search.rounds import ON_ALL, AskedRound
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Ask, Found
from fusetune.apply.trials import Trials
from fusetune.set_names import FOUND

Array = npt.NDArray[np.float64]


class Comparing(Protocol):
    """Compares sets with a base on flights on which both were tried."""

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        """Compare the sets of each ask with its base on some flights."""
        ...


def search_trials(space: Space, asked: Sequence[AskedRound], found: Found, ground: Comparing) -> Trials | None:
    """Every set that the search on all flights tried, once, in the order in which it was asked for.

    Parameters
    ----------
    space : of the search; its origin is the present set
    asked : by all searches
    found : by the one on all flights; the name of its set is `FOUND`
    ground : where the search was, so that nothing is replayed for this

    Returns
    -------
    The trials; None where no set differs from the present one in what is searched. Factors are those that any set moves.

    Notes
    -----
    The first stage tries beside the present set, and is weighed here as the others are; these try beside the base that
    it found. How they compare with the base is carried over to the present set by what the base itself is worth beside
    that, flight by flight.
    """
    present, base = values_of(space.whole(space.values(np.zeros(len(space.factors))))), values_of(found.base)
    rounds = [one for one in asked if one.search.name == ON_ALL and one.ask.sets]
    if not rounds:
        return None
    flights = rounds[0].search.flights
    first = [one for one in rounds if one.ask.stage == DELAYS]
    asks = [Ask(ALL, present, one.ask.sets, seen_by=base) for one in first]
    of_base, *of_first = ground.compare([(flights, ask) for ask in (Ask(ALL, present, (base,), seen_by=base), *asks)])
    again = dict(zip(map(id, first), of_first, strict=True))
    rows = {base: _Row("base", of_base, 0, None)}
    for one in rounds:
        compared, carried = again.get(id(one), one.compared), None if id(one) in again else of_base
        for place, values in enumerate(one.ask.sets):
            rows.setdefault(values, _Row(f"{one.ask.stage} {one.number}.{place + 1}", compared, place, carried))
    rows.pop(present, None)
    return _trials(space, flights, rows, values_of(found.values))


class _Row:
    """Where a set stands in a comparison; `carried` is what its base is worth, where that is not the present set."""

    def __init__(self, name: str, compared: Comparison, place: int, carried: Comparison | None) -> None:
        self.name, self._compared, self._place, self._carried = name, compared, place, carried
        self.allowed = not compared.objections[place]

    @property
    def differences(self) -> Array:
        """(F,) to the present set."""
        row = self._compared.differences[self._place]
        return np.asarray(row if self._carried is None else row + self._carried.differences[0])

    def aim(self, aim: str) -> Array:
        """(F,) the same in one kind of prediction."""
        row = self._compared.aims[aim][self._place]
        return np.asarray(row if self._carried is None else row + self._carried.aims[aim][0])


def _trials(space: Space, flights: Sequence[str], rows: dict[Values, _Row], found: Values) -> Trials | None:
    present = {one.parameter: one.origin for one in space.factors}
    table = np.array([[dict(values).get(name, now) for name, now in present.items()] for values in rows])
    table = table.reshape(len(rows), len(present))
    moved = [place for place, now in enumerate(present.values()) if np.any(table[:, place] != now)]
    if not moved:
        return None
    return Trials(
        factors=tuple(space.factors[place] for place in moved),
        names=tuple(FOUND if values == found else row.name for values, row in rows.items()),
        values=table[:, moved],
        flights=tuple(flights),
        differences=np.array([row.differences for row in rows.values()]),
        aims={aim: np.array([row.aim(aim) for row in rows.values()]) for aim in AIMS},
        allowed=np.array([[row.allowed] * len(flights) for row in rows.values()]),
    )
