"""A float parameter as the shortest text that every reader turns into the same float32."""

from __future__ import annotations

import math
from decimal import Decimal

from fusetune.px4.parameters.ekf2_parameters import as_float32

_DIGITS = range(1, 10)
"""Nine digits tell any two float32 apart."""
_PLAIN = (1e-6, 1e10)


def float32_text(value: float) -> str:
    """The shortest decimal that is, read as a double and stored as a float32, the stored value.

    Raises
    ------
    ValueError
        The value is not finite.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no value of a parameter")
    stored = as_float32(value)
    texts = (f"{stored:.{digits}g}" for digits in _DIGITS)
    shortest = next(text for text in texts if _is_stored_as(text, stored))
    # as people write it, but for what would be a row of zeros
    return f"{Decimal(shortest):f}" if _PLAIN[0] <= abs(stored) < _PLAIN[1] else shortest


def _is_stored_as(text: str, stored: float) -> bool:
    try:
        return as_float32(float(text)) == stored
    except OverflowError:
        # rounded beyond the largest float32
        return False
