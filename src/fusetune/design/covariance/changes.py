"""What a variation changes, in words of a design file: a new value, or a factor on the one that is there."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.design.names import name_problem, one_line
from fusetune.settings.declaration import required, setting

LABEL_PATTERN = "^[^\\s].{0,79}$"
_FACTOR = re.compile(r"\s*([×*÷/])\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*")

Value = float | bool | str


@dataclass(frozen=True)
class Variation:
    """One thing that could be otherwise."""

    name: str = required("what it is called in tables and figures", pattern=LABEL_PATTERN)
    changes: Mapping[str, Any] = required(
        "what changes, `sensor.rate_hz`, `.delay_ms`, `.sd`, `.used` or a parameter: its new value, or a factor on the "
        "present one as a text, `×2` or `÷10`",
        at_least=1,
    )


@dataclass(frozen=True)
class Sweep:
    """Something that is changed step by step, for a curve."""

    name: str = required("becomes the name of a figure's file", pattern="^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")
    lines: tuple[str, ...] = required("what changes, a curve each; ` + ` joins what changes together", at_least=1)
    label: str = setting("", "what the figure's axis is called")
    values: tuple[float, ...] = setting((), "the values that it takes", low=0)
    factors: tuple[float, ...] = setting((), "or the factors on the present value", above=0)
    states: tuple[str, ...] = setting((), "of which states; empty: of all")

    @property
    def points(self) -> tuple[float, ...]:
        """Values or factors."""
        return self.values or self.factors

    def changes(self, line: str, point: float) -> dict[str, Value]:
        """What a point of a curve changes."""
        value: Value = point if self.values else f"×{point!r}"
        return {name.strip(): value for name in line.split(" + ")}

    def problems(self) -> Iterator[str]:
        """What contradicts itself in it."""
        if bool(self.values) == bool(self.factors):
            yield f"sweep {self.name}: expected either values or factors"
        problem = name_problem(self.name)
        if problem:
            yield f"sweep {self.name}: {problem}"


def changed(value: float, change: Value) -> float:
    """A value after a change.

    Raises
    ------
    ValueError
        The change is neither a number nor a factor.
    """
    if isinstance(change, bool):
        raise ValueError(f"is {str(change).lower()}; expected a number or a factor such as ×2 or ÷10")
    if isinstance(change, int | float):
        return float(change)
    return value * factor_of(change)


def factor_of(change: Value) -> float:
    """The factor that a text names; raises `ValueError` where it names none."""
    found = _FACTOR.fullmatch(change) if isinstance(change, str) else None
    try:
        number = float(found[2]) if found else 0.0
    except ValueError:
        number = 0.0
    if not found or not number > 0.0:
        raise ValueError(f"is {one_line(str(change))[:60]!r}; expected a factor such as ×2 or ÷10")
    return number if found[1] in "×*" else 1.0 / number


def switched(change: Value) -> bool:
    """What a change says of used and not; raises `ValueError` where it says neither."""
    if not isinstance(change, bool):
        raise ValueError(f"is {one_line(str(change))[:60]!r}; expected true or false")
    return change
