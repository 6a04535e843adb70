"""Constraints between the parameters of a set: which of two has to be smaller."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

CONSTRAINT_PATTERN = r"^[A-Z0-9_]{1,16} *(<|<=) *[A-Z0-9_]{1,16}$"


@dataclass(frozen=True)
class Constraint:
    """One parameter is below another, or not above it."""

    smaller: str
    larger: str
    may_be_equal: bool

    @classmethod
    def of(cls, text: str) -> Constraint:
        """From what a study says: ``A < B`` or ``A <= B``."""
        smaller, sign, larger = re.split(r" *(<=|<) *", text)
        return cls(smaller, larger, sign == "<=")

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether it holds for a set that gives values to both."""
        smaller, larger = values[self.smaller], values[self.larger]
        return smaller < larger or (self.may_be_equal and smaller == larger)
