"""What a search asks for: a set, tried on a flight beside a base."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from fusetune.px4.parameters.ekf2_parameters import as_float32

Values = tuple[tuple[str, float], ...]
"""What a set is known by: its parameters in the order of their names, with values as the float32 that PX4 holds."""


class Request(NamedTuple):
    """A set to be tried on a flight; the base says on what, see `fusetune.analyze.trials.tried_flight`."""

    flight: str
    base: Values
    values: Values


def values_of(overrides: Mapping[str, float]) -> Values:
    """What a set is known by."""
    return tuple((name, as_float32(value)) for name, value in sorted(overrides.items()))
