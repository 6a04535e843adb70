"""One search on some flights: delays and lever arms first, then all with the weights anew, then putting back.

A search is a generator that yields what it wants tried, a generation at a time, and is sent how that compares. Their
number is planned; a generation may be empty. What is asked follows from the answers alone, so that a search which is
run again with the same answers asks the same.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.objective import objective
from fusetune.apply.search.plan import ALL, DELAYS, FIRST_RADIUS, PUTTING_BACK, RADIUS, SHRINKS, STAGES, Plan
from fusetune.apply.search.proposals import propose
from fusetune.apply.search.requests import Values, values_of
from fusetune.apply.search.settings import SearchSettings
from fusetune.apply.search.space import DELAY_SUFFIX, Space

Array = npt.NDArray[np.float64]

_NEAR = 0.35
"""After the first stage delays move no farther from what it found, in half ranges."""

_MATTERS = 0.01
"""What the first stage finds is taken where it makes errors smaller by 1 %."""

_SHARE_OF_GAIN = 0.1
"""Putting back costs no more than this share of the gain, however large the standard error is."""


@dataclass(frozen=True)
class Ask:
    """Sets to be compared with a base on the flights of a search."""

    stage: str
    base: Values
    sets: tuple[Values, ...]


Asking = Generator[Ask, Comparison, "Found"]


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes
    ----------
    values : all factors; those that are put back have the present value
    changed : names of those that differ from the present ones
    before_putting_back : the values before
    costs : of each parameter that is changed, by how much the score is worse with it alone put back, nat
    base : what all but the first stage was compared with
    """

    values: dict[str, float]
    changed: tuple[str, ...]
    before_putting_back: dict[str, float]
    costs: dict[str, float]
    base: dict[str, float]


@dataclass
class _Tried:
    """What a stage tried: points and what is made small, the base at the present point among them."""

    space: Space
    points: list[Array] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)

    def add(self, sets: Sequence[Mapping[str, float]], scores: Array) -> None:
        self.points += [self.space.point(one) for one in sets]
        self.scores += scores.tolist()

    @property
    def best(self) -> Array:
        return self.points[int(np.argmin(self.scores))]


def search_stages(space: Space, plan: Plan, settings: SearchSettings) -> Asking:
    """Search; the origin of the space is the present set."""
    present = space.values(np.zeros(len(space.factors)))
    base = yield from _first_stage(space, plan, settings, present)
    around = _second_space(space, base, plan.first)
    best = yield from _stage(
        around, ALL, base, _start(around, plan.start, settings.seed), plan.generations, RADIUS, settings.seed
    )
    return (yield from _putting_back(space, best, base, present, settings))


def _first_stage(
    space: Space, plan: Plan, settings: SearchSettings, present: dict[str, float]
) -> Generator[Ask, Comparison, dict[str, float]]:
    if not plan.first:
        return present
    first = space.only(plan.first)
    star = [values for values in _star(first) if values != {name: present[name] for name in plan.first}]
    best = yield from _stage(
        first, DELAYS, present, [present | one for one in star], plan.first_generations, FIRST_RADIUS, settings.seed
    )
    return best


def _stage(
    space: Space,
    stage: str,
    base: dict[str, float],
    start: Sequence[dict[str, float]],
    generations: Sequence[int],
    radius: float,
    seed: int,
) -> Generator[Ask, Comparison, dict[str, float]]:
    """The best set of the factors of a space; all others as in the base, the origin of the space."""
    tried = _Tried(space)
    tried.add([base], np.zeros(1))
    asked: Sequence[dict[str, float]] = start
    for generation, size in enumerate((*generations, 0)):
        compared = yield _ask(stage, space, base, asked)
        tried.add(asked, objective(compared))
        if size:
            chance = (seed, STAGES.index(stage), generation)
            new = propose(space, np.array(tried.points), np.array(tried.scores), size, radius, chance)
            asked = [base | one for one in new]
            radius *= SHRINKS
    best = base | space.values(tried.best)
    return best if min(tried.scores) < (-_MATTERS if stage == DELAYS else 0.0) else base


