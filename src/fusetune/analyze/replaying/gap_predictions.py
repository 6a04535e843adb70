"""What a filter predicted in a gap, as means over the last second before each horizon."""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.replay.results import GapResult

HORIZONS = 3
"""Predictions are compared at a third, two thirds and at the end of a gap."""

AVERAGED_S = 1.0
"""Innovations of so long before a horizon are averaged: they share the drift, but not the measurement's noise."""

PREDICTION_COLUMNS: dict[str, type] = {
    "gap": np.int32,
    "start": np.int64,
    "stop": np.int64,
    "source": np.int32,
    "axis": np.int32,
    "horizon_s": np.float64,
    "n": np.int32,
    "innovation": np.float64,
    "innovation_variance": np.float64,
}


def gap_predictions(number: int, result: GapResult) -> dict[str, np.ndarray]:
    """Means of one gap, the columns of a table with one row per source, axis and horizon."""
    gap, rows = result.gap, result.innovations
    length_s = (gap.stop - gap.start) * 1e-6
    elapsed_s = (rows["timestamp_sample"] - result.start) * 1e-6
    horizon = np.ceil(elapsed_s / (length_s / HORIZONS)).astype(np.int64)
    before_s = horizon * (length_s / HORIZONS) - elapsed_s
    taken = (horizon >= 1) & (horizon <= HORIZONS) & (before_s < AVERAGED_S)
    key = (rows["source"][taken] * 3 + rows["axis"][taken]) * HORIZONS + horizon[taken] - 1
    found, index = np.unique(key, return_inverse=True)
    count = np.bincount(index, minlength=found.size)

    def mean(name: str) -> np.ndarray:
        return np.bincount(index, rows[name][taken].astype(np.float64), found.size) / np.maximum(count, 1)

    return {
        "gap": np.full(found.size, number, np.int32),
        "start": np.full(found.size, gap.start),
        "stop": np.full(found.size, gap.stop),
        "source": (found // (3 * HORIZONS)).astype(np.int32),
        "axis": (found // HORIZONS % 3).astype(np.int32),
        "horizon_s": (found % HORIZONS + 1) * (length_s / HORIZONS),
        "n": count.astype(np.int32),
        "innovation": mean("innovation"),
        "innovation_variance": mean("innovation_variance"),
    }
