"""The whole of a study's searches in rounds: the last one tries what each found on the flights kept aside from it."""

from __future__ import annotations

import math
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
    on_seen : of each search, what it found, on the flights that it saw: score less the present set's, nat
    of_base : the base of the first, beside the present set, on all flights
    aside : what each of the others found, on the flights that it did not see, in order of time: score less the present
        set's, nat; NaN where a flight says nothing
    """

    studied: Sequence[Searched]
    found: Sequence[Found]
    asked: Sequence[AskedRound]
    on_all: Comparison
    on_seen: Sequence[Sequence[float]]
    of_base: Comparison
    aside: Mapping[str, float]

    @property
    def spread(self) -> float:
        """Standard deviation of what the searches' sets are worth on all flights, nat: which one is written is luck.

        0 with one search, and where the flights say nothing.
        """
        means = []
        for one, seen in zip(self.studied, self.on_seen, strict=True):
            known = [value for value in (*seen, *(self.aside[name] for name in one.aside)) if math.isfinite(value)]
            if known:
                means.append(np.mean(known))
        return float(np.std(means, ddof=1)) if len(means) > 1 else 0.0

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
    present = values_of(space.present)
    whats = [values_of(one.values) for one in found]
    asks = [Ask(ALL, present, (what,), seen_by=what) for what in whats]
    base = values_of(found[0].base)
    seen = [(one.flights, ask) for one, ask in zip(studied, asks, strict=True)]
    aside = [(one.aside, ask) for one, ask in zip(studied, asks, strict=True) if one.aside]
    of_base, *compared = yield [(studied[0].flights, Ask(ALL, present, (base,), seen_by=base)), *seen, *aside]
    on_seen, others = compared[: len(seen)], compared[len(seen) :]
    differences = [
        (name, value)
        for (names, _), one in zip(aside, others, strict=True)
        for name, value in zip(names, one.differences[0].tolist(), strict=True)
    ]
    each = [one.differences[0].tolist() for one in on_seen]
    return Outcome(studied, found, asked, on_seen[0], each, of_base, dict(differences))
