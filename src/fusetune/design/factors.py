"""Factors: parameters that are varied, on what scale and between which bounds.

A factor maps its values to coordinates in which a step means the same everywhere: powers of two of the present value
on a logarithmic scale, steps of a grid or of a fixed length on a linear one. Designed studies draw in these
coordinates, searches move in them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fusetune.px4.parameters.ekf2_parameters import as_float32

Scale = Literal["log", "linear"]


@dataclass(frozen=True)
class Factor:
    """A parameter and the values that it may be given.

    Attributes
    ----------
    parameter : its name
    scale : "log" where ratios count, "linear" where differences do
    low, high : bounds of its value, in its unit
    origin : the value at coordinate 0, usually the present one; inside the bounds
    unit_step : what one unit of the coordinate is: a ratio on a logarithmic scale, a difference on a linear one
    grid : values are whole multiples of this; 0 where there is no grid
    """

    parameter: str
    scale: Scale
    low: float
    high: float
    origin: float
    unit_step: float
    grid: float = 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Coordinates of the bounds."""
        return self.coordinate(self.low), self.coordinate(self.high)

    def coordinate(self, value: float) -> float:
        """Coordinate of a value."""
        if self.scale == "log":
            return math.log(value / self.origin) / math.log(self.unit_step)
        return (value - self.origin) / self.unit_step

    def value(self, coordinate: float) -> float:
        """Value at a coordinate, inside the bounds and on the grid, as the float32 that PX4 holds."""
        if self.scale == "log":
            value = self.origin * self.unit_step**coordinate
        else:
            value = self.origin + self.unit_step * coordinate
        value = min(max(value, self.low), self.high)
        return as_float32(self.on_grid(value))

    def on_grid(self, value: float) -> float:
        """The nearest value of the grid that lies inside the bounds."""
        if not self.grid:
            return value
        nearest = round(value / self.grid) * self.grid
        if nearest < self.low:
            nearest = math.ceil(self.low / self.grid) * self.grid
        if nearest > self.high:
            nearest = math.floor(self.high / self.grid) * self.grid
        return nearest
