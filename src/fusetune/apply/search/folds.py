"""Which flights are kept aside together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise


def folds(flights: Sequence[str], number: int) -> list[tuple[str, ...]]:
    """Parts of the flights, which are in order of time: what persists from one flight to the next stays together.

    Parts differ by one flight at the most, and none is empty; of a single flight none is kept aside.
    """
    parts = min(number, len(flights))
    if parts < 2:
        return []
    edges = [round(len(flights) * part / parts) for part in range(parts + 1)]
    return [tuple(flights[first:last]) for first, last in pairwise(edges)]
