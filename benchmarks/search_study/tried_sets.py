"""Sets for a table of what was tried: all over the space, near the present set, and near what is best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import qmc

from fusetune.apply.search.plan import ALL, FIRST_SUFFIXES
from fusetune.apply.search.requests import Ask, values_of
from fusetune.apply.search.rounds import Ground
from fusetune.apply.search.space import Space

from .emulated import TriedTable, tried_table

_NEAR = 0.4
"""Half ranges of the space."""


def table_space(space: Space) -> Space:
    """Without lever arms: they act on flights that turn, and none is wrong where searches are emulated."""
    arms = FIRST_SUFFIXES[1:]
    return space.only([name for name in space.parameters if not name.endswith(arms)])


def sets_to_try(space: Space, best: Mapping[str, float], number: int, seed: int) -> list[dict[str, float]]:
    """A third each all over the space, near the present set, and near the best.

    Parameters
    ----------
    number : a power of two of each third
    """
    drawn = 2.0 * qmc.Sobol(len(space.factors), rng=np.random.default_rng(seed)).random(number) - 1.0
    around = np.zeros(len(space.factors)), space.point(best)
    points = [drawn, *(centre + _NEAR * drawn[::-1] for centre in around)]
    low, high = space.bounds.T
    return [space.values(np.clip(point, low, high)) for point in np.vstack(points)]


def try_sets(ground: Ground, flights: Sequence[str], space: Space, sets: Sequence[Mapping[str, float]]) -> TriedTable:
    """Try sets on flights, all against the present set."""
    present = values_of(space.present)
    ask = Ask(ALL, present, tuple(values_of(one) for one in sets))
    return tried_table(space.factors, sets, ground.compare([(flights, ask)])[0])
