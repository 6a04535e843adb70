"""The space a search moves in: factors in units of their half range, and values as they are written.

Values on a logarithmic scale are rounded to two significant digits: no number of flights resolves more, and a set is
searched, tried and written with the same values. The present value stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fusetune.design.factors import Factor
from fusetune.px4.parameters.ekf2_parameters import as_float32

Array = npt.NDArray[np.float64]

_DIGITS = 2


@dataclass(frozen=True)
class Space:
    """P factors with the present values as their origins.

    Points are (P,) arrays: 0 is the present value, ±1 the farther of its bounds.
    """

    factors: tuple[Factor, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(factor.parameter for factor in self.factors)

    @cached_property
    def _units(self) -> Array:
        return np.array([max(map(abs, factor.bounds)) or 1.0 for factor in self.factors])

    @cached_property
    def bounds(self) -> Array:
        """(P, 2) of the points."""
        return np.array([factor.bounds for factor in self.factors]) / self._units[:, None]

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
        return Space(tuple(factor for factor in self.factors if factor.parameter in parameters))

    def around(self, values: Mapping[str, float]) -> Space:
        """The same factors, with other present values; a value beyond a bound moves the bound."""
        found = []
        for factor in self.factors:
            value = values.get(factor.parameter, factor.origin)
            found.append(
                Factor(
                    factor.parameter, factor.scale, min(factor.low, value), max(factor.high, value), value,
                    factor.unit_step, factor.grid,
                )
            )  # fmt: skip
        return Space(tuple(found))


def _written(factor: Factor, coordinate: float) -> float:
    if coordinate == 0.0:
        return as_float32(factor.origin)
    value = factor.value(coordinate)
    if factor.grid:
        return value
    rounded = as_float32(float(f"{value:.{_DIGITS}g}"))
    return rounded if factor.low <= rounded <= factor.high else value
