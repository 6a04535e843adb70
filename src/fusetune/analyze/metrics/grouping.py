"""Each value once, and where each stands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Kind = TypeVar("Kind", bound=np.generic)


def distinct(values: npt.NDArray[Kind]) -> npt.NDArray[Kind]:
    """The values (N,), none NaN, ascending and each once.

    As `numpy.unique`, which hashes integers: of an hour's time stamps, which nearly are in order, that takes two
    hundred times as long as to sort them.
    """
    ordered = np.sort(values, kind="stable")
    is_new = np.ones(ordered.size, np.bool_)
    is_new[1:] = ordered[1:] != ordered[:-1]
    return ordered[is_new]


def rows_of(number: npt.NDArray[np.int64], wanted: npt.NDArray[np.int64]) -> Iterator[npt.NDArray[np.int64]]:
    """Rows of `number` (N,) that hold each of the wanted numbers, ascending; their cost does not grow with how many."""
    order = np.argsort(number, kind="stable")
    first, stop = (np.searchsorted(number[order], wanted, side) for side in ("left", "right"))
    yield from (order[begin:end] for begin, end in zip(first.tolist(), stop.tolist(), strict=True))
