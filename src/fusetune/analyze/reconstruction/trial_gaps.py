"""How far off the filled rows are: gaps made on trial where the rows are known, and filled in the same way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.analyze.reconstruction.gap_values import fill_missing
from fusetune.px4.flight import TopicTable, stacked

TRIAL_DISTANCE = 5
"""Rows from the end of a gap to the trial gap of the same length."""

MIN_TRIALS = 16


@dataclass(frozen=True)
class TrialGaps:
    """Trial gaps (T,) and what the filled rows got wrong in them."""

    row: np.ndarray
    """First row of each."""
    duration_s: np.ndarray
    error: np.ndarray
    """(T, 3) true less filled integral of the signal over each gap."""


def try_gaps(table: TopicTable, present: np.ndarray, signal: str, window: str) -> TrialGaps:
    """Make and fill gaps after those that the log has.

    Parameters
    ----------
    table : `sensor_combined`, its gaps filled
    present : for each row whether it was measured
    signal : array field of the table, mean over each row's window
    window : field that holds the windows, µs
    """
    edges = np.diff(np.concatenate([[True], present, [True]]).astype(np.int8))
    first, stop = np.flatnonzero(edges == -1), np.flatnonzero(edges == 1)
    length = stop - first
    trial = stop + TRIAL_DISTANCE
    fits = trial + length + 1 < len(present)
    trial, length = trial[fits], length[fits]
    known = np.concatenate([[0], np.cumsum(present)])
    whole = known[trial + length + 1] - known[trial - 1] == length + 2
    trial, length = trial[whole], length[whole]
    if not len(trial):
        return TrialGaps(trial, np.zeros(0), np.zeros((0, 3)))
    starts = np.concatenate([[0], np.cumsum(length)[:-1]])
    rows = np.repeat(trial - starts, length) + np.arange(length.sum())
    left = present.copy()
    left[rows] = False
    step_s = table[window].astype(np.float64)[rows] * 1e-6
    truth = stacked(table, signal).astype(np.float64)
    filled = np.stack([fill_missing(truth[:, axis], left, trial, length) for axis in range(3)], axis=1)
    error = np.add.reduceat((truth[rows] - filled) * step_s[:, None], starts, axis=0)
    return TrialGaps(trial, np.add.reduceat(step_s, starts), error)


def variance_per_second(trials: TrialGaps, error: np.ndarray) -> np.ndarray | None:
    """Variance (3,) of the errors (T, 3) per second of gap; None with too few trials."""
    if len(trials.row) < MIN_TRIALS:
        return None
    return np.sum(error**2, axis=0) / trials.duration_s.sum()
