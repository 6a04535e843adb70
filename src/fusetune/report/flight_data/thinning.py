"""Which samples of a series are kept, so that a picture of it loses no peak.

Samples are taken in buckets of equally many. Of each the smallest and the largest stay, at their own times, never an
average: however far the view is zoomed out, the line reaches as far up and down as it did.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.int64]

_MOST_FLAGGED = 2
"""In buckets: so many rows that are flagged stay, whatever their values."""


def kept_rows(
    values: npt.NDArray[np.floating],
    buckets: int,
    peaks: Sequence[npt.NDArray[np.floating]] = (),
    flagged: npt.NDArray[np.bool_] | None = None,
) -> Rows:
    """Rows that stay, ascending.

    Parameters
    ----------
    values : (N,), NaN where nothing is
    buckets : how many; of up to twice as many samples all stay
    peaks : further columns (N,) of which the largest of each bucket stays
    flagged : (N,) rows that stay, as long as they are not more than `_MOST_FLAGGED` in a bucket; of more the extremes

    Returns
    -------
    The first and the last row, of each bucket those of its smallest and largest value, those at both ends of what is
    NaN, and one for what is NaN.
    """
    count = len(values)
    if count <= 2 * buckets:
        return np.arange(count)
    stays = np.zeros(count, np.bool_)
    stays[[0, -1]] = True
    for rows in (*_extremes(values, buckets), *(_largest(one, buckets) for one in peaks), _edges(values, buckets)):
        stays[rows] = True
    if flagged is not None:
        rows = np.flatnonzero(flagged)
        stays[rows if rows.size <= _MOST_FLAGGED * buckets else rows[kept_rows(values[rows], buckets)]] = True
    return np.flatnonzero(stays)


def _extremes(values: npt.NDArray[np.floating], buckets: int) -> tuple[Rows, Rows]:
    return _largest(-values, buckets), _largest(values, buckets)


def _largest(values: npt.NDArray[np.floating], buckets: int) -> Rows:
    """Row of the largest value of each bucket, the first of several; of a bucket without any its first row."""
    size = -(-len(values) // buckets)
    parts = np.full(-(-len(values) // size) * size, -np.inf, values.dtype)
    parts[: len(values)] = np.where(np.isnan(values), -np.inf, values)
    parts = parts.reshape(-1, size)
    return np.arange(0, parts.size, size) + np.argmax(parts, axis=1)


def _edges(values: npt.NDArray[np.floating], buckets: int) -> Rows:
    """Rows at both sides of where NaN begins and ends; none where that changes all the time."""
    before = np.flatnonzero(np.diff(np.isnan(values)))
    return np.concatenate([before, before + 1]) if before.size <= buckets else before[:0]
