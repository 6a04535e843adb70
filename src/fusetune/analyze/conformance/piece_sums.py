"""Sums over rows that belong together, of a thousand sets at once.

The cost is that of the rows, however many sets they are of: rows that follow each other and belong together are one
stretch, and stretches are summed in one call. NumPy adds up a stretch as it does an array of its own if a 0 stands
before it, so a sum does not depend on what is summed beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Codes = npt.NDArray[np.integer]


@dataclass(frozen=True)
class Stretches:
    """R stretches of rows that belong together.

    Attributes
    ----------
    order : (N,) in which the rows stand, as an index; None where they stand together as they are
    start, count : (R,) of each stretch in that order
    """

    order: npt.NDArray[np.intp] | None
    start: npt.NDArray[np.intp]
    count: npt.NDArray[np.intp]

    @classmethod
    def of(cls, *codes: Codes) -> Stretches:
        """Rows with the same codes, arrays (N,) each."""
        start = _starts(codes)
        if not _all_differ([one[start] for one in codes]):
            return cls.sorted(*codes)
        return cls(None, start, np.diff(np.append(start, codes[0].size)))

    @classmethod
    def sorted(cls, *codes: Codes) -> Stretches:
        """The same in the order of the first code, then of the second …"""
        whole = _in_one(codes)
        order = np.argsort(whole, kind="stable")
        start = _starts([whole[order]])
        return cls(order, start, np.diff(np.append(start, order.size)))

    def only(self, wanted: npt.NDArray[np.bool_]) -> Stretches:
        """Those of the stretches (R,) that are wanted."""
        return Stretches(self.order, self.start[wanted], self.count[wanted])

    @property
    def first(self) -> npt.NDArray[np.intp]:
        """(R,) a row of each stretch."""
        return self.start if self.order is None else self.order[self.start]

    def laid_out(self, values: npt.NDArray[Any], before: float) -> Array:
        """(M,) values (N,) of the rows as `sums` takes them, and before each stretch another one, whose sum is 0."""
        found = np.take(values, self._rows).astype(np.float64, copy=False)
        found[self._places] = before
        return found

    def each(self, of_stretch: Array) -> Array:
        """(M,) a figure of each stretch (R,) beside all of its rows."""
        return np.repeat(of_stretch, self.count + 1)

    def sums(self, values: Array) -> Array:
        """(R,) sums of the stretches, of figures (M,) that are made of what is laid out."""
        if not self.start.size:
            return np.zeros(0)
        values[self._places] = 0.0
        return np.asarray(np.add.reduceat(values, self._places))

    @cached_property
    def _places(self) -> npt.NDArray[np.intp]:
        """(R,) where the stretches begin in what is laid out, with the place before each."""
        return np.cumsum(self.count) - self.count + np.arange(self.count.size)

    @cached_property
    def _rows(self) -> npt.NDArray[np.intp]:
        """(M,) which row is laid out where; before each stretch any."""
        rows = np.repeat(self.start - 1 - self._places, self.count + 1)
        rows = np.maximum(rows + np.arange(rows.size), 0)
        return rows if self.order is None else self.order[rows]


def _starts(codes: Sequence[Codes]) -> npt.NDArray[np.intp]:
    """Where codes are others than in the row before."""
    if not codes[0].size:
        return np.zeros(0, np.intp)
    begins = np.ones(codes[0].size, bool)
    begins[1:] = codes[0][1:] != codes[0][:-1]
    for one in codes[1:]:
        begins[1:] |= one[1:] != one[:-1]
    return np.flatnonzero(begins)


def _all_differ(codes: Sequence[Codes]) -> bool:
    found = np.sort(_in_one(codes))
    return not bool(np.any(found[1:] == found[:-1]))


def _in_one(codes: Sequence[Codes]) -> npt.NDArray[np.int64]:
    """(N,) one code for several, in the order of the first, then of the second …"""
    whole = np.zeros(codes[0].size, np.int64)
    for one in codes if whole.size else ():
        low = int(one.min())
        whole = whole * (int(one.max()) - low + 1) + (one - low)
    return whole
