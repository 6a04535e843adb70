"""Searches on emulated flights, again and again: how often a change is recommended, and whether its gain comes true."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from fusetune.apply.search.found_sets import SHARED
from fusetune.apply.search.requests import values_of
from fusetune.apply.search.rounds import Searched, run_searches, searches
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Found
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings

from .decided import decided
from .emulated import EmulatedGround, Emulator

Array = npt.NDArray[np.float64]

AS_IT_IS, NOISE_ONLY = "as it is", "noise only"


@dataclass(frozen=True)
class Outcome:
    """One search and what came of it; differences in nat, below 0 is better.

    Attributes
    ----------
    changes : whether a change is recommended
    searched, expected, fresh, world : difference of the found set on the flights of the search, as expected from sets
        found without each flight, on the flights that no search saw, and on all flights of the world
    lower, upper, error : interval of the expected difference and its standard error; NaN where there is none
    spread : of what the searches found, on all flights of the world
    changed : parameters of the found set
    flights, fresh_flights : of the search, and those that it did not see
    """

    changes: bool
    searched: float
    expected: float
    fresh: float
    world: float
    lower: float
    upper: float
    error: float
    spread: float
    changed: tuple[str, ...]
    flights: int
    fresh_flights: int

    def covers(self, gain: float, of_flights: float = math.inf) -> bool:
        """Whether a difference lies in the interval, widened for one that is the mean of so many flights alone.

        The interval is that of the mean over all flights to come. The mean of m of them has a spread of its own, that
        of the n of the search by √(n/m); and what is written is not quite any of the sets that were judged.
        """
        if not self.error > 0.0:
            return False
        times = 0.5 * (self.upper - self.lower) / self.error
        error = SHARED * self.error
        half = times * math.sqrt((1.0 + self.flights / of_flights) * error**2 + self.spread**2)
        return abs(gain - self.expected) <= half


def search_once(
    emulator: Emulator,
    space: Space,
    settings: SearchSettings,
    decision: DecisionSettings,
    kind: str,
    flights: int,
    seed: int,
) -> Outcome:
    """Search on flights drawn from those that are emulated, in the order of their numbers; the others are fresh."""
    chance = np.random.default_rng((settings.seed, seed))
    number = next(iter(emulator.table.aims.values())).shape[1]
    drawn = np.sort(chance.choice(number, flights, replace=False))
    fresh = np.setdiff1d(np.arange(number), drawn)
    ground = EmulatedGround(emulator, chance.choice([-1.0, 1.0], number) if kind == NOISE_ONLY else None)
    studied = searches([str(place) for place in drawn], replace(settings, seed=seed))
    found, _ = run_searches(studied, space, replace(settings, seed=seed), ground)
    return outcome(ground, space, decision, studied, found, drawn, fresh)


def outcome(
    ground: EmulatedGround,
    space: Space,
    decision: DecisionSettings,
    studied: Sequence[Searched],
    found: Sequence[Found],
    drawn: npt.NDArray[np.int64],
    fresh: npt.NDArray[np.int64],
) -> Outcome:
    """Judge what the searches found; the first of them is that on all flights."""
    present = values_of(space.present)
    score, aims = ground.differences(present, [values_of(one.values) for one in found])
    without = {int(name): place for place, one in enumerate(studied) for name in one.aside}
    rows = [without[int(place)] for place in drawn]
    weights = ground.emulator.table.weights
    shown = decided(
        {name: values[rows, drawn] for name, values in aims.items()},
        {name: weights[name][drawn] for name in aims},
        decision,
    )
    changes = shown.changes and bool(found[0].changed)
    lower, upper = (np.nan if one is None else one for one in (shown.found.lower, shown.found.upper))
    return Outcome(
        changes,
        float(score[0, drawn].mean()),
        shown.found.difference,
        float(score[0, fresh].mean()),
        float(score[0].mean()),
        lower,
        upper,
        np.nan if shown.found.error is None else shown.found.error,
        float(np.std(score.mean(axis=1), ddof=1)) if len(found) > 1 else 0.0,
        found[0].changed,
        drawn.size,
        fresh.size,
    )


def search_often(
    emulator: Emulator,
    space: Space,
    settings: SearchSettings,
    decision: DecisionSettings,
    kind: str,
    flights: int,
    number: int,
    workers: int,
) -> list[Outcome]:
    """So many searches, each with flights and chance of its own."""
    once = partial(search_once, emulator, space, settings, decision, kind, flights)
    if workers == 1:
        return [once(seed) for seed in range(number)]
    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(once, range(number), chunksize=4))
