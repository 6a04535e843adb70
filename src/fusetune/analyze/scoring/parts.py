"""Consecutive rows that lie in the same block or window of a flight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Parts(NamedTuple):
    """Parts that hold rows: number of each, its first row, and how many it has, (K,)."""

    number: npt.NDArray[np.int64]
    starts: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]


def parts_of(time: npt.NDArray[np.int64], edges: npt.NDArray[np.int64]) -> Parts:
    """Parts of rows by their times.

    Parameters
    ----------
    time : (N,) µs, in order
    edges : (K + 1,) edges of the parts, µs; what lies beyond the first or the last belongs to the nearest part
    """
    number = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, edges.size - 2)
    starts = np.flatnonzero(np.r_[True, np.diff(number) != 0])
    return Parts(number[starts], starts, np.diff(np.r_[starts, number.size]))
