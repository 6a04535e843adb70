"""Sequences of points that fill a cube, and stay as they are when more of them are asked for.

Points are drawn one after the other, without end; a study takes as many as it needs and passes over those that its
constraints forbid.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from typing import Literal

Sampling = Literal["latin_hypercube", "sobol"]
Point = tuple[float, ...]
"""One number in [0, 1) for each factor."""

MOST_POINTS = 2**14
"""So many are looked at before the constraints count as ones that leave nothing."""


def points(sampling: Sampling, names: Sequence[str], seed: int) -> Iterator[Point]:
    """Points of a sequence, `MOST_POINTS` at the most, one coordinate per name."""
    drawn = sobol(len(names), seed) if sampling == "sobol" else latin_hypercube(names, seed)
    return itertools.islice(drawn, MOST_POINTS)


def sobol(dimensions: int, seed: int) -> Iterator[Point]:
    """Sobol's sequence, scrambled by Owen's way as SciPy does; the first 2^k points are balanced for every k."""
    # Imported here: SciPy takes a second to start, and only studies of this kind need it.
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, rng=seed)
    # blocks of 1, 1, 2, 4, …: so the total is a power of two after each, as the sequence wants
    yield tuple(engine.random(1)[0].tolist())
    for power in itertools.count():
        yield from map(tuple, engine.random(2**power).tolist())


def latin_hypercube(names: Sequence[str], seed: int) -> Iterator[Point]:
    """A nested Latin hypercube: the first 2^k points are a Latin hypercube of 2^k strata for every k.

    Where n points fill n strata one by one, each of the 2 n strata of half the width holds one of them or none; the
    next n points fill those that hold none, in random order. Qian, "Nested Latin hypercube designs", Biometrika 96
    (2009), with layers of powers of two. A factor's coordinates follow from its name and the seed, whatever the others.
    """
    columns = [_nested_column(random.Random(f"{seed} {name}")) for name in names]
    return zip(*columns, strict=True)


def _nested_column(source: random.Random) -> Iterator[float]:
    taken = [source.random()]
    yield taken[0]
    while True:
        strata = 2 * len(taken)
        free = sorted({*range(strata)} - {int(one * strata) for one in taken})
        source.shuffle(free)
        for stratum in free:
            # never on the upper edge, where rounding could put it into the next stratum
            taken.append((stratum + min(source.random(), 0.999999)) / strata)
            yield taken[-1]
