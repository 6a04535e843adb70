"""Factors: parameters that are varied, on what scale and between which bounds.

A factor maps its values to coordinates in which a step means the same everywhere: powers of a ratio to the present
value on a logarithmic scale, steps of a fixed length on a linear one. Designed studies draw in these
coordinates, searches move in them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fusetune.design.tunable_parameters import TUNABLE_PARAMETERS, Scale, TunableParameter
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, as_float32, metadata_of

_LARGEST_FLOAT32 = (2.0 - 2.0**-23) * 2.0**127


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


def factors_around(
    present: Mapping[str, float],
    parameters: Sequence[str],
    *,
    ratio: float = 8.0,
    delay_ms: float | None = None,
    lever_arm_m: float | None = None,
) -> tuple[Factor, ...]:
    """Factors whose origin is what the vehicle flies, within reach of it and inside the sane range.

    A unit of a coordinate is the step of the parameter's kind (`tunable_parameters.KINDS`). A value of the vehicle that
    lies outside of the sane range stays the origin and widens the bounds up to itself. One that has no logarithm (0 or
    less) is replaced by the lower end of the sane range: a noise of 0 is switched off, which no ratio leads to. One
    that is unknown or no number is PX4's default, as in a replay.

    Parameters
    ----------
    present : what the vehicle flies, name → value, others than those varied, too (delays know each other)
    parameters : names of the catalogue, in the order in which the factors are wanted
    ratio : bounds on a logarithmic scale are the origin divided and multiplied by this
    delay_ms, lever_arm_m : how far they reach on a linear one; by default as the catalogue says

    Raises
    ------
    ParameterError
        A parameter is not in the catalogue.
    """
    if not ratio > 1.0:
        raise ValueError(f"ratio is {ratio}, must be above 1")
    reach = {"delay": delay_ms, "lever arm": lever_arm_m}
    return tuple(_factor_around(present, _tunable(name), ratio, reach) for name in parameters)


def _tunable(name: str) -> TunableParameter:
    if name not in TUNABLE_PARAMETERS:
        metadata_of(name)
        raise ParameterError(name, "it is none of those that are tuned", "Choose one of those in docs/studies.md")
    return TUNABLE_PARAMETERS[name]


def _factor_around(
    present: Mapping[str, float], parameter: TunableParameter, ratio: float, reaches: Mapping[str, float | None]
) -> Factor:
    facts = parameter.facts
    sane_low, sane_high = parameter.sane_range(present)
    origin = float(present.get(parameter.name, math.nan))
    origin = as_float32(origin) if abs(origin) <= _LARGEST_FLOAT32 else PARAMETERS[parameter.name].default
    if facts.scale == "log":
        origin = origin if origin > 0.0 else sane_low
        low, high = origin / ratio, origin * ratio
    else:
        given = reaches[parameter.kind]
        reach = facts.reach if given is None else given
        low, high = origin - reach, origin + reach
    # the inner clip lets an origin outside of the sane range reach it, the outer one keeps the origin inside the bounds
    low = min(origin, max(sane_low, min(low, sane_high)))
    high = max(origin, min(sane_high, max(high, sane_low)))
    return Factor(parameter.name, facts.scale, low, high, origin, facts.step, facts.grid)
