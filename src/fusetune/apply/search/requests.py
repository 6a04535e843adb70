"""What a search asks for: a set, tried on a flight beside a base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fusetune.apply.search.space import Space
from fusetune.px4.parameters.ekf2_parameters import as_float32

Values = tuple[tuple[str, float], ...]
"""What a set is known by: its parameters in the order of their names, with values as the float32 that PX4 holds."""


class Request(NamedTuple):
    """A set to be tried on a flight; the base says on what, see `fusetune.analyze.trials.tried_flight`."""

    flight: str
    base: Values
    values: Values


@dataclass(frozen=True)
class Ask:
    """Sets to be compared with a base on the flights of a search.

    Attributes
    ----------
    seen_by : the set that says how white the sources are; None where it is the base
    """

    stage: str
    base: Values
    sets: tuple[Values, ...]
    seen_by: Values | None = None


def ask_for(stage: str, space: Space, base: Mapping[str, float], sets: Sequence[Mapping[str, float]]) -> Ask:
    """Ask for sets of a space, each with what goes along with it."""
    return Ask(stage, values_of(space.whole(base)), tuple(values_of(space.whole(one)) for one in sets))


def values_of(overrides: Mapping[str, float]) -> Values:
    """What a set is known by."""
    return tuple((name, as_float32(value)) for name, value in sorted(overrides.items()))
