"""The generations of a search: their number and sizes follow from the space and the settings alone.

So the whole search is planned before the first set is tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fusetune.design.search_settings import SearchSettings
from fusetune.design.tunable_parameters import ARM_PARAMETERS, DELAY_SUFFIX
from fusetune.px4.aid_sources import SENSORS

if TYPE_CHECKING:
    from fusetune.apply.search.space import Space

FIRST_SUFFIXES = (DELAY_SUFFIX, "_POS_X", "_POS_Y", "_POS_Z")
"""Delays and lever arms come first: where they are wrong, a sensor's errors look as if they wandered, and all else is
tuned to hide it."""

MEASURED = (SENSORS["gnss"].delay_parameter, *ARM_PARAMETERS["gnss"])
"""Not searched by the score, for the flights themselves tell them, with an error (`fusetune.analyze.delays`)."""
MEASURED_SIZES = (1, 4)
"""The present set, whose replays measure; then with delay and lever arm as measured, with either, and with none."""

DELAYS, ALL, DELAYS_AGAIN, PUTTING_BACK = "delays", "all", "delays again", "putting back"
STAGES = (DELAYS, ALL, DELAYS_AGAIN, PUTTING_BACK)
OF_DELAYS = (DELAYS, DELAYS_AGAIN)
"""Stages that move, or put back, delays and lever arms alone."""

_PUTTING_DELAYS_BACK_ROUNDS = 2
_PUTTING_BACK_ROUNDS = 3

_FIRST_GENERATIONS, _AGAIN_GENERATIONS = 3, 1
_START_SHARE = 0.2
_GENERATIONS = 6
RADIUS, SHRINKS = 0.6, 0.75
"""How far from the best set the first generation looks, in half ranges, and what share of that the next."""


@dataclass(frozen=True)
class Plan:
    """Sizes of the generations.

    Attributes
    ----------
    parameters : all that are searched
    first : those of the first stage that the score moves
    measured : those that are measured, in the first stage, too
    start : number of sets that the second stage starts with
    generations : sizes of its generations
    """

    parameters: tuple[str, ...]
    first: tuple[str, ...]
    measured: tuple[str, ...]
    start: int
    generations: tuple[int, ...]

    @property
    def first_generations(self) -> tuple[int, ...]:
        """Sizes after the start of the first stage: the lowest point of a parabola, and one beside it by factor."""
        return (1 + len(self.first),) * _FIRST_GENERATIONS

    @property
    def again_generations(self) -> tuple[int, ...]:
        """The same when delays and lever arms are looked at again."""
        return (1 + len(self.first),) * _AGAIN_GENERATIONS

    @property
    def rounds(self) -> tuple[tuple[str, int], ...]:
        """Stage and number of sets of every generation; none asks for more than this."""
        count, measured = len(self.first), len(self.measured)
        first = [start_size(count), *self.first_generations, *(1 + count,) * _PUTTING_DELAYS_BACK_ROUNDS]
        again = [again_size(count), *self.again_generations, *(1 + count,) * _PUTTING_DELAYS_BACK_ROUNDS]
        rest = 1 + len(self.parameters) - count - measured
        back = (rest, rest, 1 + len(self.parameters))
        assert len(back) == _PUTTING_BACK_ROUNDS
        return (
            *(((DELAYS, size) for size in MEASURED_SIZES) if measured else ()),
            *(((DELAYS, size) for size in first) if count else ()),
            (ALL, self.start),
            *((ALL, size) for size in self.generations),
            *(((DELAYS_AGAIN, size) for size in again) if count else ()),
            *((PUTTING_BACK, size) for size in back),
        )


def plan_of(space: Space, settings: SearchSettings) -> Plan:
    """Share the evaluations out among the searches: what they start with is the same, and counts once."""
    return _plan(space.parameters, settings)


def planned_rounds(settings: SearchSettings) -> int:
    """Number of rounds that the searches of a study take at the most, whatever its flights turn out to tell.

    The last one tries what was found on the flights that were kept aside.
    """
    return len(_plan(settings.searched, settings).rounds) + 1


def fewest_sets(space: Space, settings: SearchSettings) -> int:
    """How many sets the smallest plan for a space tries, about."""
    own, shared = _fixed_sets(space.parameters), _shared_sets(space.parameters)
    return shared + 2 * len(space.parameters) + (settings.folds + 1) * (own + _GENERATIONS)


def _plan(parameters: Sequence[str], settings: SearchSettings) -> Plan:
    searches = settings.folds + 1
    left = settings.evaluations - _shared_sets(parameters) - searches * _fixed_sets(parameters)
    start = max(round(_START_SHARE * left), 2 * len(parameters))
    size = max((left - start) // (searches * _GENERATIONS), 1)
    measured = tuple(name for name in parameters if name in MEASURED)
    return Plan(tuple(parameters), _first(parameters), measured, start, (size,) * _GENERATIONS)


def _first(parameters: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for name in parameters if name.endswith(FIRST_SUFFIXES) and name not in MEASURED)


def _shared_sets(parameters: Sequence[str]) -> int:
    """What all searches begin with."""
    count = len(_first(parameters))
    return start_size(count) if count else 1


def _fixed_sets(parameters: Sequence[str]) -> int:
    """Sets of a search beside those of its second stage: as a rule, for what is put back is not known before."""
    count = len(_first(parameters))
    rest = len(parameters) - count - len([name for name in parameters if name in MEASURED])
    of_delays = (_FIRST_GENERATIONS + _AGAIN_GENERATIONS) * (1 + count) + again_size(count) + 2 * 2 * count
    return (of_delays if count else 0) + MEASURED_SIZES[1] + 2 * rest + len(parameters) // 2


def start_size(factors: int) -> int:
    """Of a star with four points along each factor, and its middle."""
    return 4 * factors + 1


def again_size(factors: int) -> int:
    """Of a star with two points along each factor, and its middle."""
    return 2 * factors + 1
