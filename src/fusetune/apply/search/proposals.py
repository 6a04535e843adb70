"""Which sets to try next: where the surrogate expects or may hide better scores, found by CMA-ES."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt
from cmaes import CMA
from threadpoolctl import threadpool_limits

from fusetune.apply.search.space import Space
from fusetune.apply.search.surrogate import FEWEST, Surrogate, fit_surrogate

Array = npt.NDArray[np.float64]

_DARING = 1.0
"""A set is tried for the score that it may have: the expected one less so many standard deviations."""

_DRAWN, _POPULATION, _GENERATIONS = 512, 16, 15
"""CMA-ES on the surrogate starts at the best of so many points that are drawn; its population and generations."""


class Proposing(Protocol):
    """`propose`, or what gives the same."""

    def __call__(
        self, space: Space, points: Array, scores: Array, number: int, radius: float, seed: Sequence[int]
    ) -> list[dict[str, float]]:
        """Sets to try after those at some points."""
        ...


def propose(
    space: Space, points: Array, scores: Array, number: int, radius: float, seed: Sequence[int]
) -> list[dict[str, float]]:
    """Sets to try after those at some points.

    Parameters
    ----------
    points, scores : (N, P), (N,) of the sets that were tried; lower is better
    number : how many sets are asked for; fewer come where the space has no more near the best
    radius : how far from the best set they may be, in the units of the space
    seed : what the chance follows from

    Notes
    -----
    The first set is that of the lowest expected score, the others those that may be lowest, each as if those before had
    scored as expected (a batch by "kriging believer", Ginsbourger et al. 2010).
    """
    with threadpool_limits(1):  # small matrices: threads cost time, and change the last bits
        return _propose(space, points, scores, number, radius, seed)


def _propose(
    space: Space, points: Array, scores: Array, number: int, radius: float, seed: Sequence[int]
) -> list[dict[str, float]]:
    best = points[np.argmin(scores)]
    box = _box(space, best, radius)
    known = {tuple(space.values(point).values()) for point in points}
    found: list[dict[str, float]] = []
    for candidate in _candidates(space, points, scores, best, box, seed, number):
        values = space.values(candidate)
        if tuple(values.values()) not in known:
            known.add(tuple(values.values()))
            found.append(values)
        if len(found) == number:
            break
    return found


def _candidates(
    space: Space, points: Array, scores: Array, best: Array, box: Array, seed: Sequence[int], number: int
) -> Iterator[Array]:
    if len(scores) >= FEWEST:
        surrogate = fit_surrogate(points, scores)
        for place in range(number):
            found = _lowest(surrogate, best, box, 0.0 if place == 0 else _DARING, [*seed, place])
            yield found
            surrogate = surrogate.believing(found)
    # what the surrogate asked for and was known already is made up for by chance
    chance = np.random.default_rng([*seed, number])
    for _ in range(20 * number):
        yield chance.uniform(box[:, 0], box[:, 1])


def _box(space: Space, centre: Array, radius: float) -> Array:
    box = np.column_stack([centre - radius, centre + radius])
    return np.column_stack([np.maximum(box[:, 0], space.bounds[:, 0]), np.minimum(box[:, 1], space.bounds[:, 1])])


def _lowest(surrogate: Surrogate, start: Array, box: Array, daring: float, seed: Iterable[int]) -> Array:
    """The point in a box where the surrogate's lower bound is lowest."""
    moving = box[:, 1] - box[:, 0] > 1e-9
    if not moving.any():
        return start
    if np.count_nonzero(moving) == 1:
        return _lowest_along(surrogate, start, box, daring, int(np.argmax(moving)))
    low, span = box[moving, 0], box[moving, 1] - box[moving, 0]

    def bound(inside: Array) -> Array:
        points = np.tile(start, (len(inside), 1))
        points[:, moving] = low + inside * span
        mean, spread = surrogate.predict(points)
        return mean - daring * spread

    first, second = np.random.SeedSequence(list(seed)).generate_state(2)
    drawn = np.vstack([(start[moving] - low) / span, np.random.default_rng(first).random((_DRAWN, span.size))])
    values = bound(drawn)
    best, lowest = drawn[np.argmin(values)], float(values.min())
    # inside, for CMA-ES takes no start at a bound
    search = CMA(
        np.clip(best, 0.01, 0.99), 0.15, np.tile([0.0, 1.0], (span.size, 1)),
        seed=int(second), population_size=_POPULATION,
    )  # fmt: skip
    for _ in range(_GENERATIONS):
        asked = np.array([search.ask() for _ in range(_POPULATION)])
        values = bound(asked)
        search.tell(list(zip(asked, values.tolist(), strict=True)))
        if values.min() < lowest:
            best, lowest = asked[np.argmin(values)], float(values.min())
    found = start.copy()
    found[moving] = low + best * span
    return found


def _lowest_along(surrogate: Surrogate, start: Array, box: Array, daring: float, axis: int) -> Array:
    points = np.tile(start, (101, 1))
    points[:, axis] = np.linspace(box[axis, 0], box[axis, 1], 101)
    mean, spread = surrogate.predict(points)
    return np.asarray(points[np.argmin(mean - daring * spread)])
