"""From values to places, and where on them ticks stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (1e-3, 1e5)
"""Between these figures are written out."""


@dataclass(frozen=True)
class Linear:
    """Values from `low` to `high` onto places from `start` to `stop`."""

    low: float
    high: float
    start: float
    stop: float

    def __call__(self, value: npt.ArrayLike) -> Array:
        """Places of values."""
        span = self.high - self.low
        return self.start + (np.asarray(value, np.float64) - self.low) * ((self.stop - self.start) / span)

    def at(self, value: float) -> float:
        """Place of one value."""
        return self.start + (value - self.low) * (self.stop - self.start) / (self.high - self.low)

    def holds(self, value: float) -> bool:
        """Whether a value lies on the axis."""
        return self.low <= value <= self.high

    def ticks(self, most: int = 5, *, whole: bool = False) -> list[float]:
        """Round values, at most so many; whole ones alone if asked for."""
        return round_values(self.low, self.high, most, whole=whole)


@dataclass(frozen=True)
class Log:
    """Positive values from `low` to `high` onto places from `start` to `stop`, equal ratios equally far apart."""

    low: float
    high: float
    start: float
    stop: float

    def __call__(self, value: npt.ArrayLike) -> Array:
        """Places of values; those that are not positive have none."""
        values = np.asarray(value, np.float64)
        positive = np.where(values > 0.0, values, np.nan)
        share = np.log(positive / self.low) / math.log(self.high / self.low)
        return self.start + share * (self.stop - self.start)

    def at(self, value: float) -> float:
        """Place of one value."""
        return self.start + math.log(value / self.low) / math.log(self.high / self.low) * (self.stop - self.start)

    def holds(self, value: float) -> bool:
        """Whether a value lies on the axis."""
        return self.low <= value <= self.high

    def ticks(self, most: int = 5) -> list[float]:
        """Values of one, two or three of 1, 2 and 5 to the decade, or decades alone, at most so many."""
        low, high = self.low * (1.0 - 1e-9), self.high * (1.0 + 1e-9)
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        for digits in ((1, 2, 5), (1, 3), (1,)):
            found = [digit * 10.0**power for power in decades for digit in digits]
            shown = [one for one in found if low <= one <= high]
            if 2 <= len(shown) <= most:
                return shown
        if len(shown) < 2:  # less than a decade that holds at most one round value
            return round_values(self.low, self.high, most)
        step = -(-len(shown) // most)
        return shown[::step]


Scale = Linear | Log


def round_values(low: float, high: float, most: int, *, whole: bool = False) -> list[float]:
    """Multiples of a round step between two values, at most so many."""
    span = high - low
    if not (math.isfinite(span) and span > 0.0):
        return []
    power = 10.0 ** math.floor(math.log10(span / most))
    for step in (digit * power for digit in (*_STEPS, 20.0, 50.0)):
        if whole and step != round(step):
            continue
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first + 1 <= most:
            return [index * step for index in range(first, last + 1)]
    return []


def figure(value: float, digits: int = 4) -> str:
    """A figure as an axis has it, with the typographical minus."""
    size = abs(value)
    if size < 1e-12:
        return "0"
    if size < _PLAIN[0] or size >= _PLAIN[1]:
        exponent = math.floor(math.log10(size) + 1e-9)
        factor = f"{value / 10.0**exponent:.3g}"
        power = "10" + str(exponent).translate(_RAISED)
        return power if factor == "1" else minus(f"{factor}·{power}")
    return minus(f"{value:.{digits}g}")


def signed_figure(value: float, digits: int = 4) -> str:
    """As `figure`, with a sign."""
    told = figure(value, digits)
    return told if value <= 0.0 or told == "0" else f"+{told}"


def minus(words: str) -> str:
    """With the typographical sign."""
    return words.replace("-", "−")


def percent(value: float, decimals: int = 1) -> str:
    """A change in percent, with its sign."""
    return minus(f"{value:+.{decimals}f} %")
