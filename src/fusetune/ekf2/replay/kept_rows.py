"""What is kept of a replay's rows, in arrays that grow: joining the stretches at the end would take them twice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusetune.ekf2.replay.recording import RecordArrays, joined


class KeptRows:
    """Takes the rows of each stretch of a replay.

    Parameters
    ----------
    keep : callable, optional
        What is kept of them, fewer rows or fewer fields; by default all.
    """

    def __init__(self, keep: Callable[[RecordArrays], RecordArrays] | None = None) -> None:
        self._keep = keep
        self._empty = joined(())
        self._bytes = [np.zeros(0, np.uint8) for _ in self._empty]

    def take(self, rows: RecordArrays) -> None:
        """Append the rows of the next stretch."""
        kept = rows if self._keep is None else self._keep(rows)
        self._empty = RecordArrays(*(part[:0] for part in kept))
        for whole, part in zip(self._bytes, kept, strict=True):
            before = whole.size
            # nobody else sees the array before it is handed on
            whole.resize(before + part.nbytes, refcheck=False)
            whole[before:] = np.ascontiguousarray(part).view(np.uint8)

    def rows(self) -> RecordArrays:
        """All that was kept; to be asked for when the replay is over."""
        return RecordArrays(*(whole.view(part.dtype) for whole, part in zip(self._bytes, self._empty, strict=True)))
