"""One search on some flights: delays and lever arms, all with the weights anew, delays again, then putting back.

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
from fusetune.apply.search.measured_place import measured_values
from fusetune.apply.search.objective import objective
from fusetune.apply.search.parabola import propose_on_parabola
from fusetune.apply.search.plan import ALL, DELAYS, DELAYS_AGAIN, PUTTING_BACK, RADIUS, SHRINKS, STAGES, Plan
from fusetune.apply.search.proposals import Proposing, propose
from fusetune.apply.search.putting_back import put_back
from fusetune.apply.search.requests import Ask, ask_for
from fusetune.apply.search.space import Space
from fusetune.design.search_settings import SearchSettings
from fusetune.design.tunable_parameters import DELAY_SUFFIX

Array = npt.NDArray[np.float64]

_NEAR = 0.35
"""After the first stage delays move no farther from what it found, in half ranges."""

_HARDLY = 0.01
"""The score speaks against what is measured if it is worse by so much, nat."""

_STAR = (1.0 / 3.0, 1.0)
"""How far along each of them the first stage looks, in shares of the way to its bounds."""

_AGAIN = 0.2
"""How far around what was found delays and lever arms are looked at again, in half ranges: 20 ms, 0.1 m."""


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


def search_stages(space: Space, plan: Plan, settings: SearchSettings, proposing: Proposing = propose) -> Asking:
    """Search; the origin of the space is the present set."""
    present = space.present
    first = space.only(plan.first)
    base = present
    if plan.measured:
        base = yield from _measured(space, present, space.only(plan.measured))
    if plan.first:
        generations = len(plan.first_generations)
        moved = yield from _around(first, base, _STAR, generations, present, DELAYS)
        changed = [name for name in plan.first if moved[name] != present[name]]
        base = yield from put_back(space, moved, present, present, changed, settings, DELAYS)
    around = _second_space(space, base, plan)
    best = yield from _second_stage(around, base, plan, settings, proposing)
    before = best
    if plan.first:
        generations = len(plan.again_generations)
        before = yield from _around(first.around(best), best, (_AGAIN,), generations, base, DELAYS_AGAIN)
        changed = [name for name in plan.first if before[name] != present[name]]
        best = yield from put_back(space, before, base, present, changed, settings, DELAYS_AGAIN)
    rest = [
        name for name in space.parameters if name not in (*plan.first, *plan.measured) and best[name] != present[name]
    ]
    values = yield from put_back(space, best, base, present, rest, settings, PUTTING_BACK)
    kept = tuple(name for name in space.parameters if values[name] != present[name])
    last = yield ask_for(PUTTING_BACK, space, base, [values, *(values | {name: present[name]} for name in kept)])
    steps = objective(last, PUTTING_BACK)
    costs = dict(zip(kept, (steps[1:] - steps[0]).tolist(), strict=True))
    return Found(space.whole(values), kept, space.whole(before), costs, space.whole(base))


def _measured(space: Space, present: dict[str, float], of_place: Space) -> Generator[Ask, Comparison, dict[str, float]]:
    """The present set with what the flights measure to be wrong, as far as the score does not speak against it."""
    compared = yield ask_for(DELAYS, space, present, [present])
    starts = [present | one for one in measured_values(of_place, present, compared.places)] + [present]
    scores = objective((yield ask_for(DELAYS, space, present, starts)), DELAYS)
    return next(one for one, score in zip(starts, scores, strict=True) if score <= scores.min() + _HARDLY)


def _around(
    space: Space, start: dict[str, float], reach: Sequence[float], generations: int, base: dict[str, float], stage: str
) -> Generator[Ask, Comparison, dict[str, float]]:
    """Delays and lever arms around a set, the origin of the space; compared with the base."""
    asked = _with_star(space, start, _star(space, reach))
    tried = _Tried(space)
    for generation in range(generations + 1):
        compared = yield ask_for(stage, space, base, asked)
        tried.add(asked, objective(compared, stage))
        if generation < generations:
            new = propose_on_parabola(space, np.array(tried.points), np.array(tried.scores), generation)
            asked = [start | one for one in new]
    return start | space.values(tried.best) if min(tried.scores) < tried.scores[0] else start


def _with_star(space: Space, start: dict[str, float], star: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    known = {name: start[name] for name in space.parameters}
    return [start, *(start | one for one in star if one != known)]


def _second_stage(
    space: Space, base: dict[str, float], plan: Plan, settings: SearchSettings, proposing: Proposing
) -> Generator[Ask, Comparison, dict[str, float]]:
    """The best set of the factors of a space; all others as in the base, the origin of the space."""
    tried = _Tried(space)
    tried.add([base], np.zeros(1))
    asked: Sequence[dict[str, float]] = [base | one for one in _start(space, plan.start, settings.seed)]
    radius = RADIUS
    for generation, size in enumerate((*plan.generations, 0)):
        compared = yield ask_for(ALL, space, base, asked)
        tried.add(asked, objective(compared, ALL))
        if size and space.factors:
            chance = (settings.seed, STAGES.index(ALL), generation)
            new = proposing(space, np.array(tried.points), np.array(tried.scores), size, radius, chance)
            asked = [base | one for one in new]
            radius *= SHRINKS
        else:
            asked = []
    return base | space.values(tried.best)


def _second_space(space: Space, base: dict[str, float], plan: Plan) -> Space:
    """What the second stage moves: all but lever arms and what is measured, and delays near what the first found."""
    found = []
    for factor, whole in zip(space.around(base).factors, space.factors, strict=True):
        if factor.parameter in plan.measured:
            continue
        if factor.parameter not in plan.first:
            found.append(factor)
        elif factor.parameter.endswith(DELAY_SUFFIX):
            reach = _NEAR * max(map(abs, whole.bounds)) * whole.unit_step
            low, high = max(factor.low, factor.origin - reach), min(factor.high, factor.origin + reach)
            found.append(replace(factor, low=low, high=high))
    return replace(space, factors=tuple(found))


def _star(space: Space, shares: Sequence[float]) -> list[dict[str, float]]:
    """Points along each factor alone, on both sides, so far of the way to its bounds."""
    points = []
    for place, bounds in enumerate(space.bounds):
        for bound in bounds:
            for share in shares:
                point = np.zeros(len(space.factors))
                point[place] = share * bound
                points.append(point)
    return [space.values(point) for point in points]


def _start(space: Space, number: int, seed: int) -> list[dict[str, float]]:
    """A scrambled Sobol sequence over the space."""
    from scipy.stats import qmc

    if not space.factors:
        return []
    sequence = qmc.Sobol(len(space.factors), rng=np.random.default_rng([seed, len(space.factors)]))
    drawn = sequence.random_base2(max(number - 1, 1).bit_length())[:number]
    low, high = space.bounds[:, 0], space.bounds[:, 1]
    return [space.values(low + row * (high - low)) for row in drawn]