def _second_space(space: Space, base: dict[str, float], first: Sequence[str]) -> Space:
    """What the second stage moves: all but lever arms, and delays near what the first found."""
    found = []
    for factor, whole in zip(space.around(base).factors, space.factors, strict=True):
        if factor.parameter not in first:
            found.append(factor)
        elif factor.parameter.endswith(DELAY_SUFFIX):
            reach = _NEAR * max(map(abs, whole.bounds)) * whole.unit_step
            low, high = max(factor.low, factor.origin - reach), min(factor.high, factor.origin + reach)
            found.append(replace(factor, low=low, high=high))
    return replace(space, factors=tuple(found))


def _star(space: Space) -> list[dict[str, float]]:
    """Points along each factor alone, a third and all of the way to its bounds."""
    points = []
    for place, (low, high) in enumerate(space.bounds):
        for one in (low, low / 3.0, high / 3.0, high):
            point = np.zeros(len(space.factors))
            point[place] = one
            points.append(point)
    return [space.values(point) for point in points]


def _start(space: Space, number: int, seed: int) -> list[dict[str, float]]:
    """A scrambled Sobol sequence over the space."""
    from scipy.stats import qmc

    drawn = qmc.Sobol(len(space.factors), rng=np.random.default_rng([seed, len(space.factors)])).random(number)
    low, high = space.bounds[:, 0], space.bounds[:, 1]
    return [space.values(low + row * (high - low)) for row in drawn]


def _putting_back(
    space: Space, best: dict[str, float], base: dict[str, float], present: dict[str, float], settings: SearchSettings
) -> Asking:
    """Put parameters back to the present value, the one that costs least first, as long as that costs little."""
    changed = [name for name in best if best[name] != present[name]]
    ask = [best, *(best | {name: present[name]} for name in changed)]
    alone = yield _ask(PUTTING_BACK, space, base, ask)
    scores = objective(alone)
    alone_costs = dict(zip(changed, (scores[1:] - scores[0]).tolist(), strict=True))
    order = sorted(changed, key=lambda name: alone_costs[name])
    nested = [best | {name: present[name] for name in order[: count + 1]} for count in range(len(order))]
    together = yield _ask(PUTTING_BACK, space, base, [best, *nested])
    values = _fewest_changes(together, [best, *nested], settings)
    kept = tuple(name for name in best if values[name] != present[name])
    without = [values | {name: present[name]} for name in kept]
    last = yield _ask(PUTTING_BACK, space, base, [values, *without])
    steps = objective(last)
    costs = dict(zip(kept, (steps[1:] - steps[0]).tolist(), strict=True))
    return Found(space.whole(values), kept, space.whole(best), costs, space.whole(base))


def _ask(stage: str, space: Space, base: dict[str, float], sets: Sequence[dict[str, float]]) -> Ask:
    return Ask(stage, values_of(space.whole(base)), tuple(values_of(space.whole(one)) for one in sets))


def _fewest_changes(
    compared: Comparison, sets: Sequence[dict[str, float]], settings: SearchSettings
) -> dict[str, float]:
    """The last of sets, each with one more parameter put back, that is hardly worse than the first."""
    scores = objective(compared)
    rows = compared.differences[:, compared.usable]
    gain = max(-float(scores[0]), 0.0)
    chosen = sets[0]
    for place in range(1, len(sets)):
        steps = rows[place] - rows[0]
        error = float(np.std(steps, ddof=1) / np.sqrt(steps.size)) if steps.size > 1 else 0.0
        little = max(np.log1p(0.01 * settings.putting_back_percent), min(error, _SHARE_OF_GAIN * gain))
        if scores[place] - scores[0] <= little:
            chosen = sets[place]
    return chosen
