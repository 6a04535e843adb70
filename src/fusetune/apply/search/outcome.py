"""The whole of a study's searches in rounds: the last one tries what each found on the flights kept aside from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.plan import ALL
from fusetune.apply.search.proposals import Proposing, propose
from fusetune.apply.search.requests import Ask, values_of
from fusetune.apply.search.rounds import AskedRound, Rounds, Searched, search_rounds, searches
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Found
from fusetune.design.search_settings import SearchSettings


@dataclass(frozen=True)
class Outcome:
    """What the searches found.

    Attributes
    ----------
    studied : the searches, the one on all flights first
    found : what each found
    asked : all that they asked
    on_all : what the first found, on all flights
    aside : what each of the others found, on the flights that it did not see, in order of time: score less the present
        set's, nat; NaN where a flight says nothing
    """

    studied: Sequence[Searched]
    found: Sequence[Found]
    asked: Sequence[AskedRound]
    on_all: Comparison
    aside: Mapping[str, float]

    @property
    def without(self) -> dict[str, dict[str, float]]:
        """By flight, what was found without it."""
        return {
            name: found.values
            for one, found in zip(self.studied[1:], self.found[1:], strict=True)
            for name in one.aside
        }


def outcome_rounds(
    flights: Sequence[str], space: Space, settings: SearchSettings, proposing: Proposing = propose
) -> Rounds[Outcome]:
    """Search on flights, in order of time; the origin of the space is the present set."""
    studied = searches(flights, settings)
    found, asked = yield from search_rounds(studied, space, settings, proposing)
    present = values_of(space.values(np.zeros(len(space.factors))))
    whats = [values_of(one.values) for one in found]
    asks = [Ask(ALL, present, (what,), seen_by=what) for what in whats]
    on_all, *others = yield list(zip([one.aside or one.flights for one in studied], asks, strict=True))
    differences = [
        (name, value)
        for one, compared in zip(studied[1:], others, strict=True)
        for name, value in zip(one.aside, compared.differences[0].tolist(), strict=True)
    ]
    return Outcome(studied, found, asked, on_all, dict(differences))
