"""The rows of a full recording cut down to what scores read of them."""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.replay.recording import LOCAL_POSITION_ROW, SCORED_STATE_ROW, RecordArrays

BEFORE_STEP = 2
_COUNTERS = [name for name in LOCAL_POSITION_ROW.names or () if name.endswith("_reset_counter")]


class ScoredRows:
    """Cuts down one stretch of a replay after the other."""

    def __init__(self) -> None:
        self._before = np.zeros(0, LOCAL_POSITION_ROW)
        self._taken = np.zeros(0, bool)

    def cut(self, rows: RecordArrays, is_last: bool) -> RecordArrays:
        """Rows of the next stretch as a SCORING recording has them."""
        return rows._replace(
            states=scored_states(rows.states), local_position=self._around_steps(rows.local_position, is_last)
        )

    def _around_steps(self, new: np.ndarray, is_last: bool) -> np.ndarray:
        rows = np.concatenate([self._before, new])
        wanted = np.zeros(len(rows), bool)
        counters = np.column_stack([rows[name] for name in _COUNTERS])
        steps = np.flatnonzero((counters[1:] != counters[:-1]).any(axis=1)) + 1
        for back in range(BEFORE_STEP + 1):
            wanted[np.maximum(steps - back, 0)] = True
        if not len(self._before):
            wanted[:1] = True
        if is_last:
            wanted[-1:] = True
        old = len(self._before)
        wanted[:old] &= ~self._taken
        taken = np.concatenate([self._taken, np.zeros(len(new), bool)]) | wanted
        self._before, self._taken = rows[-BEFORE_STEP:].copy(), taken[-BEFORE_STEP:]
        return rows[wanted]


def scored_states(rows: np.ndarray) -> np.ndarray:
    """STATE_ROW → SCORED_STATE_ROW."""
    scored = np.zeros(len(rows), SCORED_STATE_ROW)
    scored["timestamp_sample"] = rows["timestamp_sample"]
    for name, field, first in (
        ("quaternion", "states", S.PUBLISHED_QUATERNION),
        ("velocity", "states", S.PUBLISHED_VELOCITY),
        ("attitude_variance", "covariances", S.ATTITUDE),
        ("velocity_variance", "covariances", S.VELOCITY),
        ("position_variance", "covariances", S.POSITION),
    ):
        scored[name] = rows[field][:, first : first + scored[name].shape[1]]
    return scored
