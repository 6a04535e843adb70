"""How a search goes on: which parameters, how far, how many sets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fusetune.settings.declaration import setting

FEWEST_EVALUATIONS = 24


@dataclass(frozen=True)
class SearchSettings:
    """A search.

    Section `search` of a study file.
    """

    parameters: tuple[str, ...] = setting(
        (), "parameters that are searched; empty: those of which the flights can tell, see docs/search.md"
    )
    bounds: Mapping[str, tuple[float, ...]] = setting(
        {}, "lowest and highest value of a parameter; by default within `ratio` of the present one, inside its range"
    )
    ratio: float = setting(8.0, "by how much a value may be larger or smaller than the present one", above=1, high=1000)
    evaluations: int = setting(
        120,
        "parameter sets that the search on all flights tries, and each with a part of them kept aside",
        low=FEWEST_EVALUATIONS,
        high=5000,
    )
    folds: int = setting(4, "parts of the flights, in order of time, each of which is kept aside once", low=2, high=50)
    putting_back_percent: float = setting(
        1.0,
        "a parameter keeps its present value where that makes errors larger by less than this, or than one "
        "standard error",
        unit="%",
        low=0,
        high=50,
    )
    seed: int = setting(1, "what chance follows from", low=0, high=2**31 - 1)
