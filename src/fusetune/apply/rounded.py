"""Figures as the files of this room hold them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

SIGNIFICANT_DIGITS = 9


def rounded(value: Any, digits: int = SIGNIFICANT_DIGITS) -> Any:
    """Round every float to so many significant digits, as the last bits may differ between machines; None where none
    is."""
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: rounded(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item, digits) for item in value]
    return value
