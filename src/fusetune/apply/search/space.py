"""The space a search moves in: factors in units of their half range, and values as they are written.

Values on a logarithmic scale are rounded to two significant digits: no number of flights resolves more, and a set is
searched, tried and written with the same values. The present value stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fusetune.design.factors import Factor
from fusetune.design.tunable_parameters import DELAY_LIMIT, DELAY_SUFFIX, reach_ms
from fusetune.px4.parameters.ekf2_parameters import as_float32

Array = npt.NDArray[np.float64]

_DIGITS = 2


@dataclass(frozen=True)
class Space:
    """P factors with the present values as their origins.

    Points are (P,) arrays: 0 is the present value, ±1 the farther of its bounds.
    """

    factors: tuple[Factor, ...]
    delay_max: float = math.inf
    """EKF2_DELAY_MAX of the vehicle, ms; infinite where nothing is searched that it bounds."""

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(factor.parameter for factor in self.factors)

    @property
    def present(self) -> dict[str, float]:
        """The present set: the one at the point 0."""
        return self.values(np.zeros(len(self.factors)))

    @cached_property
    def _units(self) -> Array:
        return np.array([max(map(abs, factor.bounds)) or 1.0 for factor in self.factors])

    @cached_property
    def bounds(self) -> Array:
        """(P, 2) of the points."""
        return np.array([factor.bounds for factor in self.factors]).reshape(-1, 2) / self._units[:, None]

    def values(self, point: Array) -> dict[str, float]:
        """The set at a point, with values as they are written."""
        coordinates = point * self._units
        return {
            factor.parameter: _written(factor, float(one))
            for factor, one in zip(self.factors, coordinates, strict=True)
        }

    def point(self, values: Mapping[str, float]) -> Array:
        """The point of a set; what it leaves out has the present value."""
        found = [factor.coordinate(values.get(factor.parameter, factor.origin)) for factor in self.factors]
        return np.array(found) / self._units

    def only(self, parameters: Sequence[str]) -> Space:
        """The space of some of the factors."""
        return replace(self, factors=tuple(one for one in self.factors if one.parameter in parameters))

    def around(self, values: Mapping[str, float]) -> Space:
        """The same factors, with other present values; a value beyond a bound moves the bound."""
        found = []
        for factor in self.factors:
            value = values.get(factor.parameter, factor.origin)
            low, high = min(factor.low, value), max(factor.high, value)
            found.append(replace(factor, low=low, high=high, origin=value))
        return replace(self, factors=tuple(found))

    def whole(self, values: Mapping[str, float]) -> dict[str, float]:
        """A set with what goes along with it: a longer EKF2_DELAY_MAX where one of its delays asks for it."""
        needed = reach_ms(max((value for name, value in values.items() if name.endswith(DELAY_SUFFIX)), default=0.0))
        return {**values, DELAY_LIMIT: needed} if needed > self.delay_max else dict(values)


def _written(factor: Factor, coordinate: float) -> float:
    if coordinate == 0.0:
        return as_float32(factor.origin)
    value = factor.value(coordinate)
    if factor.grid:
        return value
    rounded = as_float32(float(f"{value:.{_DIGITS}g}"))
    return min(max(rounded, as_float32(factor.low)), as_float32(factor.high))
