"""What the search on all flights tried, as trials: every set of it against the present one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIMS
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.plan import OF_DELAYS
from fusetune.apply.search.requests import Values, values_of
from fusetune.apply.search.rounds import ON_ALL, AskedRound
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Found
from fusetune.apply.trials import Trials
from fusetune.set_names import FOUND

Array = npt.NDArray[np.float64]


def search_trials(space: Space, asked: Sequence[AskedRound], found: Found, of_base: Comparison) -> Trials | None:
    """What the search on all flights tried after its first stage, each set once, in the order of the first ask.

    Parameters
    ----------
    space : of the search; its origin is the present set
    asked : by all searches
    found : by the one on all flights; the name of its set is `FOUND`
    of_base : what its base is worth beside the present set, on the flights of the search

    Returns
    -------
    The trials; None where no set differs from the present one in what is searched. Factors are what any set moves.

    Notes
    -----
    How sets compare with the base that the first stage found is carried over to the present set by what the base itself
    is worth beside that, flight by flight. The sets of stages that move delays and lever arms alone are left out: they
    are weighed otherwise, and those of the first lie far from all others.
    """
    present, base = values_of(space.whole(space.present)), values_of(found.base)
    rounds = [one for one in asked if one.search.name == ON_ALL and one.ask.stage not in OF_DELAYS and one.ask.sets]
    if not rounds:
        return None
    flights = rounds[0].search.flights
    rows = {base: _Row("base", of_base, 0, None)}
    for one in rounds:
        for place, values in enumerate(one.ask.sets):
            rows.setdefault(values, _Row(f"{one.ask.stage} {one.number}.{place + 1}", one.compared, place, of_base))
    rows.pop(present, None)
    return _trials(space, flights, rows, values_of(found.values))


@dataclass(frozen=True, eq=False)
class _Row:
    """Where a set stands in a comparison; `of_base` is what its base is worth, where that is not the present set."""

    name: str
    compared: Comparison
    place: int
    of_base: Comparison | None

    @property
    def allowed(self) -> bool:
        return not self.compared.objections[self.place]

    @property
    def differences(self) -> Array:
        """(F,) to the present set."""
        row = self.compared.differences[self.place]
        return np.asarray(row if self.of_base is None else row + self.of_base.differences[0])

    def aim(self, aim: str) -> Array:
        """(F,) the same in one kind of prediction."""
        row = self.compared.aims[aim][self.place]
        return np.asarray(row if self.of_base is None else row + self.of_base.aims[aim][0])


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
