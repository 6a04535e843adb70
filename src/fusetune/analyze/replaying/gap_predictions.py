"""What a filter predicted in a gap, as means over the last second before each horizon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.ekf2.replay.results import GapResult

HORIZONS = 3
"""Predictions are compared at a third, two thirds and at the end of a gap."""

AVERAGED_S = 1.0
"""Innovations of so long before a horizon are averaged: they share the drift, but not the measurement's noise."""

_MOST_SOURCES = 1 << 16

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


def gap_predictions(results: Sequence[GapResult]) -> dict[str, np.ndarray]:
    """Means of gaps, the columns of a table with one row per gap, source, axis and horizon."""
    if not results:
        return {name: np.zeros(0, dtype) for name, dtype in PREDICTION_COLUMNS.items()}
    rows = np.concatenate([one.innovations for one in results])
    number = np.repeat(np.arange(len(results)), [len(one.innovations) for one in results])
    start, stop = (np.array([getattr(one.gap, name) for one in results], np.int64) for name in ("start", "stop"))
    horizons_s = (stop - start) * 1e-6 / HORIZONS
    elapsed_s = (rows["timestamp_sample"] - np.array([one.start for one in results])[number]) * 1e-6
    horizon = np.ceil(elapsed_s / horizons_s[number]).astype(np.int64)
    before_s = horizon * horizons_s[number] - elapsed_s
    taken = (horizon >= 1) & (horizon <= HORIZONS) & (before_s < AVERAGED_S)
    sources = _MOST_SOURCES * number[taken] + rows["source"][taken]
    key = (sources * 3 + rows["axis"][taken]) * HORIZONS + horizon[taken] - 1
    found, index = np.unique(key, return_inverse=True)
    count = np.bincount(index, minlength=found.size)

    def mean(name: str) -> np.ndarray:
        return np.bincount(index, rows[name][taken].astype(np.float64), found.size) / np.maximum(count, 1)

    source = found // (3 * HORIZONS)
    gap = source // _MOST_SOURCES
    return {
        "gap": gap.astype(np.int32),
        "start": start[gap],
        "stop": stop[gap],
        "source": (source % _MOST_SOURCES).astype(np.int32),
        "axis": (found // HORIZONS % 3).astype(np.int32),
        "horizon_s": (found % HORIZONS + 1) * horizons_s[gap],
        "n": count.astype(np.int32),
        "innovation": mean("innovation"),
        "innovation_variance": mean("innovation_variance"),
    }
