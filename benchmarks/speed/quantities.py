"""What is measured: a name, a unit, and how two measurements of it are compared."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """Of what a quantity is made, and so what its noise is like."""

    CPU = "cpu"
    """CPU time; told as a ratio to the calibration loop of the same run, too."""
    WALL = "wall"
    """Time on the clock; likewise, and what others do on the machine enters it."""
    MEMORY = "memory"
    RATIO = "ratio"
    """Has no unit of the machine; it is compared as it is."""


TOLERANCES = {Kind.CPU: 0.10, Kind.WALL: 0.25, Kind.MEMORY: 0.10, Kind.RATIO: 0.10}
"""By how much a quantity may be worse than another revision's before it counts as a regression."""


@dataclass(frozen=True)
class Quantity:
    """One line of the table."""

    words: str
    unit: str
    kind: Kind = Kind.CPU
    reach: float | None = None
    """What it is meant to be, at the most or, where more is better, at the least."""
    more_is_better: bool = False

    def calibrated(self, value: float, loop_s: float) -> float:
        """The value as a multiple of the calibration loop, which takes `loop_s` on this machine at this time."""
        if self.kind not in (Kind.CPU, Kind.WALL):
            return value
        return value * loop_s if self.more_is_better else value / loop_s

    def worse_by(self, new: float, old: float) -> float:
        """By which share the new value is worse than the old one; negative where it is better."""
        if not old or not new:
            return 0.0
        return (old / new if self.more_is_better else new / old) - 1.0


class Lacking(Exception):
    """This machine lacks what a section measures; says what."""


class Failed(Exception):
    """A command ended otherwise than it should; holds its last words."""
